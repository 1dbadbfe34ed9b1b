"""Views of maps of probabilities, compared with plain Python."""

import math

import numpy as np
import pytest

from lidarium.mapping.planning.touring.expected_views import DIMMEST, GAIN_RAYS, MARK_RAYS, cover, shares_left


def passed_cells(free, place, count, reach):
    """Yield the cells of each ray, the probability with which it comes there, and the step."""
    for ray in range(count):
        angle = (ray + 0.5) * 2.0 * math.pi / count
        passed = 1.0
        for step in range(1, reach + 1):
            row = math.floor(place[0] + 0.5 + step * math.sin(angle))
            column = math.floor(place[1] + 0.5 + step * math.cos(angle))
            if not (0 <= row < free.shape[0] and 0 <= column < free.shape[1]):
                break
            yield row, column, passed, step
            passed *= float(free[row, column])
            if passed < DIMMEST:
                break


def area(free, worth, place, reach):
    terms = (
        passed * worth[row, column] * step for row, column, passed, step in passed_cells(free, place, GAIN_RAYS, reach)
    )
    return sum(terms) * 2.0 * math.pi / GAIN_RAYS


def seen_from(free, place, reach):
    seen = np.zeros(free.shape, np.float32)
    seen[tuple(place)] = 1.0
    for row, column, passed, _ in passed_cells(free, place, MARK_RAYS, reach):
        seen[row, column] = max(seen[row, column], np.float32(passed))
    return seen


@pytest.fixture
def maps():
    """Two rooms with a door between them, of which one is seen."""
    generator = np.random.default_rng(2)
    free = generator.uniform(0.7, 1.0, (24, 30)).astype(np.float32)
    free[:, 14], free[10:13, 14] = 0.02, 0.9
    unseen = free * (np.arange(30) > 11)
    return free, unseen.astype(np.float32)


def test_without_a_place_nothing_is_chosen(maps):
    """On a map of MapEx no point of the lattice near the robot was free, and the policy crashed."""
    chosen, gains = cover(*maps, np.zeros((0, 2), np.int64), 9, 4.0, 20.0, 8)
    assert (len(chosen), len(gains)) == (0, 0)


def test_places_are_chosen_by_what_they_add(maps):
    free, unseen = maps
    places = np.argwhere(np.ones((8, 10))) * 3
    chosen, gains = cover(free, unseen, places, 9, 4.0, 20.0, 8)
    rest, wanted, shown = unseen.copy(), [], []
    while len(wanted) < 8 and rest.sum() > 20.0:
        areas = [-1.0 if k in wanted else area(free, rest, place, 9) for k, place in enumerate(places)]
        if max(areas) < 4.0:
            break
        wanted.append(int(np.argmax(areas)))
        shown.append(max(areas))
        rest *= 1.0 - seen_from(free, places[wanted[-1]], 9)
    assert len(wanted) > 2
    assert chosen.tolist() == wanted
    np.testing.assert_allclose(gains, shown, rtol=1e-6)
    assert (unseen == maps[1]).all()


def test_shares_are_what_a_view_leaves_of_the_area_of_a_stop(maps):
    free, unseen = maps
    stops, views = np.array([[5, 20], [20, 25], [12, 3]]), np.array([[5, 22], [18, 24]])
    shares = shares_left(free, unseen, stops, views, 9)
    for v, view in enumerate(views):
        rest = unseen * (1.0 - seen_from(free, view, 9))
        for s, stop in enumerate(stops):
            wanted = area(free, rest, stop, 9) / area(free, unseen, stop, 9) if s < 2 else 1.0  # too far away
            assert shares[v, s] == pytest.approx(wanted, rel=1e-5)
    assert shares.min() < 0.5
    assert shares.max() <= 1.0


def test_nothing_is_chosen_where_nothing_is_left(maps):
    free, unseen = maps
    chosen, gains = cover(free, np.zeros_like(unseen), np.array([[3, 3]]), 9, 1.0, 0.0, 8)
    assert len(chosen) == len(gains) == 0
