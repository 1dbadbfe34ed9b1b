"""The kernel of all searches over a belief.

Dijkstra's algorithm and A* with buckets.

Costs are integers, so that sums are exact and the same everywhere: a straight step on open floor costs 4756
units and a diagonal one 6726 (their ratio is sqrt 2 to one part in ten million). A bucket holds the cells of
a band of costs that is narrower than the cheapest step; so nothing inside a bucket can improve anything else
inside it, its cells need no order, and the search is exact without a heap (Dial, Algorithm 360, CACM 1969;
Denardo and Fox, Operations Research 1979). A* has steps that add nothing to its estimate; there a bucket is
worked on until it stays empty.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.grids.grid_lines import line_is_open
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.planning.search.search_state import (
    BUCKET_SHIFT,
    COLUMN_BITS,
    COLUMN_STEPS,
    DIAGONAL,
    DIRECTIONS,
    FIRST_DIAGONAL,
    FLAT_STEPS,
    FULLEST,
    HITS,
    LARGEST_BUDGET,
    LEAVING,
    NO_ENTRY,
    PACKED_STEPS,
    PENDING,
    ROW_SHIFT,
    ROW_STEPS,
    STRAIGHT,
    TILE_SHIFT,
    TOUCHED,
    Lookout,
    SearchState,
    Task,
    Terrain,
)

ROOM_FOR_A_CELL = 8
"""Maximum number of bucket entries that one cell can add."""


class _Flat(NamedTuple):
    """Grids by flat index, row * columns + column."""

    log_odds: NDArray[np.int8]
    closeness: NDArray[np.uint16]
    remaining: NDArray[np.int32]
    parent: NDArray[np.uint8]


class _Tally(NamedTuple):
    """Numbers of touched cells, waiting entries, and entries in the fullest bucket."""

    touched: int
    pending: int
    fullest: int


@kernel(forceinline=True, nrt=False)
def _estimate(row: int, column: int, task: Task) -> int:
    """Return the minimum cost from a cell to the goal, as on open floor (kernel)."""
    rise = abs(task.goal_row - row)
    run = abs(task.goal_column - column)
    return STRAIGHT * max(rise, run) + (DIAGONAL - STRAIGHT) * min(rise, run)


@kernel(nrt=False)
def _expand_band(
    terrain: Terrain, state: SearchState, task: Task, lookout: Lookout, band: int, first: int, wanted: int
) -> int:
    """Expand the cells of one band of costs from index ``first`` on, for ``wanted`` targets (kernel).

    Returns the index at which the buckets were too full, or the end.
    """
    slot = band & (state.buckets.shape[0] - 1)
    columns = terrain.log_odds.shape[1]
    counts, buckets, sizes = state.counts, state.buckets, state.sizes
    tally, hit_count = _Tally(counts[TOUCHED], counts[PENDING], counts[FULLEST]), counts[HITS]
    flat = _Flat(
        terrain.log_odds.reshape(-1),
        terrain.closeness.reshape(-1),
        state.remaining.reshape(-1),
        state.parent.reshape(-1),
    )
    i = first
    while i < sizes[slot] and tally.fullest + ROOM_FOR_A_CELL <= buckets.shape[1]:
        cell = buckets[slot, i]
        i += 1
        row = cell >> ROW_SHIFT
        column = cell & COLUMN_BITS
        here = np.uintp(row * columns + column)
        whole = task.budget - flat.remaining[here]
        if task.is_guided:
            whole += _estimate(row, column, task)
        if whole >> BUCKET_SHIFT != band:
            continue  # reached more cheaply in the meantime
        if flat.parent[here] >= LEAVING:
            tally = _leave(terrain, state, task, row, column, tally)
            continue
        if wanted > 0 and _sees_target(terrain.log_odds, lookout, row, column):
            lookout.hits[hit_count] = cell
            hit_count += 1
        tally = _expand_cell(terrain, flat, state, task, cell, band, tally)
    counts[TOUCHED], counts[HITS] = tally.touched, hit_count
    counts[PENDING], counts[FULLEST] = tally.pending, tally.fullest
    return i


@kernel(forceinline=True, nrt=False)
def _expand_cell(
    terrain: Terrain, flat: _Flat, state: SearchState, task: Task, cell: int, band: int, tally: _Tally
) -> _Tally:
    """Take all steps from a cell that reach neighbours more cheaply than before."""
    rows, columns = terrain.log_odds.shape
    half_costs, steps = terrain.passage.half_costs, state.steps
    touched, pending, fullest = tally.touched, tally.pending, tally.fullest
    row, column = cell >> ROW_SHIFT, cell & COLUMN_BITS
    here = np.uintp(row * columns + column)
    inside = 0 < row < rows - 1 and 0 < column < columns - 1
    left, own_closeness = flat.remaining[here], flat.closeness[here]
    own_straight = half_costs[0, own_closeness]
    own_diagonal = half_costs[1, own_closeness]
    for k in range(DIRECTIONS):
        is_diagonal = k >= FIRST_DIAGONAL
        if not inside and not _is_within(row + ROW_STEPS[k], column + COLUMN_STEPS[k], rows, columns):
            continue
        there = np.uintp(np.int64(here) + steps[FLAT_STEPS, k])
        before = flat.remaining[there]
        if before >= left - (DIAGONAL if is_diagonal else STRAIGHT) or flat.log_odds[there] >= 0:
            continue
        to_closeness = flat.closeness[there]
        half = half_costs[int(is_diagonal), to_closeness]
        after = left - half - (own_diagonal if is_diagonal else own_straight)
        if half == 0 or after <= before or (before > 0 and flat.parent[there] >= LEAVING):
            continue
        if is_diagonal and not _step_is_open(terrain, flat, here, k, max(own_closeness, to_closeness)):
            continue
        to_cell = np.int32(cell + steps[PACKED_STEPS, k])
        if before == 0:
            state.touched[np.uintp(touched)] = to_cell
            touched += 1
        flat.remaining[there] = after
        flat.parent[there] = k
        ahead = _estimate(row + ROW_STEPS[k], column + COLUMN_STEPS[k], task) if task.is_guided else 0
        bucket = (task.budget - after + ahead) >> BUCKET_SHIFT
        if before > 0 and bucket != band and (task.budget - before + ahead) >> BUCKET_SHIFT == bucket:
            continue  # it waits there already
        fullest = max(fullest, _queue(state, bucket, to_cell))
        pending += 1
    return _Tally(touched, pending, fullest)


@kernel(forceinline=True, nrt=False)
def _queue(state: SearchState, bucket: int, cell: int) -> int:
    """Let a cell wait in a bucket; return how many wait there."""
    slot = np.uintp(bucket & (state.buckets.shape[0] - 1))
    size = state.sizes[slot]
    state.buckets[slot, np.uintp(size)] = cell
    state.sizes[slot] = size + 1
    return int(size + 1)


@kernel(forceinline=True, nrt=False)
def _is_within(row: int, column: int, rows: int, columns: int) -> bool:
    """Whether a cell lies within the grid."""
    return bool(0 <= row < rows and 0 <= column < columns)


@kernel(forceinline=True, nrt=False)
def _step_is_open(terrain: Terrain, flat: _Flat, here: int, k: int, nearest: int) -> bool:
    """Whether a diagonal step keeps its clearance between its ends.

    The ends have closeness up to ``nearest``.

    Between the centres of two diagonal neighbours the squared clearance in half cells falls at most 2 below that of
    both ends, and not at all if both cells next to the step have it too. So the path of centres is exact.
    """
    beside = np.uintp(np.int64(here) + ROW_STEPS[k] * terrain.log_odds.shape[1])
    abeam = np.uintp(np.int64(here) + COLUMN_STEPS[k])
    free_beside, free_abeam = flat.log_odds[beside] < 0, flat.log_odds[abeam] < 0
    if nearest <= terrain.passage.roomy:
        return bool(free_beside or free_abeam)
    if not (free_beside and free_abeam):
        return False
    half_costs = terrain.passage.half_costs
    return bool(half_costs[0, flat.closeness[beside]] > 0 and half_costs[0, flat.closeness[abeam]] > 0)


@kernel(nrt=False)
def _sees_target(log_odds: Array, lookout: Lookout, row: int, column: int) -> bool:
    """Whether a target is within reach, the disc of ``spans``, and in the line of sight of a cell."""
    mask, spans = lookout.mask, lookout.spans
    if lookout.near[row >> TILE_SHIFT, column >> TILE_SHIFT] == 0:
        return False
    reach = len(spans) // 2
    rows, columns = mask.shape
    for other in range(max(row - reach, 0), min(row + reach + 1, rows)):
        span = spans[other - row + reach]
        for another in range(max(column - span, 0), min(column + span + 1, columns)):
            if mask[other, another] == 1 and line_is_open(log_odds, row, column, other, another):
                return True
    return False


@kernel(nrt=False)
def _leave(terrain: Terrain, state: SearchState, task: Task, row: int, column: int, tally: _Tally) -> _Tally:
    """Expand a cell inside a blocked zone: to open cells, or to blocked ones with no less clearance.

    Each step costs as much as the most expensive of all, so that the way out is short.
    """
    remaining, parent = state.remaining, state.parent
    touched, pending, fullest = tally.touched, tally.pending, tally.fullest
    margin = _margin(terrain, row, column)
    after = remaining[row, column] - 2 * _max_half_cost(terrain.passage.half_costs)
    for k in range(DIRECTIONS):
        to_row = row + ROW_STEPS[k]
        to_column = column + COLUMN_STEPS[k]
        if not _is_passable(terrain.log_odds, row, column, k):
            continue
        is_new = remaining[to_row, to_column] == 0
        before = 0 if remaining[to_row, to_column] == NO_ENTRY else remaining[to_row, to_column]
        if after <= before:
            continue
        mark = 0
        if _is_blocked(terrain, state, to_row, to_column):
            if _margin(terrain, to_row, to_column) < margin:
                continue
            mark = LEAVING
        to_cell = (to_row << ROW_SHIFT) | to_column
        if is_new:
            state.touched[touched] = to_cell
            touched += 1
        remaining[to_row, to_column] = after
        parent[to_row, to_column] = k | mark
        ahead = _estimate(to_row, to_column, task) if task.is_guided else 0
        fullest = max(fullest, _queue(state, (task.budget - after + ahead) >> BUCKET_SHIFT, to_cell))
        pending += 1
    return _Tally(touched, pending, fullest)


@kernel(nrt=False)
def _max_half_cost(half_costs: Array) -> int:
    """Return half the cost of the most expensive step."""
    dearest = 0
    for kind in range(half_costs.shape[0]):
        for closeness in range(half_costs.shape[1]):
            dearest = max(dearest, half_costs[kind, closeness])
    return dearest


@kernel(nrt=False)
def _margin(terrain: Terrain, row: int, column: int) -> float:
    """Return the distance [cells] of a body centred in a cell to the nearest wall or disc.

    It is negative inside a blocked zone.
    """
    passage, discs = terrain.passage, terrain.discs
    margin = np.sqrt(float(passage.limit - terrain.closeness[row, column])) * 0.5 - passage.radius
    for k in range(len(discs)):
        distance = np.sqrt((row - discs[k, 0]) ** 2 + (column - discs[k, 1]) ** 2)
        margin = min(margin, distance - discs[k, 2])
    return float(margin)


@kernel(nrt=False)
def _is_passable(log_odds: Array, row: int, column: int, k: int) -> bool:
    """Whether a step leads to a free cell of the grid without cutting an occupied corner."""
    to_row = row + ROW_STEPS[k]
    to_column = column + COLUMN_STEPS[k]
    if not _is_within(to_row, to_column, log_odds.shape[0], log_odds.shape[1]):
        return False
    if log_odds[to_row, to_column] >= 0:
        return False
    is_free_beside = log_odds[to_row, column] <= 0 and log_odds[row, to_column] <= 0
    return bool(k < FIRST_DIAGONAL or is_free_beside)


@kernel(nrt=False)
def _is_blocked(terrain: Terrain, state: SearchState, row: int, column: int) -> bool:
    """Whether a cell belongs to a blocked zone, or was passed only to leave one."""
    left = state.remaining[row, column]
    if terrain.passage.half_costs[0, terrain.closeness[row, column]] == 0 or left == NO_ENTRY:
        return True
    return bool(left > 0 and state.parent[row, column] >= LEAVING)


@kernel
def spread(terrain: Terrain, state: SearchState, task: Task, lookout: Lookout) -> tuple[int, int, int]:
    """Spread costs from the start until an end condition is met (kernel).

    It ends at the goal, the wanted number of targets and ``beyond`` their costs, the budget, or when all cells are
    reached. Buckets grow if they are too small.
    """
    counts, sizes, remaining = state.counts, state.sizes, state.remaining
    slots = state.buckets.shape[0] - 1
    band, last, wanted = _begin(terrain, state, task), LARGEST_BUDGET, task.wanted
    while counts[PENDING] > 0:
        slot = band & slots
        i = 0
        while i < sizes[slot]:
            i = _expand_band(terrain, state, task, lookout, band, i, wanted)
            if counts[FULLEST] + ROOM_FOR_A_CELL > state.buckets.shape[1]:
                state = _widened(state)
        counts[PENDING] -= sizes[slot]
        sizes[slot] = 0
        if task.goal_row >= 0:
            left = remaining[task.goal_row, task.goal_column]
            if left != NO_ENTRY and (task.budget - left) >> BUCKET_SHIFT <= band:
                break
        if 0 < wanted <= counts[HITS]:
            last = band + 1 + (task.beyond >> BUCKET_SHIFT) if task.beyond > 0 else band
            wanted = 0
        if band >= last:
            break
        band += 1
    return counts[TOUCHED], counts[HITS], band


@kernel(nrt=False)
def _begin(terrain: Terrain, state: SearchState, task: Task) -> int:
    """Make the start the only waiting cell; return its band of costs."""
    row, column = task.start_row, task.start_column
    is_open = (
        terrain.log_odds[row, column] < 0
        and terrain.passage.half_costs[0, terrain.closeness[row, column]] > 0
        and state.remaining[row, column] == 0
    )
    state.remaining[row, column] = task.budget
    state.parent[row, column] = 0 if is_open else LEAVING
    state.touched[state.counts[TOUCHED]] = (row << ROW_SHIFT) | column
    band = _estimate(row, column, task) >> BUCKET_SHIFT if task.is_guided else 0
    slot = band & (state.buckets.shape[0] - 1)
    state.buckets[slot, 0] = (row << ROW_SHIFT) | column
    state.sizes[slot] = 1
    state.counts[TOUCHED] += 1
    state.counts[HITS], state.counts[PENDING], state.counts[FULLEST] = 0, 1, 1
    for k in range(DIRECTIONS):
        state.steps[FLAT_STEPS, k] = ROW_STEPS[k] * terrain.log_odds.shape[1] + COLUMN_STEPS[k]
        state.steps[PACKED_STEPS, k] = (ROW_STEPS[k] << ROW_SHIFT) + COLUMN_STEPS[k]
    return band


@kernel
def _widened(state: SearchState) -> SearchState:
    """Return the same search with buckets of twice the size."""
    buckets = state.buckets
    wider = np.empty((buckets.shape[0], 2 * buckets.shape[1]), np.int32)
    wider[:, : buckets.shape[1]] = buckets
    return SearchState(state.remaining, state.parent, state.touched, wider, state.sizes, state.counts, state.steps)
