"""A robot that leans scans along the tilted plane of its laser."""

import math

import numpy as np
import pytest

from lidarium.envs.floors.floor import Floor
from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.settings.robots import ROBOTS

pytest.importorskip("pybullet", reason="the extra bullet is not installed")
from lidarium.envs.simulation.bullet.bodies import Bodies
from lidarium.envs.simulation.bullet.bullet_world import scan_leaning

KOBUKI = ROBOTS["kobuki"]
LIDAR = Lidar(beams=5, field_of_view=math.pi, range_max=2.5, height=0.3)
HALL = Floor("hall", (0.0, 0.0, 6.0, 4.0))


def scan(pose, pitch=0.0, other=(5.0, 0.5, 0.0)):
    """Return what a robot at x, y, theta sees that leans forward by ``pitch``."""
    bodies = Bodies([KOBUKI] * 2, 0.1)
    bodies.begin(HALL, np.array([pose, other]))
    bodies.put(0, np.array(pose))
    bodies.put(1, np.array(other))
    if pitch:
        number = bodies.client.call("getBodyUniqueId", bodies.client.call("getNumBodies") - 2)
        assert bodies.motion(0).place[:2] == pytest.approx(pose[:2])
        centre, _ = bodies.client.call("getBasePositionAndOrientation", number)
        turn = bodies.client.bullet.getQuaternionFromEuler((0.0, pitch, pose[2]))
        bodies.client.call("resetBasePositionAndOrientation", number, centre, turn)
    ranges, place = np.zeros(LIDAR.beams, np.float32), bodies.motion(0).place
    scan_leaning(bodies, 0, LIDAR, ranges)
    bodies.close()
    return ranges, place


def test_upright_it_sees_the_walls_around():
    ranges, _ = scan((1.0, 2.0, 0.0))
    # To the right, ahead and to the left; the wall at the back is not in view, that ahead too far.
    assert ranges[[0, 4]] == pytest.approx([2.0, 2.0], abs=0.01)
    assert ranges[2] == math.inf
    ranges, _ = scan((1.0, 2.0, math.pi))
    assert ranges[[0, 2, 4]] == pytest.approx([2.0, 1.0, 2.0], abs=0.01)
    assert ranges[1] == pytest.approx(math.sqrt(2.0), abs=0.01)


def test_leaning_forward_it_sees_the_ground_ahead_and_the_walls_beside_it():
    pitch = 0.2
    ranges, place = scan((2.0, 2.0, 0.0), pitch)
    height = place[2] + LIDAR.height * math.cos(pitch)
    assert ranges[2] == pytest.approx(height / math.sin(pitch), rel=0.02)
    assert ranges[[0, 4]] == pytest.approx([2.0, 2.0], abs=0.02)


def test_other_robots_are_met_and_its_own_body_is_not():
    ranges, _ = scan((2.0, 2.0, 0.0), other=(3.0, 2.0, 0.0))
    assert ranges[2] == pytest.approx(1.0 - KOBUKI.radius, abs=0.01)
    assert (ranges > KOBUKI.radius).all()
