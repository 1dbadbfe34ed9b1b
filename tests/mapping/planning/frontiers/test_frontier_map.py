"""Frontiers against whole-map definitions, and approaches against what the full search says."""

import numpy as np
import pytest
from frontier_beliefs import RESOLUTION, SEEDS, by_definition, made, random_belief
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from lidarium.mapping.grids.grid_lines import visible
from lidarium.mapping.planning.footprint import Footprint
from lidarium.mapping.planning.frontiers.approach import nearest_frontier
from lidarium.mapping.planning.frontiers.frontier_map import FrontierMap
from lidarium.mapping.planning.search.path_search import SearchSpace


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
    assert nearest_frontier(frontiers, space, np.full((30, 30), -5, np.int8), field, (10, 10), Footprint()) is None


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


@settings(max_examples=40)
@given(seed=SEEDS, edits=st.integers(0, 6))
def test_flags_kept_up_to_date_by_windows_are_those_of_the_whole_map(seed, edits):
    random = np.random.default_rng(seed)
    belief = np.zeros((70, 80), np.int8)
    frontiers = FrontierMap(belief.shape, RESOLUTION)
    for _ in range(edits):
        row, column = random.integers(0, 69), random.integers(0, 79)
        height, width = random.integers(1, 50, size=2)
        window = (row, min(row + height, 70), column, min(column + width, 80))
        part = belief[window[0] : window[1], window[2] : window[3]]
        part[:] = random.choice(
            np.array([-5, 0, 9], np.int8),
            size=part.shape,
            p=random.choice([[0.9, 0.05, 0.05], [0.1, 0.8, 0.1]]),
        )
        frontiers.update(belief, window)
    expected = by_definition(belief)
    np.testing.assert_array_equal(frontiers.flags, expected)
    np.testing.assert_array_equal(frontiers.cells(), np.argwhere(expected))
    assert len(frontiers) == expected.sum()


@settings(max_examples=40)
@given(seed=SEEDS, minimum=st.integers(1, 6))
def test_clusters_are_the_8_connected_components(seed, minimum):
    belief = random_belief(seed)
    _, frontiers = made(belief)
    clusters = frontiers.clusters(minimum_cells=minimum)
    labels, count = ndimage.label(by_definition(belief), structure=np.ones((3, 3)))
    components = [np.argwhere(labels == k) for k in range(1, count + 1)]
    components = [cells for cells in components if len(cells) >= minimum]
    components.sort(key=lambda cells: tuple(cells[0]))
    assert len(clusters) == len(components)
    for k, expected in enumerate(components):
        own = clusters.of(k)
        np.testing.assert_array_equal(own[np.lexsort((own[:, 1], own[:, 0]))], expected)
        np.testing.assert_allclose(clusters.centroids[k], (expected.mean(axis=0)[::-1] + 0.5) * RESOLUTION)
        distances = np.hypot(*(expected - expected.mean(axis=0)).T)
        chosen = np.flatnonzero((expected == clusters.representatives[k]).all(axis=1))
        assert distances[chosen[0]] == pytest.approx(distances.min())
        assert clusters.sizes[k] == pytest.approx(len(expected) * RESOLUTION)
    np.testing.assert_array_equal(frontiers.flags, by_definition(belief))  # marks are taken back


@settings(max_examples=40)
@given(seed=SEEDS)
def test_clusters_without_some_cells_are_those_of_the_others(seed):
    belief = random_belief(seed)
    _, frontiers = made(belief)
    clusters = frontiers.clusters()
    left_out = np.random.default_rng(seed).random(belief.shape) < 0.4
    found = clusters.without(left_out, 2)
    kept = [cells[~left_out[cells[:, 0], cells[:, 1]]] for cells in map(clusters.of, range(len(clusters)))]
    kept = [cells for cells in kept if len(cells) >= 2]
    assert len(found) == len(kept)
    for k, cells in enumerate(kept):
        np.testing.assert_array_equal(found.of(k), cells)
        np.testing.assert_allclose(found.centroids[k], (cells.mean(axis=0)[::-1] + 0.5) * RESOLUTION)
        distances = np.hypot(*(cells - cells.mean(axis=0)).T)
        chosen = (cells == found.representatives[k]).all(axis=1)
        assert distances[chosen] == pytest.approx(distances.min())
