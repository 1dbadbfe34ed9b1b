"""Tours of a team against all that there are."""

import itertools

import numpy as np
import pytest

from lidarium.mapping.planning.touring.team_tours import TourWeights, costs_of_firsts, team_tours, with_first


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
            cost_of(order, first, between, worth, weights)
            for order in itertools.permutations(range(5 + robots - 1))
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
