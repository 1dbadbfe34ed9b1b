"""Frontiers against whole-map definitions, and approaches against what the full search says."""

import numpy as np
import pytest
from frontier_beliefs import RESOLUTION, made

from lidarium.mapping.grids.grid_lines import visible
from lidarium.mapping.planning.footprint import Footprint
from lidarium.mapping.planning.frontier_approach import nearest_frontier
from lidarium.mapping.planning.frontiers import FrontierMap
from lidarium.mapping.planning.search.search_space import SearchSpace


def test_ignored_cells_are_left_out_until_they_cease_to_be_frontiers():
    belief = np.zeros((40, 40), np.int8)
    belief[5:20, 5:20] = -5
    _, frontiers = made(belief)
    everything = frontiers.cells()
    frontiers.ignore(everything[:10])
    frontiers.ignore(everything[:10])
    frontiers.update(belief)
    np.testing.assert_array_equal(frontiers.cells(), everything[10:])
    belief[0:5] = -5
    belief[5:20, 0:5] = -5
    frontiers.update(belief, (0, 20, 0, 40))
    belief[0:5] = 0
    belief[5:20, 0:5] = 0
    frontiers.update(belief)
    np.testing.assert_array_equal(frontiers.cells(), everything)


def test_an_empty_map_has_no_frontiers():
    belief = np.zeros((30, 30), np.int8)
    belief[10, 10] = -1
    field, frontiers = made(np.full((30, 30), -5, np.int8))
    assert len(frontiers.clusters()) == 0
    space = SearchSpace((30, 30), RESOLUTION)
    assert (
        nearest_frontier(frontiers, space, np.full((30, 30), -5, np.int8), field, (10, 10), Footprint())
        is None
    )


def test_bad_input_is_named():
    frontiers = FrontierMap((20, 20), RESOLUTION)
    with pytest.raises(ValueError, match="log_odds has shape"):
        frontiers.update(np.zeros((5, 5), np.int8))
    with pytest.raises(ValueError, match="resolution"):
        FrontierMap((20, 20), 0.0)
    with pytest.raises(ValueError, match="cells has shape"):
        visible(np.zeros((5, 5), np.int8), (0, 0), np.zeros((3, 3), np.int64))
    with pytest.raises(ValueError, match="outside the grid"):
        visible(np.zeros((5, 5), np.int8), (0, 0), np.array([[0, 5]]))
