import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from seen_rooms import BEAMS, room_seen

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.localization.matching.wall_direction import wall_direction, within_quarter


@given(st.floats(1.0, 5.0), st.floats(1.0, 3.0), st.floats(-math.pi, math.pi), st.integers(0, 1000))
def test_walls_are_seen_turned_back_by_the_heading(x, y, heading, seed):
    direction, information = wall_direction(room_seen(x, y, heading, 0.02, seed))
    assert -math.pi / 4 <= direction < math.pi / 4
    assert abs(within_quarter(direction + heading)) < 8.0 / math.sqrt(information)
    assert abs(within_quarter(direction + heading)) < math.radians(0.6)


def test_the_information_is_that_of_the_errors():
    for noise in (0.01, 0.02):
        found = np.array([wall_direction(room_seen(2.0, 1.5, 0.3, noise, seed)) for seed in range(300)])
        errors = np.array([within_quarter(direction + 0.3) for direction, _ in found])
        assert np.sqrt(np.mean(errors**2 * found[:, 1])) == pytest.approx(1.0, abs=0.5)


def test_scans_of_many_places_tell_more_than_one():
    def laid(x, seed):
        return Transform(x, 1.5, x).apply(room_seen(x, 1.5, x, 0.01, seed))

    spread = {}
    for places in (1, 6):
        scans = [
            [laid(x, 10 * seed + k) for k, x in enumerate(np.linspace(1.0, 5.0, places))]
            for seed in range(40)
        ]
        spread[places] = np.std([wall_direction(np.concatenate(seen))[0] for seen in scans])
    assert math.degrees(spread[6]) < 0.02
    assert spread[6] < 0.6 * spread[1]


def test_one_slanting_wall_hardly_turns_the_others():
    slanting = np.stack([np.linspace(0.0, 1.0, 20), np.linspace(-3.0, -2.8, 20)], axis=1)
    points = np.concatenate([room_seen(2.0, 1.5, 0.0, 0.0, 0), slanting])
    assert abs(wall_direction(points)[0]) < math.radians(0.1)


@pytest.mark.parametrize(
    "points",
    [
        np.zeros((0, 2)),
        np.array([[1.0, 0.0], [1.0, 1.0]]),
        3.0 * np.stack([np.cos(BEAMS), np.sin(BEAMS)], axis=1),
        np.random.default_rng(1).uniform(-4.0, 4.0, (200, 2)),
        np.array([[1.0, 2.0]] * 50),
    ],
    ids=["nothing", "two points", "round", "scattered", "one place"],
)
def test_what_has_no_walls_tells_nothing(points):
    assert wall_direction(points) == (0.0, 0.0)
