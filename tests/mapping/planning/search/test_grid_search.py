"""A search ends where it is told to, and knows all costs up to there."""

import math
from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from searched_beliefs import RESOLUTION, SEEDS, beginning, made
from smoothed_paths import waypoints

from lidarium.mapping.planning.footprint import Footprint
from lidarium.mapping.planning.grid_planning import Until, centres_of, discs_of, plan, search
from lidarium.mapping.planning.search.search_state import Targets


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
    np.testing.assert_array_equal(np.where(full <= most, found.costs(), np.inf), np.where(full <= most, full, np.inf))
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


def test_no_step_cuts_a_corner_between_two_blocked_cells():
    belief = np.full((2, 2), -5, np.int8)
    belief[0, 1] = belief[1, 0] = 9
    space, field = made(belief, 0.1)
    assert plan(space, belief, field, (0, 0), (1, 1), Footprint(0.0, 0.05)) is None
    belief[:] = -5
    belief[0, 1] = belief[1, 0] = 0
    space, field = made(belief, 0.1)
    assert plan(space, belief, field, (0, 0), (1, 1), Footprint(0.0, 0.05)) is None


def test_a_body_too_near_to_a_wall_leaves_it():
    belief = np.full((60, 60), -5, np.int8)
    belief[:, 0] = 9
    space, field = made(belief)
    footprint = Footprint(0.18, 0.33)
    found = search(space, belief, field, (30, 5), footprint)
    path = found.path((30, 40))
    assert tuple(path[0]) == (30, 5)
    assert (np.diff(path[:4, 1]) == 1).all()
    assert found.cost((30, 5)) == 0.0
    assert math.isinf(found.cost((30, 6)))


def test_blocked_discs_are_passed_around_and_left():
    belief = np.full((80, 80), -5, np.int8)
    space, field = made(belief)
    footprint = Footprint(0.05, 0.1)
    discs = discs_of([(1.0, 1.0, 0.4)], (0.0, 0.0), RESOLUTION)
    found = search(space, belief, field, (39, 5), footprint, blocked=discs)
    centres = centres_of(found.path((39, 75)), (0.0, 0.0), RESOLUTION)
    assert np.hypot(*(centres - 1.0).T).min() >= 0.4
    distances = np.hypot(
        *(np.moveaxis(np.indices(belief.shape), 0, -1)[..., ::-1].reshape(-1, 2).T + 0.5) * RESOLUTION - 1.0
    ).reshape(80, 80)
    np.testing.assert_array_equal(np.isinf(found.costs()), distances < 0.4)
    line = waypoints(found.path((39, 75)), belief, field, footprint, blocked=discs)
    for tail, head in pairwise(line):
        points = tail + np.linspace(0, 1, 100)[:, None] * (head - tail)
        assert np.hypot(*(points - 1.0).T).min() >= 0.4 - 0.002
    inside = search(space, belief, field, (39, 30), footprint, blocked=discs)
    away = np.hypot(*(centres_of(inside.path((39, 5)), (0.0, 0.0), RESOLUTION) - 1.0).T)
    assert (np.diff(away) > 0).all()
    assert math.isinf(inside.cost((39, 39)))
    assert math.isfinite(inside.cost((39, 75)))
