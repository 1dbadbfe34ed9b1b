"""The kernel of all searches over a belief.

Dijkstra's algorithm and A* with buckets.

Costs are integers, so that sums are exact and the same everywhere: a straight step on open floor costs 4756
units and a diagonal one 6726 (their ratio is sqrt 2 to one part in ten million). A bucket holds the cells of
a band of costs that is narrower than the cheapest step; so nothing inside a bucket can improve anything else
inside it, its cells need no order, and the search is exact without a heap (Dial, Algorithm 360, CACM 1969;
Denardo and Fox, Operations Research 1979). A* has steps that add nothing to its estimate; there a bucket is
worked on until it stays empty.

A search keeps what *remains* of its budget in each cell, 0 = not reached: memory is touched only where the
search goes, and cleared from the list of touched cells.
"""

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.grids.grid_lines import line_is_open
from lidarium.mapping.kernels.compilation import Array, kernel

STRAIGHT = 4756
DIAGONAL = 6726
BUCKET_SHIFT = 12
NO_ENTRY = 2**31 - 1  # what remains in a cell that a disc blocks: no path improves on it
LARGEST_BUDGET = 2**31 - 2
LEAVING = 8  # mark beside the direction in `parent`: the cell is passed only to leave a blocked zone
TILE_SHIFT = 4  # targets are counted in tiles of 16 x 16 cells

ROW_STEPS = np.array([0, 0, 1, -1, 1, 1, -1, -1])
COLUMN_STEPS = np.array([1, -1, 0, 0, 1, -1, 1, -1])


@kernel
def close_discs(remaining: NDArray[np.int32], touched: NDArray[np.int32], discs: NDArray[np.float64]) -> int:
    """Mark the cells whose centres lie inside discs (row, column, radius in cells).

    Return how many (kernel).
    """
    rows, columns = remaining.shape
    count = 0
    for k in range(len(discs)):
        centre_row, centre_column, radius = discs[k]
        for row in range(max(int(centre_row - radius), 0), min(int(centre_row + radius) + 2, rows)):
            for column in range(
                max(int(centre_column - radius), 0), min(int(centre_column + radius) + 2, columns)
            ):
                if (row - centre_row) ** 2 + (column - centre_column) ** 2 < radius * radius and remaining[
                    row, column
                ] == 0:
                    remaining[row, column] = NO_ENTRY
                    touched[count] = (row << 16) | column
                    count += 1
    return count


@kernel
def clear(remaining: NDArray[np.int32], touched: NDArray[np.int32], count: int) -> None:
    """Forget a search (kernel)."""
    for i in range(count):
        remaining[touched[i] >> 16, touched[i] & 0xFFFF] = 0


@kernel
def trace(parent: Array, start_row: int, start_column: int, row: int, column: int) -> NDArray[np.int64]:
    """Follow the parents from a cell back to the start.

    Return the cells from the start on (kernel).
    """
    end_row, end_column = row, column
    count = 1
    while row != start_row or column != start_column:
        direction: int = parent[row, column] % LEAVING
        row -= ROW_STEPS[direction]
        column -= COLUMN_STEPS[direction]
        count += 1
    cells = np.empty((count, 2), np.int64)
    row, column = end_row, end_column
    for i in range(count - 1, -1, -1):
        cells[i, 0] = row
        cells[i, 1] = column
        direction = parent[row, column] % LEAVING
        if i > 0:
            row -= ROW_STEPS[direction]
            column -= COLUMN_STEPS[direction]
    return cells


@kernel
def _estimate(row: int, column: int, goal_row: int, goal_column: int) -> int:
    """Cost of the way to the goal on open floor."""
    rise = abs(goal_row - row)
    run = abs(goal_column - column)
    return STRAIGHT * max(rise, run) + (DIAGONAL - STRAIGHT) * min(rise, run)


