"""Frontiers against whole-map definitions, and approaches against what the full search says."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from lidarium.mapping.grids.grid_lines import visible
from lidarium.mapping.planning.clearance import ClearanceField
from lidarium.mapping.planning.footprint import Footprint
from lidarium.mapping.planning.frontier_approach import approach, default_reach, nearest_frontier
from lidarium.mapping.planning.frontiers import FrontierMap
from lidarium.mapping.planning.grid_planning import search
from lidarium.mapping.planning.search.search_space import SearchSpace

RESOLUTION = 0.025
SEEDS = st.integers(0, 10**6)


def by_definition(belief):
    unknown = np.pad(belief == 0, 1)
    beside = unknown[:-2, 1:-1] | unknown[2:, 1:-1] | unknown[1:-1, :-2] | unknown[1:-1, 2:]
    return (belief < 0) & beside


def random_belief(seed, shape=(70, 80)):
    """Blobs of free floor with walls in them, unknown around."""
    random = np.random.default_rng(seed)
    belief = np.zeros(shape, np.int8)
    for value, count, size in ((-5, 7, 30), (9, 8, 12), (0, 3, 8)):
        for _ in range(count):
            row, column = random.integers(0, shape[0]), random.integers(0, shape[1])
            height, width = random.integers(1, size, size=2)
            if value == 9:
                height, width = (1, width) if random.random() < 0.5 else (height, 1)
            belief[row : row + height, column : column + width] = value
    return belief


def made(belief):
    field = ClearanceField(belief.shape, RESOLUTION)
    field.update(belief)
    frontiers = FrontierMap(belief.shape, RESOLUTION)
    frontiers.update(belief)
    return field, frontiers


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


def by_full_search(belief, found, cluster, reach):
    """Least cost of a cell within reach of a cluster, and the same among those in sight of a cell of it."""
    costs = found.costs()
    cells = np.argwhere(np.isfinite(costs))
    best = best_seen = math.inf
    for cell in cells:
        near = cluster[np.hypot(*(cluster - cell).T) <= reach / RESOLUTION + 1e-9]
        if len(near):
            best = min(best, costs[tuple(cell)])
            if costs[tuple(cell)] < best_seen and visible(belief, tuple(cell), near).any():
                best_seen = costs[tuple(cell)]
    return best, best_seen


@settings(max_examples=25)
@given(seed=SEEDS, radius=st.sampled_from([0.03, 0.1]))
def test_approaches_are_the_cheapest_cells_in_reach_and_sight_and_the_nearest_is_their_least(seed, radius):
    belief = random_belief(seed)
    footprint = Footprint(radius, radius + 0.1)
    field, frontiers = made(belief)
    open_cells = np.argwhere((belief < 0) & (field.metres() >= radius))
    if len(open_cells) == 0:
        return
    start = tuple(int(i) for i in open_cells[seed % len(open_cells)])
    reach = default_reach(footprint, RESOLUTION)
    space = SearchSpace(belief.shape, RESOLUTION)
    found = search(space, belief, field, start, footprint)
    clusters = frontiers.clusters()
    result = approach(clusters, found, belief, reach)
    for k in range(len(clusters)):
        best, best_seen = by_full_search(belief, found, clusters.of(k), reach)
        assert result.in_sight[k] == math.isfinite(best_seen)
        assert result.costs[k] == (best_seen if result.in_sight[k] else best)
        if math.isfinite(best):
            assert found.cost(tuple(result.cells[k])) == result.costs[k]
            assert np.hypot(*(result.cells[k] - result.frontier_cells[k])) <= reach / RESOLUTION
            assert (
                visible(belief, tuple(result.cells[k]), result.frontier_cells[k][None])[0]
                == result.in_sight[k]
            )
            assert result.reasons[k] == ("" if result.in_sight[k] else "hidden")
        else:
            assert result.reasons[k] == "blocked"
            assert (result.cells[k] == -1).all()
    nearest = nearest_frontier(frontiers, space, belief, field, start, footprint)
    if not result.reachable.any():
        assert nearest is None
        return
    assert nearest.cost == result.costs[result.reachable].min()
    assert tuple(nearest.path[-1]) == nearest.cell
    assert frontiers.flags[nearest.frontier_cell] == 1
    assert visible(belief, nearest.cell, np.array([nearest.frontier_cell]))[0]


def test_a_frontier_behind_a_gap_that_is_too_narrow_is_said_to_be_so():
    belief = np.zeros((80, 160), np.int8)
    belief[10:70, 10:150] = -5
    belief[9, 9:151] = belief[70, 9:151] = belief[9:71, 9] = 9
    belief[10:70, 70:74] = 9
    field, frontiers = made(belief)
    space, thin_space = SearchSpace(belief.shape, RESOLUTION), SearchSpace(belief.shape, RESOLUTION)

    def reasons():
        field.update(belief)
        frontiers.update(belief)
        clusters = frontiers.clusters()
        found = search(space, belief, field, (40, 30), Footprint())
        thin = approach(
            clusters, search(thin_space, belief, field, (40, 30), Footprint(0.0, 0.1)), belief, 0.23
        )
        return approach(clusters, found, belief, 0.23, thin.reachable).reasons

    assert reasons() == ("blocked",)
    belief[36:44, 70:74] = -5
    assert reasons() == ("narrow",)
    belief[30:50, 70:74] = -5
    assert reasons() == ("",)


def test_a_frontier_behind_a_thin_wall_is_not_approached_through_it():
    belief = np.zeros((60, 80), np.int8)
    belief[10:50, 10:40] = -5
    belief[10:50, 40:42] = 9
    belief[25:35, 42:44] = -5
    belief[9, 9:42] = belief[50, 9:42] = belief[9:51, 9] = 9
    field, frontiers = made(belief)
    space = SearchSpace(belief.shape, RESOLUTION)
    assert nearest_frontier(frontiers, space, belief, field, (30, 30), Footprint(0.1, 0.2), reach=0.3) is None
    found = search(space, belief, field, (30, 30), Footprint(0.1, 0.2))
    assert approach(frontiers.clusters(), found, belief, 0.3).reasons == ("hidden",)


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
