"""Plans from what the last plan has found, beside plans from nothing, and plans on threads."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import lidarium
import lidarium.agents.tours.policy as touring
from lidarium.agents.tours.planning import Tourist, TourRequest, TourSettings, memory_of, tour_options
from lidarium.envs.onboard.navigation import NavigationMap
from lidarium.mapping.kernels.compilation import available_threads, use_threads

TOURS = TourSettings()
RULES = TOURS.rules(5.6)
ARRAYS = (*("places", "cells", "numbers", "gains", "lengths", "turns", "is_kept", "first", "between", "sequence"),)


def assert_equal(found, wanted):
    assert (found is None) == (wanted is None)
    if wanted is not None:
        assert found.grid == wanted.grid
        for name in ARRAYS:
            np.testing.assert_array_equal(getattr(found, name), getattr(wanted, name), err_msg=name)


def drawn_floor(generator, shape):
    """Return a floor of drawn walls."""
    floor = np.full(shape, -20, np.int8)
    for _ in range(12):
        row, column = (int(generator.integers(0, side)) for side in shape)
        height, width = (1, 25) if generator.random() < 0.5 else (25, 1)
        floor[row : row + height, column : column + width] = 20
    return floor


def reveal(navigation, log_odds, floor, generator):
    """Show a square of the floor, with some cells that are seen wrongly, free ones that are occupied and vice versa."""
    row, column = (int(generator.integers(0, side)) for side in floor.shape)
    low, high = max(row - 15, 0), min(row + 16, floor.shape[0])
    left, right = max(column - 15, 0), min(column + 16, floor.shape[1])
    part = floor[low:high, left:right]
    log_odds[low:high, left:right] = np.where(generator.random(part.shape) < 0.01, -part, part)
    navigation.changed((low, high, left, right))


def robots_on(shape, generator, count):
    sides = 0.05 * np.array([shape[1], shape[0]])
    return [
        Tourist(
            np.array([*(generator.random(2) * sides * 0.999), generator.uniform(-3.1, 3.1)]),
            tuple(int(generator.integers(0, side)) for side in shape) if generator.random() < 0.5 else None,
            1.0,
        )
        for _ in range(count)
    ]


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 10**6))
def test_kept_plans_equal_plans_from_nothing_as_a_map_grows(seed):
    generator = np.random.default_rng(seed)
    shape = tuple(int(side) for side in generator.integers(40, 150, 2))
    floor, log_odds = drawn_floor(generator, shape), np.zeros(shape, np.int8)
    navigation = NavigationMap(log_odds, 0.05)
    kept, planned = memory_of(navigation, TOURS), 0
    for _ in range(10):
        reveal(navigation, log_odds, floor, generator)
        clusters = navigation.frontiers.clusters(minimum_cells=3)
        robots = robots_on(shape, generator, int(generator.integers(1, 4)))
        requests = [TourRequest(navigation, clusters, robots, each) for each in (kept, memory_of(navigation, TOURS))]
        found, wanted = (tour_options([each], 0.1, TOURS, RULES)[0] for each in requests)
        assert_equal(found, wanted)
        planned += wanted is not None
    if seed == 0:
        assert planned > 3


@pytest.mark.parametrize(("floor", "robots"), [("apartment:7", 2), ("building:2000003", 3)])
def test_kept_plans_equal_plans_from_nothing_over_whole_episodes(floor, robots, monkeypatch):
    plan, compared = touring.tour_options, []

    def both(requests, radius, tours, rules):
        kept = plan(requests, radius, tours, rules)
        again = [
            TourRequest(each.navigation, each.clusters, each.robots, memory_of(each.navigation, tours))
            for each in requests
        ]
        for found, wanted in zip(kept, plan(again, radius, tours, rules), strict=True):
            assert_equal(found, wanted)
            compared.append(wanted)
        return kept

    monkeypatch.setattr(touring, "tour_options", both)
    env = lidarium.parallel_env(floor, robots=robots, resolution=0.05, stop_coverage=0.99, horizon_s=600.0)
    lidarium.run_episode(lidarium.policy("tour_frontier"), env, seed=1)
    assert len(compared) > 10


@pytest.mark.skipif(available_threads() < 2, reason="one thread only")
def test_plans_do_not_depend_on_threads():
    generator = np.random.default_rng(4)
    found = {1: [], 2: []}
    maps = []
    for _ in range(5):
        shape = tuple(int(side) for side in generator.integers(60, 120, 2))
        log_odds = np.zeros(shape, np.int8)
        maps.append((NavigationMap(log_odds, 0.05), log_odds, drawn_floor(generator, shape)))
    memories = {threads: [memory_of(each[0], TOURS) for each in maps] for threads in found}
    for _ in range(3):
        requests = []
        for navigation, log_odds, floor in maps:
            reveal(navigation, log_odds, floor, generator)
            reveal(navigation, log_odds, floor, generator)
            robots = robots_on(floor.shape, generator, int(generator.integers(1, 4)))
            requests.append((navigation, navigation.frontiers.clusters(minimum_cells=3), robots))
        for threads, plans in found.items():
            used = use_threads(threads)
            asked = [TourRequest(*each, memory) for each, memory in zip(requests, memories[threads], strict=True)]
            plans += tour_options(asked, 0.1, TOURS, RULES, used)
    assert sum(each is not None for each in found[1]) > 5
    for one, two in zip(found[1], found[2], strict=True):
        assert_equal(two, one)