@kernel
def sees_target(
    log_odds: NDArray[np.int8],
    mask: NDArray[np.uint8],
    near: NDArray[np.uint8],
    spans: NDArray[np.int64],
    row: int,
    column: int,
) -> bool:
    """Whether a cell with mask 1 is within reach and sight of a cell (kernel).

    Within the disc of ``spans`` around the cell, and in its line of sight.
    """
    if near[row >> TILE_SHIFT, column >> TILE_SHIFT] == 0:
        return False
    reach = len(spans) // 2
    rows, columns = mask.shape
    for other in range(max(row - reach, 0), min(row + reach + 1, rows)):
        span = spans[other - row + reach]
        for another in range(max(column - span, 0), min(column + span + 1, columns)):
            if mask[other, another] == 1 and line_is_open(log_odds, row, column, other, another):
                return True
    return False


@kernel
def _margin(
    closeness: NDArray[np.uint16],
    limit: int,
    radius: float,
    discs: NDArray[np.float64],
    row: int,
    column: int,
) -> float:
    """Return the room [cells] between a body centred in a cell and obstacles.

    To the nearest wall or disc; negative inside a blocked zone.
    """
    margin = np.sqrt(float(limit - closeness[row, column])) * 0.5 - radius
    for k in range(len(discs)):
        distance = np.sqrt((row - discs[k, 0]) ** 2 + (column - discs[k, 1]) ** 2)
        margin = min(margin, distance - discs[k, 2])
    return float(margin)


@kernel(inline=True)
def _step_is_open(
    log_odds: Array, closeness: Array, half_costs: Array, roomy: int, nearest: int, beside: int, abeam: int
) -> bool:
    """Whether a diagonal step keeps its clearance between its ends.

    The ends have closeness up to ``nearest``; grids and places are flat.

    Between the centres of two diagonal neighbours the squared clearance in half cells falls at most 2 below
    that of both ends, and not at all where both cells beside the step have it too. So the path of centres is
    exact.
    """
    free_beside, free_abeam = log_odds[beside] < 0, log_odds[abeam] < 0
    if nearest <= roomy:
        return bool(free_beside or free_abeam)
    if not (free_beside and free_abeam):
        return False
    return bool(half_costs[0, closeness[beside]] > 0 and half_costs[0, closeness[abeam]] > 0)


@kernel
def _leave(
    log_odds: NDArray[np.int8],
    closeness: NDArray[np.uint16],
    limit: int,
    half_costs: NDArray[np.int32],
    radius: float,
    discs: NDArray[np.float64],
    remaining: NDArray[np.int32],
    parent: NDArray[np.uint8],
    touched: NDArray[np.int32],
    touched_count: int,
    buckets: NDArray[np.int32],
    sizes: Array,
    fullest: int,
    row: int,
    column: int,
    budget: int,
    goal_row: int,
    goal_column: int,
    guided: bool,
) -> tuple[int, int, int]:
    """Expand a cell inside a blocked zone.

    Steps lead to open cells, or to blocked ones with no less room.

    Each step costs as much as the dearest of all, so that the way out is short.
    """
    rows, columns = log_odds.shape
    pushed = 0
    margin = _margin(closeness, limit, radius, discs, row, column)
    after = remaining[row, column] - 2 * half_costs.max()
    for k in range(8):
        to_row = row + ROW_STEPS[k]
        to_column = column + COLUMN_STEPS[k]
        if (
            to_row < 0
            or to_row >= rows
            or to_column < 0
            or to_column >= columns
            or log_odds[to_row, to_column] >= 0
        ):
            continue
        if k >= 4 and (log_odds[to_row, column] > 0 or log_odds[row, to_column] > 0):
            continue
        is_new = remaining[to_row, to_column] == 0
        before = 0 if remaining[to_row, to_column] == NO_ENTRY else remaining[to_row, to_column]
        if after <= before:
            continue
        was_passed = before > 0 and parent[to_row, to_column] >= LEAVING
        mark = 0
        if (
            half_costs[0, closeness[to_row, to_column]] == 0
            or remaining[to_row, to_column] == NO_ENTRY
            or was_passed
        ):
            if _margin(closeness, limit, radius, discs, to_row, to_column) < margin:
                continue
            mark = LEAVING
        to_cell = (to_row << 16) | to_column
        if is_new:
            touched[touched_count] = to_cell
            touched_count += 1
        remaining[to_row, to_column] = after
        parent[to_row, to_column] = k | mark
        ahead = _estimate(to_row, to_column, goal_row, goal_column) if guided else 0
        slot: int = ((budget - after + ahead) >> BUCKET_SHIFT) & (buckets.shape[0] - 1)
        buckets[slot, sizes[slot]] = to_cell
        sizes[slot] += 1
        fullest = max(fullest, sizes[slot])
        pushed += 1
    return touched_count, fullest, pushed


