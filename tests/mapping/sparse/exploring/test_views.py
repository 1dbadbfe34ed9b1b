"""The best view is the one that an exhaustive search finds."""

import math

import numpy as np
import pytest

from lidarium.mapping.sparse.exploring.views import HEADINGS, Places, Sight, Unknown, best_view
from lidarium.mapping.sparse.swept_body import are_free, index_boxes

SIGHT = Sight(
    nearest=0.6,
    near=2.0,
    farthest=3.5,
    half_angle=0.4,
    bearing=0.0,
    low=0.1,
    height=0.5,
    turn_cost=0.2,
    gain=0.3,
    most_m2=4.0,
    least_m=0.3,
)
WALL = np.array([[[2.0, -1.0, 0.0], [2.1, 3.0, 2.0]]])


def on_floor(points):
    return np.column_stack([np.reshape(points, (-1, 2)), np.zeros(len(np.reshape(points, (-1, 2))))])


def scene(seed, boxes=WALL):
    """Places, the cheapest first, and unknown ground around them."""
    generator = np.random.default_rng(seed)
    count = 30
    costs = np.sort(generator.uniform(0.0, 6.0, count))
    costs[0] = 0.0
    places = Places(on_floor(generator.uniform(-3.0, 5.0, (count, 2))), costs, generator.uniform(-3.0, 3.0, count))
    frontier, samples = generator.uniform(-3.0, 5.0, (60, 2)), generator.uniform(-4.0, 6.0, (90, 2))
    return index_boxes(boxes), places, Unknown(on_floor(frontier), 0.1, on_floor(samples), 0.09)


def seen(index, place, points, farthest):
    gaps = np.hypot(*(points - place)[:, :2].T)
    ray = np.array([0.02, SIGHT.low, SIGHT.height])
    free = are_free(index, np.repeat(place[None], len(points), axis=0), points, ray)
    return free & (gaps >= SIGHT.nearest) & (gaps <= farthest)


def value_of(index, places, unknown, sight, number, heading):
    """The oracle: what a view costs less what it is worth, and how much frontier it has."""
    place = places.points[number]
    counts = []
    for points, farthest in ((unknown.frontier, sight.near), (unknown.samples, sight.farthest)):
        gaps = points[seen(index, place, points, farthest)] - place
        bins = np.floor(np.arctan2(gaps[:, 1], gaps[:, 0]) * HEADINGS / (2 * math.pi)).astype(int) % HEADINGS
        middle = int(math.floor((heading + sight.bearing) * HEADINGS / (2 * math.pi))) % HEADINGS
        apart = np.abs((bins - middle + HEADINGS // 2) % HEADINGS - HEADINGS // 2)
        counts.append(int((apart <= int(sight.half_angle * HEADINGS / (2 * math.pi) - 0.5)).sum()))
    turn = abs(math.remainder(heading - places.headings[number], 2 * math.pi))
    cost = places.costs[number] + sight.turn_cost * turn
    return cost - sight.gain * min(counts[1] * unknown.area, sight.most_m2), counts[0] * unknown.length


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("bearing", [0.0, 0.7])
def test_no_view_is_better_than_the_best(seed, bearing):
    index, places, unknown = scene(seed)
    sight = SIGHT._replace(bearing=bearing)
    least = math.inf
    for number in range(len(places.costs)):
        for k in range(HEADINGS):
            heading = (k + 0.5) * 2 * math.pi / HEADINGS - bearing
            value, length = value_of(index, places, unknown, sight, number, heading)
            if length >= sight.least_m - 1e-9:
                least = min(least, value)
    found = best_view(index, places, unknown, sight)
    number = int(np.argmin(np.abs(places.points - found.place).sum(axis=1)))
    value, length = value_of(index, places, unknown, sight, number, found.heading)
    assert value == pytest.approx(least)
    assert length >= sight.least_m - 1e-9


@pytest.mark.parametrize("seed", range(6))
def test_what_a_view_is_to_see_is_before_the_camera_near_enough_and_not_hidden(seed):
    index, places, unknown = scene(seed)
    view = best_view(index, places, unknown, SIGHT)
    assert len(view.points) >= 3
    assert seen(index, view.place, view.points, SIGHT.near).all()
    angles = np.arctan2(*(view.points - view.place)[:, :2].T[::-1]) - view.heading
    assert np.abs(np.mod(angles + math.pi, 2 * math.pi) - math.pi).max() <= SIGHT.half_angle


def test_nothing_to_see_and_nowhere_to_stand_are_no_view():
    index, places, unknown = scene(0)
    none = np.empty((0, 3))
    assert best_view(index, places, unknown._replace(frontier=none), SIGHT) is None
    assert best_view(index, Places(none, np.empty(0), np.empty(0)), unknown, SIGHT) is None
    far = unknown._replace(frontier=unknown.frontier + np.array([50.0, 0.0, 0.0]))
    assert best_view(index, places, far, SIGHT) is None


def test_a_frontier_behind_a_wall_is_seen_from_where_it_is_not_hidden():
    index = index_boxes(WALL)
    places = Places(on_floor([[1.0, 0.5], [3.2, 0.5]]), np.array([0.0, 5.0]), np.zeros(2))
    frontier = on_floor([[x, y] for x in (2.3, 2.4) for y in (0.4, 0.5, 0.6)])
    view = best_view(index, places, Unknown(frontier, 0.1, frontier, 0.01), SIGHT)
    assert view.place == pytest.approx([3.2, 0.5, 0.0])
    assert math.cos(view.heading) < -0.9
    low = index_boxes(np.array([[[2.0, -1.0, 0.7], [2.1, 3.0, 0.75]]]))
    view = best_view(low, places, Unknown(frontier, 0.1, frontier, 0.01), SIGHT)
    assert view.place == pytest.approx([1.0, 0.5, 0.0]), "a table top is above the line of sight"


def test_a_view_that_shows_more_is_worth_a_longer_way_up_to_what_it_is_worth():
    index = index_boxes(np.empty((0, 2, 3)))
    frontier = on_floor([[1.0, y] for y in (-0.1, 0.0, 0.1)] + [[9.0, y] for y in (-0.1, 0.0, 0.1)])
    samples = on_floor([[10.0 + 0.1 * k, 0.1 * j] for k in range(10) for j in range(-3, 4)])
    unknown = Unknown(frontier, 0.1, samples, 0.01)
    for cost, x in ((0.3, 8.0), (5.0, 0.0)):
        places = Places(on_floor([[0.0, 0.0], [8.0, 0.0]]), np.array([0.0, cost]), np.zeros(2))
        view = best_view(index, places, unknown, SIGHT._replace(gain=1.0))
        assert view.place[0] == x
