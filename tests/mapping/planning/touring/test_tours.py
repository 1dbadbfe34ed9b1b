"""Tours of a team against all that there are."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lidarium.mapping.planning.touring.tours import (
    TourWeights,
    costs_of_firsts,
    shortest_tour,
    team_tours,
    with_first,
)


def cost_of(sequence, first, between, worth, weights):
    """Return what tours cost, written plainly."""
    count = first.shape[1]
    tours = [[]]
    for number in sequence:
        if number >= count:
            tours.append([])
        else:
            tours[-1].append(int(number))
    lengths, waiting = [], 0.0
    for robot, tour in enumerate(tours):
        length = 0.0
        for k, place in enumerate(tour):
            length += first[robot, place] if k == 0 else between[tour[k - 1], place]
            waiting += worth[place] * length
        lengths.append(length)
    return weights.longest * max(lengths) + weights.total * sum(lengths) + weights.waiting * waiting


def drawn(generator, robots, count):
    places, starts = generator.uniform(0, 10, (count, 2)), generator.uniform(0, 10, (robots, 2))
    first = np.hypot(*(starts[:, None] - places[None]).transpose(2, 0, 1))
    between = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))
    return first, between, generator.uniform(0.5, 3.0, count)


@pytest.mark.parametrize("robots", [1, 2, 3])
@pytest.mark.parametrize(
    "weights", [TourWeights(1.0, 0.1, 0.0), TourWeights(0.0, 1.0, 0.0), TourWeights(0.5, 0.0, 0.1)]
)
def test_tours_are_nearly_the_best(robots, weights):
    generator = np.random.default_rng(robots)
    ratios = []
    for _ in range(8):
        first, between, worth = drawn(generator, robots, 5)
        found = team_tours(first, between, worth, weights)
        assert sorted(found) == list(range(5 + robots - 1))
        best = min(
            cost_of(order, first, between, worth, weights) for order in itertools.permutations(range(5 + robots - 1))
        )
        ratios.append(cost_of(found, first, between, worth, weights) / best)
    assert min(ratios) >= 1.0 - 1e-9
    assert max(ratios) < 1.25
    assert np.median(ratios) < 1.01


def test_robots_share_places_on_either_side():
    first = np.array([[1.0, 9.0, 2.0, 8.0], [9.0, 1.0, 8.0, 2.0]])
    positions = np.array([1.0, 9.0, 2.0, 8.0])
    between = np.abs(positions[:, None] - positions[None])
    found = team_tours(first, between, np.ones(4), TourWeights(1.0, 0.1, 0.0))
    assert found.tolist() == [0, 2, 4, 1, 3]


def test_no_places_leave_empty_tours():
    found = team_tours(np.zeros((3, 0)), np.zeros((0, 0)), np.zeros(0), TourWeights(1.0, 0.1, 0.0))
    assert found.tolist() == [0, 1]


@pytest.mark.parametrize("robots", [1, 2, 3])
def test_costs_of_firsts_are_those_of_the_tours_that_begin_so(robots):
    generator = np.random.default_rng(robots)
    weights = TourWeights(1.0, 0.1, 0.05)
    first, between, worth = drawn(generator, robots, 6)
    sequence = team_tours(first, between, worth, weights)
    base = cost_of(sequence, first, between, worth, weights)
    for robot in range(robots):
        costs = costs_of_firsts(sequence, robot, first, between, worth, weights)
        for place in range(6):
            changed = with_first(sequence, robot, place, 6)
            assert sorted(changed) == sorted(sequence)
            tours = np.split(changed, np.flatnonzero(changed >= 6))
            assert next(number for number in tours[robot] if number < 6) == place
            rest = [number for number in changed if number != place]
            assert rest == [number for number in sequence if number != place]
            assert costs[place] == pytest.approx(cost_of(changed, first, between, worth, weights) - base)


def test_what_comes_first_already_costs_nothing_more():
    first, between, worth = drawn(np.random.default_rng(5), 2, 5)
    weights = TourWeights(1.0, 0.1, 0.05)
    sequence = team_tours(first, between, worth, weights)
    for robot, tour in enumerate(np.split(sequence, np.flatnonzero(sequence >= 5))):
        numbers = tour[tour < 5]
        if len(numbers):
            costs = costs_of_firsts(sequence, robot, first, between, worth, weights)
            assert costs[numbers[0]] == 0.0


def costs_of(places):
    """Return what ways from the origin and between places cost."""
    return np.hypot(*places.T), np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))


def length_of(tour, first, between):
    return first[tour[0]] + sum(between[a, b] for a, b in itertools.pairwise(tour))


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(1, 7))
def test_a_tour_visits_all_places_and_is_hardly_longer_than_the_shortest(seed, count):
    first, between = costs_of(np.random.default_rng(seed).uniform(-10.0, 10.0, (count, 2)))
    tour = shortest_tour(first, between)
    assert sorted(tour) == list(range(count))
    shortest = min(length_of(each, first, between) for each in itertools.permutations(range(count)))
    assert length_of(tour, first, between) <= 1.1 * shortest + 1e-9


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1), st.integers(8, 20))
def test_a_tour_is_never_longer_than_that_of_the_nearest_place_again_and_again(seed, count):
    first, between = costs_of(np.random.default_rng(seed).uniform(-10.0, 10.0, (count, 2)))
    nearest = [int(np.argmin(first))]
    while len(nearest) < count:
        nearest.append(min(set(range(count)) - set(nearest), key=lambda place: between[nearest[-1], place]))
    assert length_of(shortest_tour(first, between), first, between) <= length_of(nearest, first, between) + 1e-9


def test_what_lies_on_the_shorter_side_is_visited_first_though_another_place_is_nearer():
    # Places lie on a line: what is left of the robot goes on to -6 m, so those on its right come first.
    first, between = costs_of(np.array([[-1.0, 0.0], [1.1, 0.0], [1.6, 0.0], [-6.0, 0.0]]))
    tour = shortest_tour(first, between).tolist()
    assert (set(tour[:2]), tour[2:]) == ({1, 2}, [0, 3])
