"""The kernel of all searches over a belief.

Dijkstra's algorithm and A* with buckets.

Costs are integers, so that sums are exact and the same everywhere: a straight step on open floor costs 4756
units and a diagonal one 6726 (their ratio is sqrt 2 to one part in ten million). A bucket holds the cells of
a band of costs that is narrower than the cheapest step; so nothing inside a bucket can improve anything else
inside it, its cells need no order, and the search is exact without a heap (Dial, Algorithm 360, CACM 1969;
Denardo and Fox, Operations Research 1979). A* has steps that add nothing to its estimate; there a bucket is
worked on until it stays empty.
"""

import numpy as np

from lidarium.mapping.kernels.compilation import kernel
from lidarium.mapping.planning.search.band_expansion import ROOM_FOR_A_CELL, estimate, expand_band
from lidarium.mapping.planning.search.search_state import (
    BUCKET_SHIFT,
    COLUMN_STEPS,
    DIRECTIONS,
    FLAT_STEPS,
    FULLEST,
    HITS,
    LARGEST_BUDGET,
    LEAVING,
    PACKED_STEPS,
    PENDING,
    ROW_SHIFT,
    ROW_STEPS,
    TOUCHED,
    Lookout,
    SearchState,
    Task,
    Terrain,
)


@kernel
def spread(terrain: Terrain, state: SearchState, task: Task, lookout: Lookout) -> tuple[int, int, int]:
    """Spread costs from the start until an end condition is met (kernel).

    The goal, the wanted number of targets, the budget or all is reached.

    With the targets found it goes on to costs of ``beyond`` above theirs. Buckets grow where they are too
    small.

    Returns
    -------
    touched, hits : int
        Numbers of touched cells and of targets hit.
    band : int
        The last band of costs that is final.
    """
    counts, sizes, remaining = state.counts, state.sizes, state.remaining
    slots = state.buckets.shape[0] - 1
    band, last, wanted = _begin(terrain, state, task), LARGEST_BUDGET, task.wanted
    while counts[PENDING] > 0:
        slot = band & slots
        i = 0
        while i < sizes[slot]:
            i = expand_band(terrain, state, task, lookout, band, i, wanted)
            if counts[FULLEST] + ROOM_FOR_A_CELL > state.buckets.shape[1]:
                state = _widened(state)
        counts[PENDING] -= sizes[slot]
        sizes[slot] = 0
        if task.goal_row >= 0:
            left = remaining[task.goal_row, task.goal_column]
            if (task.budget - left) >> BUCKET_SHIFT <= band:
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
    """Let the start wait as the only cell; return its band of costs."""
    row, column = task.start_row, task.start_column
    is_open = (
        terrain.log_odds[row, column] < 0
        and terrain.passage.half_costs[0, terrain.closeness[row, column]] > 0
        and state.remaining[row, column] == 0
    )
    state.remaining[row, column] = task.budget
    state.parent[row, column] = 0 if is_open else LEAVING
    state.touched[state.counts[TOUCHED]] = (row << ROW_SHIFT) | column
    band = estimate(row, column, task) >> BUCKET_SHIFT if task.is_guided else 0
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
    """Return the same search with buckets of twice the room."""
    buckets = state.buckets
    wider = np.empty((buckets.shape[0], 2 * buckets.shape[1]), np.int32)
    wider[:, : buckets.shape[1]] = buckets
    return SearchState(
        state.remaining, state.parent, state.touched, wider, state.sizes, state.counts, state.steps
    )
