"""The shortest tour of all places."""

import itertools

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from lidarium.mapping.planning.tours import shortest_tour


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
    assert (
        length_of(shortest_tour(first, between), first, between) <= length_of(nearest, first, between) + 1e-9
    )


def test_what_lies_on_the_shorter_side_is_visited_first_though_another_place_is_nearer():
    # Places lie on a line: what is left of the robot goes on to -6 m, so those on its right come first.
    first, between = costs_of(np.array([[-1.0, 0.0], [1.1, 0.0], [1.6, 0.0], [-6.0, 0.0]]))
    tour = shortest_tour(first, between).tolist()
    assert (set(tour[:2]), tour[2:]) == ({1, 2}, [0, 3])
