import numpy as np
import pytest

from lidarium.evaluation.report.map_layers import (
    FREE,
    MOST_CELLS,
    OCCUPIED,
    UNKNOWN,
    coarse,
    grid_around,
)


def plain_coarse(occupied, free, block):
    rows, columns = (side // block for side in occupied.shape)
    found = np.full((rows, columns), UNKNOWN, np.uint8)
    for row in range(rows):
        for column in range(columns):
            cells = np.s_[row * block : (row + 1) * block, column * block : (column + 1) * block]
            found[row, column] = OCCUPIED if occupied[cells].any() else FREE if free[cells].any() else UNKNOWN
    return found


@pytest.mark.parametrize("block", [1, 2, 3, 5])
def test_a_coarse_cell_is_occupied_where_any_of_its_cells_is(block):
    draws = np.random.default_rng(4)
    occupied, free = draws.random((31, 23)) < 0.05, draws.random((31, 23)) < 0.2
    assert np.array_equal(coarse(occupied, free, block), plain_coarse(occupied, free, block))


def test_the_grid_is_around_what_is_shown_with_a_margin():
    shown = np.zeros((200, 300), np.bool_)
    shown[50:60, 100:140] = True
    grid = grid_around(shown, 0.025)
    assert (grid.row, grid.column, grid.block) == (44, 94, 2)
    assert (grid.rows, grid.columns) == (11, 26)
    assert shown[grid.window].sum() == shown.sum()
    assert grid.header((1.0, -2.0), 0.025) == {"rows": 11, "columns": 26, "x": 3.35, "y": -0.9, "cell": 0.05}


def test_a_margin_does_not_leave_the_lattice():
    grid = grid_around(np.ones((10, 20), np.bool_), 0.1)
    assert (grid.row, grid.column, grid.rows, grid.columns, grid.block) == (0, 0, 10, 20, 1)


def test_cells_of_a_large_floor_are_larger():
    grid = grid_around(np.ones((3000, 4000), np.bool_), 0.025)
    assert grid.rows * grid.columns <= MOST_CELLS
    assert (grid.block - 1) ** 2 * MOST_CELLS < 3000 * 4000


def test_a_map_of_which_nothing_is_known_has_a_grid():
    grid = grid_around(np.zeros((10, 10), np.bool_), 0.05)
    assert grid.rows >= 1
    assert grid.columns >= 1
