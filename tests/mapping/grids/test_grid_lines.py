"""Lines over cells."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lidarium.mapping.grids.grid_lines import line_is_free, visible

SEEDS = st.integers(0, 10**6)


def line_is_open(belief, tail, head):
    """Whether densely sampled inner points of a line avoid occupied cells; None where it grazes a corner."""
    tail, head = np.array(tail, float), np.array(head, float)
    points = tail + np.linspace(0, 1, 2001)[:, None] * (head - tail)
    cells = np.rint(points).astype(int)
    own = (cells == tail).all(axis=1) | (cells == head).all(axis=1)
    return not (belief[cells[:, 0], cells[:, 1]] > 0)[~own].any()


@settings(max_examples=40)
@given(seed=SEEDS)
def test_a_cell_is_visible_where_no_occupied_cell_lies_on_the_line(seed):
    random = np.random.default_rng(seed)
    belief = np.where(random.random((13, 17)) < 0.05, 9, 0).astype(np.int8)
    start = (int(random.integers(0, 13)), int(random.integers(0, 17)))
    cells = np.argwhere(np.ones_like(belief, dtype=bool))
    seen = visible(belief, start, cells)
    for cell, is_seen in zip(cells, seen, strict=True):
        steps = np.abs(cell - start)
        odd = (steps // max(math.gcd(*steps.tolist()), 1)) % 2
        if not odd.all():  # the line passes through no corner
            assert is_seen == line_is_open(belief, start, cell)
        assert is_seen == visible(belief, tuple(cell), np.array([start]))[0]
    near = visible(belief, start, cells, 5.0)
    np.testing.assert_array_equal(near, seen & (np.hypot(*(cells - start).T) <= 5.0))


def test_a_line_is_free_where_all_cells_that_it_crosses_are_known_to_be():
    belief = np.full((12, 16), -5, np.int8)
    assert line_is_free_of(belief, (1, 1), (10, 14))
    for row, column in ((10, 14), (5, 7), (6, 8)):
        unknown = belief.copy()
        unknown[row, column] = 0
        # The first cell does not matter, the last does.
        assert line_is_free_of(unknown, (row, column), (1, 1))
        assert not line_is_free_of(unknown, (1, 1), (row, column))
    assert line_is_free_of(np.zeros((3, 3), np.int8), (1, 1), (1, 1))


def test_a_line_through_a_corner_is_stopped_by_both_cells_beside_it_alone():
    belief = np.full((4, 4), -5, np.int8)
    belief[0, 1] = 9
    assert line_is_free_of(belief, (0, 0), (3, 3))
    belief[1, 0] = 9
    assert not line_is_free_of(belief, (0, 0), (3, 3))
    assert not visible(belief, (0, 0), np.array([[3, 3]])).any()


def test_what_lies_out_of_range_is_not_seen():
    belief = np.zeros((20, 20), np.int8)
    cells = np.array([[0, 5], [3, 4], [0, 6]])
    assert visible(belief, (0, 0), cells, 5.0).tolist() == [True, True, False]
    with pytest.raises(ValueError, match="outside the grid"):
        visible(belief, (0, 0), np.array([[0, 20]]))


def line_is_free_of(belief, tail, head):
    return line_is_free(belief, *tail, *head)