@kernel
def _expand_band(
    log_odds: NDArray[np.int8],
    closeness: NDArray[np.uint16],
    limit: int,
    half_costs: NDArray[np.int32],
    roomy: int,
    radius: float,
    discs: NDArray[np.float64],
    remaining: NDArray[np.int32],
    parent: NDArray[np.uint8],
    touched: NDArray[np.int32],
    buckets: NDArray[np.int32],
    sizes: Array,
    counts: NDArray[np.int64],
    flat_steps: NDArray[np.int64],
    packed_steps: NDArray[np.int64],
    current: int,
    first: int,
    budget: int,
    goal_row: int,
    goal_column: int,
    guided: bool,
    mask: NDArray[np.uint8],
    near: NDArray[np.uint8],
    spans: NDArray[np.int64],
    wanted: int,
    hits: NDArray[np.int32],
) -> int:
    """Expand the cells of one band of costs from number ``first`` on.

    Return where the buckets were too full, or the end.

    ``counts`` holds the numbers of touched cells, of hits, of waiting entries, and of entries in the fullest
    bucket.
    """
    rows, columns = log_odds.shape
    slots = buckets.shape[0] - 1
    slot = current & slots
    touched_count, hit_count, pending, fullest = counts
    log_odds_at = log_odds.reshape(-1)
    closeness_at = closeness.reshape(-1)
    remaining_at = remaining.reshape(-1)
    parent_at = parent.reshape(-1)
    i = first
    while i < sizes[slot] and fullest + 8 <= buckets.shape[1]:
        cell = buckets[slot, i]
        i += 1
        row = cell >> 16
        column = cell & 0xFFFF
        here = np.uintp(row * columns + column)
        left = remaining_at[here]
        estimate = budget - left
        if guided:
            estimate += _estimate(row, column, goal_row, goal_column)
        if estimate >> BUCKET_SHIFT != current:
            continue  # reached more cheaply in the meantime
        if parent_at[here] >= LEAVING:
            touched_count, fullest, pushed = _leave(
                log_odds,
                closeness,
                limit,
                half_costs,
                radius,
                discs,
                remaining,
                parent,
                touched,
                touched_count,
                buckets,
                sizes,
                fullest,
                row,
                column,
                budget,
                goal_row,
                goal_column,
                guided,
            )
            pending += pushed
            continue
        if wanted > 0 and sees_target(log_odds, mask, near, spans, row, column):
            hits[hit_count] = cell
            hit_count += 1
        inside = 0 < row < rows - 1 and 0 < column < columns - 1
        own_closeness = closeness_at[here]
        own_straight = half_costs[0, own_closeness]
        own_diagonal = half_costs[1, own_closeness]
        for k in range(8):
            if not inside:
                to_row, to_column = row + ROW_STEPS[k], column + COLUMN_STEPS[k]
                if to_row < 0 or to_row >= rows or to_column < 0 or to_column >= columns:
                    continue
            there = np.uintp(np.int64(here) + flat_steps[k])
            before = remaining_at[there]
            if before >= left - (DIAGONAL if k >= 4 else STRAIGHT) or log_odds_at[there] >= 0:
                continue
            to_closeness = closeness_at[there]
            half = half_costs[k >> 2, to_closeness]
            after = left - half - (own_diagonal if k >= 4 else own_straight)
            if half == 0 or after <= before or (before > 0 and parent_at[there] >= LEAVING):
                continue
            if k >= 4:
                beside, abeam = (
                    np.uintp(np.int64(here) + ROW_STEPS[k] * columns),
                    np.uintp(np.int64(here) + COLUMN_STEPS[k]),
                )
                nearest = max(own_closeness, to_closeness)
                if not _step_is_open(log_odds_at, closeness_at, half_costs, roomy, nearest, beside, abeam):
                    continue
            to_cell = np.int32(cell + packed_steps[k])
            if before == 0:
                touched[np.uintp(touched_count)] = to_cell
                touched_count += 1
            remaining_at[there] = after
            parent_at[there] = k
            ahead = (
                _estimate(row + ROW_STEPS[k], column + COLUMN_STEPS[k], goal_row, goal_column)
                if guided
                else 0
            )
            bucket = (budget - after + ahead) >> BUCKET_SHIFT
            if before > 0 and bucket != current and (budget - before + ahead) >> BUCKET_SHIFT == bucket:
                continue  # it waits there already
            to_slot = np.uintp(bucket & slots)
            size = sizes[to_slot]
            buckets[to_slot, np.uintp(size)] = to_cell
            sizes[to_slot] = size + 1
            fullest = max(fullest, size + 1)
            pending += 1
    counts[:] = touched_count, hit_count, pending, fullest
    return i


