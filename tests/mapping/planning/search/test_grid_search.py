"""A search ends where it is told to, and knows all costs up to there."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from searched_beliefs import SEEDS, beginning

from lidarium.mapping.planning.grid_planning import Until, search
from lidarium.mapping.planning.search.search_targets import Targets


@settings(max_examples=30)
@given(seed=SEEDS, count=st.integers(1, 5), reach=st.sampled_from([0.0, 2.5, 9.0]))
def test_the_first_targets_are_the_cheapest_of_the_full_search(seed, count, reach):
    footprint, belief, start, space, field = beginning(seed)
    mask = np.random.default_rng(seed).random(belief.shape) < 0.003
    targets = Targets.of(mask, reach)
    everything = search(space, belief, field, start, footprint, until=Until(targets=targets, count=10**9))
    hits = everything.hits
    costs = np.array([everything.cost(cell) for cell in hits])
    assert (np.diff(costs) >= 0).all()
    early = search(space, belief, field, start, footprint, until=Until(targets=targets, count=count))
    np.testing.assert_array_equal(early.hits, hits[:count])
    np.testing.assert_array_equal([early.cost(cell) for cell in early.hits], costs[:count])
    if reach == 0.0:
        full = search(space, belief, field, start, footprint).costs()
        assert len(hits) == np.isfinite(full[mask]).sum()


@settings(max_examples=30)
@given(seed=SEEDS, beyond=st.sampled_from([0.05, 0.3, 1.0, 1e9]))
def test_beyond_the_first_target_costs_are_those_of_the_full_search(seed, beyond):
    footprint, belief, start, space, field = beginning(seed)
    targets = Targets.of(np.random.default_rng(seed).random(belief.shape) < 0.003, 2.5)
    full = search(space, belief, field, start, footprint).costs()
    first = search(space, belief, field, start, footprint, until=Until(targets=targets)).hits
    found = search(space, belief, field, start, footprint, until=Until(targets=targets, beyond=beyond))
    np.testing.assert_array_equal(found.hits, first)
    most = found.cost(tuple(found.hits[0])) + beyond if len(found.hits) else np.inf
    np.testing.assert_array_equal(
        np.where(full <= most, found.costs(), np.inf), np.where(full <= most, full, np.inf)
    )
    further = found.costs()[np.isfinite(found.costs())].max()
    assert further <= most + 3 * 4096 * found.unit


@settings(max_examples=30)
@given(seed=SEEDS, count=st.integers(1, 6))
def test_a_search_for_some_cells_ends_when_all_of_them_have_their_costs(seed, count):
    footprint, belief, start, space, field = beginning(seed)
    full = search(space, belief, field, start, footprint).costs()
    reached = np.argwhere(np.isfinite(full))
    cells = {tuple(map(int, cell)) for cell in np.random.default_rng(seed).choice(reached, count)}
    found = search(
        space,
        belief,
        field,
        start,
        footprint,
        until=Until(targets=Targets.at(cells, belief.shape), count=len(cells)),
    )
    assert {cell: found.cost(cell) for cell in cells} == {cell: full[cell] for cell in cells}
    assert {tuple(cell) for cell in found.hits.tolist()} == cells
