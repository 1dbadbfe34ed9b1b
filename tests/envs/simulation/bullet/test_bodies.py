"""The bodies of an episode in PyBullet: put down, driven, touched, pushed and met by rays."""

import math

import numpy as np
import pytest

from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.settings.robots import ROBOTS

pytest.importorskip("pybullet", reason="the extra bullet is not installed")
from lidarium.envs.simulation.bullet.bodies import RAYS_AT_ONCE, Bodies

KOBUKI = ROBOTS["kobuki"]
BLOCK = Solid(np.array([(3.0, 1.0), (3.4, 1.0), (3.4, 3.0), (3.0, 3.0)]), 0.0, 1.0)
HALL = Floor("hall", (0.0, 0.0, 6.0, 4.0), (BLOCK,))
STARTS = np.array([[1.0, 2.0, 0.0], [1.0, 3.2, 2.5]])


@pytest.fixture
def bodies():
    made = Bodies([KOBUKI] * 2, 0.1)
    made.begin(HALL, STARTS)
    yield made
    made.close()


def heading(motion):
    return math.atan2(motion.axes[1, 0], motion.axes[0, 0])


def test_robots_begin_upright_and_at_rest_where_they_are_put(bodies):
    for robot, (x, y, theta) in enumerate(STARTS):
        motion = bodies.motion(robot)
        assert motion.place == pytest.approx([x, y, 0.0], abs=2e-3)
        assert heading(motion) == pytest.approx(theta, abs=1e-3)
        assert motion.axes[2, 2] == pytest.approx(1.0, abs=1e-4)
        assert np.linalg.norm(motion.velocity) < 0.05
    bodies.put(0, np.array([2.0, 1.0, -1.0]))
    assert bodies.motion(0).place == pytest.approx([2.0, 1.0, 0.0])
    assert heading(bodies.motion(0)) == pytest.approx(-1.0)


def test_who_is_put_elsewhere_begins_to_turn_its_wheels_there(bodies):
    for _ in range(10):
        bodies.step(np.full((2, 2), 0.3))
    bodies.put(0, STARTS[0])
    turned = bodies.step(np.zeros((2, 2)))
    assert turned[0] == pytest.approx(0.0, abs=0.02)
    assert np.linalg.norm(bodies.motion(0).velocity) < 0.02


def test_wheels_turn_as_wanted_and_carry_the_robot_along(bodies):
    for _ in range(20):
        turned = bodies.step(np.array([[0.3, 0.3], [-0.1, 0.1]]))
    assert turned == pytest.approx(np.array([[0.3, 0.3], [-0.1, 0.1]]), abs=0.02)
    assert bodies.motion(0).velocity[0] == pytest.approx(0.3, abs=0.03)
    turn_rate = 0.2 / KOBUKI.wheel_base
    assert bodies.motion(1).turning[2] == pytest.approx(turn_rate, abs=0.1 * turn_rate)
    assert np.hypot(*(bodies.motion(1).place - [*STARTS[1, :2], 0.0])[:2]) < 0.02


def test_a_robot_touches_walls_and_robots_but_not_the_ground(bodies):
    assert bodies.touched(0) == []
    bodies.put(0, np.array([3.0 - KOBUKI.radius + 1e-3, 2.0, 0.0]))
    bodies.step(np.zeros((2, 2)))
    x, y = np.mean(bodies.touched(0), axis=0)
    assert (x, y) == pytest.approx((3.0, 2.0), abs=0.01)
    bodies.put(0, np.array([1.0, 2.0, 0.0]))
    bodies.put(1, np.array([1.0, 2.0 + 2.0 * KOBUKI.radius - 1e-3, 0.0]))
    bodies.step(np.zeros((2, 2)))
    for robot in range(2):
        x, y = np.mean(bodies.touched(robot), axis=0)
        assert (x, y) == pytest.approx((1.0, 2.0 + KOBUKI.radius), abs=0.01)


def test_a_push_moves_a_robot_in_its_direction(bodies):
    bodies.put(0, np.array([1.0, 2.0, 0.0]))
    for _ in range(3):
        bodies.push(0, (200.0, 0.0, 0.0), 0.1)
        bodies.step(np.zeros((2, 2)))
    pushed = bodies.motion(0).place - [1.0, 2.0, 0.0]
    assert pushed[0] > 5e-3
    assert abs(pushed[1]) < 0.2 * pushed[0]


def test_rays_end_at_what_they_meet(bodies):
    begins = np.array([[2.0, 2.0, 0.3], [2.0, 2.0, 1.3], [2.0, 3.5, 0.3], [2.0, 0.5, 0.5]])
    ends = np.array([[4.0, 2.0, 0.3], [4.0, 2.0, 1.3], [2.0, 5.5, 0.3], [2.0, 0.5, -0.5]])
    shares = bodies.rays(begins, ends)
    # The block is 1 m away and 1 m high, the outer wall 0.5 m away and the ground half a metre below.
    assert shares == pytest.approx([0.5, 1.0, 0.25, 0.5], abs=0.01)
    many = RAYS_AT_ONCE + 5
    assert np.array_equal(
        bodies.rays(np.tile(begins[:1], (many, 1)), np.tile(ends[:1], (many, 1))), np.full(many, shares[0])
    )


def test_nothing_is_left_of_the_episode_before(bodies):
    bodies.step(np.full((2, 2), 0.3))
    bodies.begin(Floor("empty", (0.0, 0.0, 6.0, 4.0)), STARTS[::-1])
    assert bodies.motion(0).place == pytest.approx([1.0, 3.2, 0.0], abs=2e-3)
    assert bodies.rays(np.array([[2.0, 2.0, 0.3]]), np.array([[4.0, 2.0, 0.3]])).tolist() == [1.0]
    bodies.close()
    assert not bodies.client.is_open
