"""Places near frontiers that a body can come to."""

import math

import numpy as np
from frontier_beliefs import RESOLUTION, SEEDS, made, random_belief
from hypothesis import given, settings
from hypothesis import strategies as st

from lidarium.mapping.grids.grid_lines import visible
from lidarium.mapping.kernels.simd.costs import FAR
from lidarium.mapping.planning.clearance import ClearanceField
from lidarium.mapping.planning.footprint import Footprint, passage_of
from lidarium.mapping.planning.frontiers.approach import (
    _approach_places,
    approach,
    cheapest_views,
    default_reach,
    nearest_frontier,
)
from lidarium.mapping.planning.frontiers.frontier_map import FrontierMap
from lidarium.mapping.planning.grid_planning import search
from lidarium.mapping.planning.search.path_search import SearchMemory, SearchSpace, search_all
from lidarium.mapping.planning.search.search_state import LARGEST_BUDGET, disc_spans
from lidarium.mapping.planning.search.swept_costs import (
    SweepMemory,
    costs_in,
    prepare_costs,
    spread_costs,
)


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
            assert visible(belief, tuple(result.cells[k]), result.frontier_cells[k][None])[0] == result.in_sight[k]
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
        thin = approach(clusters, search(thin_space, belief, field, (40, 30), Footprint(0.0, 0.1)), belief, 0.23)
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


COARSE = 0.05


@given(seed=st.integers(0, 100_000), reach=st.sampled_from((1.0, 3.6, 5.6, 20.0)))
@settings(max_examples=60)
def test_places_and_costs_are_those_of_a_search_cell_by_cell(seed, reach):
    generator = np.random.default_rng(seed)
    shape = (int(generator.integers(6, 50)), 16 * int(generator.integers(1, 6)))
    log_odds = np.where(generator.random(shape) < 0.04, 20, -20).astype(np.int8)
    log_odds[:, int(generator.integers(2, shape[1])) :] = 0
    log_odds[generator.random(shape) < 0.02] = 0
    start = (int(generator.integers(0, shape[0])), 0)
    log_odds[start] = -20
    clearance = ClearanceField(shape, COARSE, 0.6)
    clearance.update(log_odds)
    passage = passage_of(Footprint(0.02, 0.15, 3.0), COARSE, clearance.limit)
    frontiers = FrontierMap(shape, COARSE)
    frontiers.update(log_odds)
    clusters, spans = frontiers.clusters(), disc_spans(reach)
    memory, sweeps = SearchMemory(1), SweepMemory(1)
    memory.fit(log_odds.size, passage.slots)
    sweeps.fit(*shape)
    remaining, parent, _, least = search_all(log_odds, clearance.closeness, passage, memory.table[0], *start)
    expected, left, is_seen = _approach_places(
        clusters.cells, clusters.starts, log_odds, remaining, parent, least, spans
    )
    swept = costs_in(sweeps.table[0], (0, shape[0], 0, shape[1]))
    prepare_costs(swept, log_odds, clearance.closeness, passage)
    spread_costs(swept, *start)
    places, costs = cheapest_views(clusters.cells, clusters.starts, log_odds, swept, spans)
    assert np.array_equal(costs < FAR, is_seen)
    assert np.array_equal(places[is_seen], expected[is_seen])
    assert np.array_equal(costs[is_seen], LARGEST_BUDGET - left[is_seen])
    assert (places[~is_seen] == -1).all()
