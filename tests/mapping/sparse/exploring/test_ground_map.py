"""A map of the ground: seen, unknown, or taken up."""

import numpy as np
import pytest

from lidarium.mapping.sparse.exploring.ground_map import BLOCKED, SEEN, UNKNOWN, ground_map
from lidarium.mapping.sparse.swept_body import SweptBody

BODY = SweptBody(radius=0.2, height=0.6)


WALL = np.array([[[2.0, -3.0, 0.0], [2.2, 3.0, 2.0]]])


def test_a_map_of_the_ground_says_what_is_taken_up_and_what_a_body_passes_below():
    cells = np.zeros((20, 30), np.bool_)
    cells[:, 10:] = True
    table = np.array([[[0.6, 0.0, 0.7], [1.2, 1.0, 0.74]]])
    low = ground_map(cells, (0.0, 0.0), 0.1, np.concatenate([WALL, table]), BODY)
    high = ground_map(cells, (0.0, 0.0), 0.1, table, SweptBody(radius=0.2, height=1.2))
    assert (low.levels[:, 20:22] == BLOCKED).all()
    assert (low.levels[:, 12:19] == SEEN).all()
    assert (low.levels[:, :10] == UNKNOWN).all()
    assert (high.levels[:10, 6:12] == BLOCKED).all()
    assert low.seen_m2 == pytest.approx(0.01 * np.count_nonzero(low.levels == SEEN))
    assert low.are_unknown(np.array([[0.5, 0.5], [1.5, 0.5], [2.1, 0.5], [99.0, 0.0]])).tolist() == [
        True,
        False,
        False,
        True,
    ]


def test_frontiers_are_where_seen_ground_borders_on_unknown_cells():
    cells = np.zeros((20, 20), np.bool_)
    cells[5:15, 5:15] = True
    known = ground_map(cells, (0.0, 0.0), 0.1, np.array([[[0.5, 0.5, 0.0], [0.6, 1.5, 1.0]]]), BODY)
    clusters = known.frontiers(0.3)
    assert len(clusters) == 1
    # Three sides of ten cells are open; corners belong to two of them.
    assert len(clusters.cells) == 9 + 9 + 8
    assert not len(known.frontiers(10.0))
    assert known.centres(np.array([[0, 3]]))[0] == pytest.approx([0.35, 0.05])
