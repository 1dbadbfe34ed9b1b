"""The memory of a search: discs are closed, traces followed, and all is forgotten."""

import numpy as np
from searched_beliefs import made, open_start, random_belief

from lidarium.mapping.planning.footprint import Footprint
from lidarium.mapping.planning.grid_planning import search
from lidarium.mapping.planning.search.search_state import (
    COLUMN_BITS,
    COLUMN_STEPS,
    NO_ENTRY,
    ROW_SHIFT,
    ROW_STEPS,
    clear,
    close_discs,
    trace,
)


def test_discs_close_the_cells_whose_centres_lie_inside_once():
    remaining, touched = np.zeros((30, 40), np.int32), np.zeros(1200, np.int32)
    discs = np.array([(10.0, 12.0, 4.5), (12.5, 14.0, 3.0), (0.0, 39.0, 2.0), (-20.0, 5.0, 3.0)])
    count = close_discs(remaining, touched, discs)
    row, column = np.indices(remaining.shape)
    inside = np.any(
        [(row - r) ** 2 + (column - c) ** 2 < radius**2 for r, c, radius in discs.tolist()], axis=0
    )
    np.testing.assert_array_equal(remaining == NO_ENTRY, inside)
    assert count == inside.sum()
    packed = touched[:count]
    assert {(cell >> ROW_SHIFT, cell & COLUMN_BITS) for cell in packed.tolist()} == set(
        map(tuple, np.argwhere(inside).tolist())
    )


def test_what_a_search_touched_is_forgotten():
    belief = random_belief(5)
    space, field = made(belief)
    footprint = Footprint(0.03, 0.1)
    search(space, belief, field, open_start(belief, footprint, 1), footprint)
    assert space.touched_count > 50
    clear(space.remaining, space.touched, space.touched_count)
    assert not space.remaining.any()


def test_a_trace_leads_from_the_start_step_by_step():
    parent = np.zeros((12, 12), np.uint8)
    cells = [(5, 5)]
    for direction in (0, 4, 2, 5, 1, 7, 3, 7, 6):
        row, column = cells[-1][0] + ROW_STEPS[direction], cells[-1][1] + COLUMN_STEPS[direction]
        parent[row, column] = direction
        cells.append((int(row), int(column)))
    assert len(set(cells)) == len(cells)
    assert trace(parent, 5, 5, *cells[-1]).tolist() == [list(cell) for cell in cells]
    assert trace(parent, 5, 5, 5, 5).tolist() == [[5, 5]]
