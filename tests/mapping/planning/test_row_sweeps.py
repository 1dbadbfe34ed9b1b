"""Sweeps over rows find the nearest occupied cells."""

import numpy as np
import pytest

from lidarium.mapping.planning.clearance import ClearanceField
from lidarium.mapping.planning.row_sweeps import is_within, recompute


def plain(belief, limit):
    """Closeness by its definition: the limit less the least square of half cells to an occupied square."""
    rows, columns = np.indices(belief.shape)
    squares = np.full(belief.shape, limit)
    for row, column in np.argwhere(belief > 0):
        up, right = (np.maximum(2 * np.abs(a - b) - 1, 0) for a, b in ((rows, row), (columns, column)))
        squares = np.minimum(squares, up**2 + right**2)
    return limit - squares


@pytest.mark.parametrize("shape", [(1, 1), (9, 20), (30, 64), (25, 150)])
@pytest.mark.parametrize("share", [0.0, 0.01, 0.2])
def test_stale_rows_of_a_block_are_computed_and_others_left(shape, share):
    generator = np.random.default_rng(4)
    belief = np.where(generator.random(shape) < share, 9, -5).astype(np.int8)
    field = ClearanceField(shape, 0.05, 0.3)
    expected = plain(belief, field.limit)
    stale = generator.random(shape[0]) < 0.7
    for column in range(0, shape[1], 64):
        closeness = np.full(shape, 7, np.uint16)
        recompute(belief, closeness, field.limit, field.stamp.shape[0] // 2, 0, stale, column)
        block = slice(column, min(column + 64, shape[1]))
        np.testing.assert_array_equal(closeness[stale, block], expected[stale, block])
        closeness[stale, block] = 7
        assert (closeness == 7).all()


def test_sixty_four_columns_lie_within_the_grid_and_hold_those_that_are_wanted():
    assert [is_within(column, 200) for column in (-64, -63, 0, 100, 136, 150, 199, 200)] == [
        -1,
        0,
        0,
        100,
        136,
        136,
        136,
        -1,
    ]
    assert is_within(0, 63) == -1
