"""The cheapest places that see frontiers are those found on a search cell by cell."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from lidarium.mapping.kernels.simd.costs import FAR
from lidarium.mapping.planning.cheapest_views import cheapest_views
from lidarium.mapping.planning.clearance import ClearanceField
from lidarium.mapping.planning.footprint import Footprint, passage_of
from lidarium.mapping.planning.frontier_approach import approach_places
from lidarium.mapping.planning.frontiers import FrontierMap
from lidarium.mapping.planning.search.path_search import SearchMemory, search_all
from lidarium.mapping.planning.search.search_state import LARGEST_BUDGET
from lidarium.mapping.planning.search.search_targets import disc_spans
from lidarium.mapping.planning.search.swept_costs import (
    SweepMemory,
    costs_in,
    prepare_costs,
    spread_costs,
)

RESOLUTION = 0.05


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
    clearance = ClearanceField(shape, RESOLUTION, 0.6)
    clearance.update(log_odds)
    passage = passage_of(Footprint(0.02, 0.15, 3.0), RESOLUTION, clearance.limit)
    frontiers = FrontierMap(shape, RESOLUTION)
    frontiers.update(log_odds)
    clusters, spans = frontiers.clusters(), disc_spans(reach)
    memory, sweeps = SearchMemory(1), SweepMemory(1)
    memory.fit(log_odds.size, passage.slots)
    sweeps.fit(*shape)
    remaining, parent, _, least = search_all(log_odds, clearance.closeness, passage, memory.table[0], *start)
    expected, left, is_seen = approach_places(
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