@kernel
def spread(
    log_odds: NDArray[np.int8],
    closeness: NDArray[np.uint16],
    limit: int,
    half_costs: NDArray[np.int32],
    roomy: int,
    radius: float,
    discs: NDArray[np.float64],
    remaining: NDArray[np.int32],
    parent: NDArray[np.uint8],
    touched: NDArray[np.int32],
    touched_count: int,
    buckets: NDArray[np.int32],
    start_row: int,
    start_column: int,
    budget: int,
    goal_row: int,
    goal_column: int,
    guided: bool,
    mask: NDArray[np.uint8],
    near: NDArray[np.uint8],
    spans: NDArray[np.int64],
    wanted: int,
    beyond: int,
    hits: NDArray[np.int32],
) -> tuple[int, int, int, NDArray[np.int32]]:
    """Spread costs from the start until an end condition is met (kernel).

    The goal, the wanted number of targets, the budget or all is reached.

    With the targets found it goes on to costs of ``beyond`` above theirs. Returns the number of touched
    cells, of targets hit, the last band of costs that is final, and the buckets (grown where they were too
    small).
    """
    sizes = np.zeros(buckets.shape[0], np.int64)
    start_is_open = (
        log_odds[start_row, start_column] < 0 and half_costs[0, closeness[start_row, start_column]] > 0
    )
    start_is_open = start_is_open and remaining[start_row, start_column] == 0
    remaining[start_row, start_column] = budget
    parent[start_row, start_column] = 0 if start_is_open else LEAVING
    touched[touched_count] = (start_row << 16) | start_column
    current = _estimate(start_row, start_column, goal_row, goal_column) >> BUCKET_SHIFT if guided else 0
    last = LARGEST_BUDGET
    slot = current & (buckets.shape[0] - 1)
    buckets[slot, 0] = (start_row << 16) | start_column
    sizes[slot] = 1
    counts = np.array([touched_count + 1, 0, 1, 1])
    flat_steps, packed_steps = np.empty(8, np.int64), np.empty(8, np.int64)
    for k in range(8):
        flat_steps[k] = ROW_STEPS[k] * log_odds.shape[1] + COLUMN_STEPS[k]
        packed_steps[k] = (ROW_STEPS[k] << 16) + COLUMN_STEPS[k]
    while counts[2] > 0:
        slot = current & (buckets.shape[0] - 1)
        i = 0
        while i < sizes[slot]:
            i = _expand_band(
                log_odds,
                closeness,
                limit,
                half_costs,
                roomy,
                radius,
                discs,
                remaining,
                parent,
                touched,
                buckets,
                sizes,
                counts,
                flat_steps,
                packed_steps,
                current,
                i,
                budget,
                goal_row,
                goal_column,
                guided,
                mask,
                near,
                spans,
                wanted,
                hits,
            )
            if counts[3] + 8 > buckets.shape[1]:
                wider = np.empty((buckets.shape[0], 2 * buckets.shape[1]), np.int32)
                wider[:, : buckets.shape[1]] = buckets
                buckets = wider
        counts[2] -= sizes[slot]
        sizes[slot] = 0
        if goal_row >= 0 and (budget - remaining[goal_row, goal_column]) >> BUCKET_SHIFT <= current:
            break
        if 0 < wanted <= counts[1]:
            last = current + 1 + (beyond >> BUCKET_SHIFT) if beyond > 0 else current
            wanted = 0
        if current >= last:
            break
        current += 1
    return counts[0], counts[1], current, buckets
