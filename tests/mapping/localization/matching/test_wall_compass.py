import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from seen_rooms import BEAMS, room_seen

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.localization.matching.wall_compass import WallCompass, wall_direction, within_quarter
from lidarium.mapping.localization.settings import CompassSettings

STEP = math.radians(0.25)
"""Standard deviation of turns between nodes that graphs are told."""


def seen(heading, seed, turned=0.0, noise=0.02):
    """Points of a scan taken at a true heading, in a frame from which the robot has turned."""
    generator = np.random.default_rng(seed)
    points = room_seen(*generator.uniform(1.0, 3.0, 2), heading, noise, seed)
    return Transform(0.0, 0.0, turned).apply(points)


def surveyed():
    """A compass that knows that walls run along the axes, seen from the first node."""
    compass = WallCompass(CompassSettings())
    assert compass.survey(np.concatenate([seen(turn, 7, turn) for turn in (0.0, 0.5, 1.0)]), 0, 0.0)
    return compass


def led(compass, nodes, drift, turns=0.0, seed=0):
    """Lead a robot through a room while its heading drifts at each node; return by how much it is off, and
    its variance."""
    generator = np.random.default_rng(seed)
    true, believed, variance = 0.0, 0.0, 0.0
    for node in range(1, nodes + 1):
        turn = turns * math.sin(node)
        true += turn
        believed += turn + drift * generator.normal()
        compass.observe(seen(true, 1000 * seed + node, turn))
        correction, variance = compass.turn(node, turn, STEP**2, believed)
        believed += correction
    return believed - true, variance


def test_headings_do_not_drift_where_there_are_walls():
    drift = CompassSettings().drift
    off = np.array([led(surveyed(), 150, drift * STEP, 0.4, seed) for seed in range(12)])
    # Without walls it would be 1.2 degrees in the root of the mean square.
    assert np.degrees(np.sqrt(np.mean(off[:, 0] ** 2))) < 0.12
    spread = drift * np.sqrt(off[:, 1])
    assert np.sqrt(np.mean((off[:, 0] / spread) ** 2)) == pytest.approx(1.0, abs=0.6)


def test_nothing_turns_before_it_is_known_where_walls_run():
    compass = WallCompass(CompassSettings())
    off, variance = led(compass, 20, STEP)
    assert not compass.is_surveyed
    assert compass.bearings == []
    assert abs(off) > 0.0
    assert variance == pytest.approx(20 * STEP**2)


def test_a_place_without_walls_is_no_survey():
    compass = WallCompass(CompassSettings())
    assert not compass.survey(np.random.default_rng(0).uniform(-4.0, 4.0, (500, 2)), 0, 0.0)
    assert not compass.is_surveyed


def test_walls_run_as_was_surveyed_from_the_nodes_heading():
    compass = WallCompass(CompassSettings())
    assert compass.survey(seen(0.0, 1), 3, 0.25)
    compass.observe(seen(0.1, 2))
    turn, _ = compass.turn(4, 0.0, math.radians(5.0) ** 2, 0.34)
    assert turn == pytest.approx(0.01, abs=math.radians(0.2))


def test_a_wing_at_another_angle_turns_nothing():
    compass = surveyed()
    led(compass, 20, 0.0)
    known = len(compass.bearings)
    for node in range(21, 40):
        compass.observe(seen(math.radians(20.0), node))
        assert compass.turn(node, 0.0, STEP**2, 0.0)[0] == 0.0
    assert len(compass.bearings) == known


def test_a_heading_that_is_lost_is_left_alone_until_it_is_known_again():
    compass = surveyed()
    led(compass, 20, 0.0)

    def turned(node, variance, heading):
        compass.observe(seen(0.0, node, noise=0.0))
        return compass.turn(node, 0.0, variance, heading)[0]

    assert turned(21, 0.5**2, math.radians(1.0)) == 0.0
    assert turned(22, STEP**2, math.radians(1.0)) == 0.0
    compass.relieve(math.radians(2.0) ** 2)
    assert turned(23, STEP**2, math.radians(1.0)) == pytest.approx(-math.radians(1.0), abs=math.radians(0.3))


def test_what_was_seen_before_a_gap_says_nothing_after_it():
    compass = surveyed()
    led(compass, 20, 0.0)
    compass.observe(seen(0.0, 3, noise=0.0))
    compass.forget()
    assert compass.turn(21, 0.0, STEP**2, 0.01) == (0.0, compass.turn(22, 0.0, 0.0, 0.01)[1])


def test_edges_turn_nodes_to_where_walls_run():
    compass = surveyed()
    led(compass, 30, 0.0)
    nodes = np.zeros((31, 3))
    nodes[:, 2] = np.linspace(0.0, math.radians(2.0), 31)
    edges = compass.edges(nodes)
    assert [edge[1] for edge in edges] == [bearing.node for bearing in compass.bearings]
    assert {edge[0] for edge in edges} == {0}
    turns = np.array([edge[2][2] for edge in edges])
    assert np.abs(turns).max() < math.radians(1.0)
    assert all(not edge[3][:2].any() and edge[3][2, 2] > 0.0 and edge[4] for edge in edges)


def test_directions_are_the_same_after_quarter_turns():
    for turns in range(-4, 5):
        assert within_quarter(0.2 + turns * math.pi / 2) == pytest.approx(0.2)


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
        scans = [[laid(x, 10 * seed + k) for k, x in enumerate(np.linspace(1.0, 5.0, places))] for seed in range(40)]
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
