"""Lines over cells."""

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from lidarium.mapping.grids.grid_lines import visible

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
    belief = np.where(random.random((21, 25)) < 0.05, 9, 0).astype(np.int8)
    start = (int(random.integers(0, 21)), int(random.integers(0, 25)))
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
