import math

import numpy as np
import pytest
from seen_rooms import room_seen

from lidarium.mapping.localization.settings import CompassSettings
from lidarium.mapping.localization.wall_compass import WallCompass, within_quarter

STEP = math.radians(0.25)
"""Standard deviation of turns between nodes that graphs are told."""


def led(compass, nodes, drift, turns=0.0, seed=0, leaves_first_map=True):
    """Lead a robot through a room while its heading drifts at each node; return by how much it is off, and its variance."""
    if leaves_first_map:
        compass.leave_first_map()
    generator = np.random.default_rng(seed)
    true, believed, variance = 0.0, 0.0, 0.0
    compass.look(room_seen(2.0, 1.5, true, 0.02, seed), 0.0)
    for node in range(1, nodes + 1):
        turn = turns * math.sin(node)
        true += turn
        believed += turn + drift * generator.normal()
        compass.look(room_seen(*generator.uniform(1.0, 3.0, 2), true, 0.02, 1000 * seed + node), turn)
        correction, variance = compass.turn(node, turn, STEP**2, believed)
        believed += correction
    return believed - true, variance


def test_headings_do_not_drift_where_there_are_walls():
    settings = CompassSettings()
    off = np.array([led(WallCompass(settings), 150, settings.drift * STEP, 0.4, seed) for seed in range(12)])
    # Without walls it would be 1.2 degrees in the root of the mean square.
    assert np.degrees(np.sqrt(np.mean(off[:, 0] ** 2))) < 0.3
    spread = settings.drift * np.sqrt(off[:, 1])
    assert np.sqrt(np.mean((off[:, 0] / spread) ** 2)) == pytest.approx(1.0, abs=0.6)


def test_headings_in_the_first_map_are_trusted_more_than_walls():
    def off(leaves_first_map):
        found = [led(WallCompass(CompassSettings()), 12, 0.0, 0.0, seed, leaves_first_map)[0] for seed in range(12)]
        return np.sqrt(np.mean(np.square(found)))

    assert 0.0 < off(leaves_first_map=False) < 0.7 * off(leaves_first_map=True)


def test_a_wing_at_another_angle_turns_nothing():
    compass = WallCompass(CompassSettings())
    led(compass, 20, 0.0)
    known = len(compass.bearings)
    for node in range(21, 40):
        compass.look(room_seen(2.0, 1.5, math.radians(20.0), 0.02, node), 0.0)
        assert compass.turn(node, 0.0, STEP**2, 0.0)[0] == 0.0
    assert len(compass.bearings) == known


def test_a_heading_that_is_lost_is_left_alone_until_it_is_known_again():
    compass = WallCompass(CompassSettings())
    led(compass, 20, 0.0)

    def turned(node, variance, heading):
        compass.look(room_seen(2.0, 1.5, 0.0, 0.0, node), 0.0)
        return compass.turn(node, 0.0, variance, heading)[0]

    assert turned(21, 0.5**2, math.radians(1.0)) == 0.0
    assert turned(22, STEP**2, math.radians(1.0)) == 0.0
    compass.relieve(math.radians(2.0) ** 2)
    assert turned(23, STEP**2, math.radians(1.0)) == pytest.approx(-math.radians(1.0), abs=math.radians(0.3))


def test_what_was_seen_before_a_gap_says_nothing_after_it():
    compass = WallCompass(CompassSettings())
    led(compass, 20, 0.0)
    compass.look(room_seen(2.0, 1.5, 0.0, 0.0, 3), 0.0)
    compass.forget()
    assert compass.turn(21, 0.0, STEP**2, 0.01) == (0.0, compass.turn(22, 0.0, 0.0, 0.01)[1])


def test_edges_turn_nodes_to_where_walls_run():
    compass = WallCompass(CompassSettings())
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
