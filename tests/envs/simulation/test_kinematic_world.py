"""Robots that do what they are commanded, on floors of cells."""

import copy
import math
import pickle

import numpy as np
import pytest
from scored_halls import hall, tables_of

from lidarium.envs.settings.faults import Fault, FaultSettings
from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.settings.odometry import ODOMETRY
from lidarium.envs.settings.robots import ROBOTS
from lidarium.envs.simulation.disturbances.faults import FAULT_NUMBERS, PLACE_X, PLACE_Y
from lidarium.envs.simulation.kinematic_world import KinematicWorld

KOBUKI, LIDAR, HALL = ROBOTS["kobuki"], Lidar(beams=61), tables_of(hall())
STARTS = np.array([[1.0, 2.0, 0.0], [4.0, 2.0, math.pi / 2]])


def placed(episodes=1, starts=STARTS, floor=HALL, **options):
    world = KinematicWorld([KOBUKI] * len(starts), LIDAR, 0.1, episodes, **options)
    for episode in range(episodes):
        world.place(episode, floor, starts, floor.body.solid == 0, 3 + episode)
    return world


def drive(world, command, steps):
    for _ in range(steps):
        world.move_and_sense(np.tile(np.array(command, float), (len(world.poses), 1)))
        world.steps += 1


def test_robots_follow_commands_within_their_limits():
    world = placed()
    drive(world, (0.3, 0.0), 30)
    # Speed grows by the greatest acceleration; the rest of the path is at the commanded speed.
    rise = math.ceil(0.3 / (KOBUKI.max_acceleration * 0.1))
    shares = np.minimum(KOBUKI.max_acceleration * 0.1 * np.arange(1, rise + 1), 0.3)
    path = 0.1 * (shares.sum() + 0.3 * (30 - rise))
    assert world.travelled == pytest.approx(path)
    assert world.poses == pytest.approx(STARTS + np.array([[path, 0.0, 0.0], [0.0, path, 0.0]]))
    drive(world, (99.0, 0.0), 30)
    assert world.velocities[0, 0] == KOBUKI.max_speed


def test_an_episode_begins_without_a_trace_of_the_one_before():
    world = placed(2)
    drive(world, (0.5, 0.3), 40)
    world.moves[0], world.failed[1] = 0, 1
    left = {name: getattr(world, name)[2:].copy() for name in ("poses", "travelled", "ranges", "velocities")}
    world.place(0, HALL, STARTS, HALL.body.solid == 0, 9)
    assert np.array_equal(world.poses[:2], STARTS)
    for name in ("velocities", "travelled", "collisions", "contacts", "bumpers", "failed", "measured"):
        assert not getattr(world, name)[:2].any(), name
    assert world.moves[:2].tolist() == [1, 1]
    assert np.isinf(world.ranges[:2]).all()
    assert world.steps.tolist() == [-1, 40 - 1]
    assert world.seeds.tolist() == [9, 4]
    for name, array in left.items():
        assert np.array_equal(getattr(world, name)[2:], array), name


def test_wheels_that_measure_exactly_measure_the_velocities():
    world = placed()
    drive(world, (0.2, 0.1), 5)
    assert np.array_equal(world.sensors["velocity"], world.velocities)
    assert not world.sensors["odometry"].any()
    reckoned = placed(has_odometry=True)
    drive(reckoned, (0.2, 0.1), 5)
    assert reckoned.sensors["odometry"][0] == pytest.approx(reckoned.poses[0] - STARTS[0])
    biased = placed(odometry=ODOMETRY["poor"])
    drive(biased, (0.2, 0.1), 5)
    assert not np.allclose(biased.sensors["velocity"], biased.velocities, rtol=1e-3)


def test_a_plane_world_has_no_attitudes_and_no_window():
    world = placed(2)
    assert world.attitudes.tolist() == [[0.0] * 3] * 4
    assert not world.show()
    world.close()


def test_kidnapped_robots_are_put_where_a_robot_has_room():
    fault = FaultSettings(schedule=tuple(Fault(kind="kidnapping", robot=k, at_s=0.2) for k in range(2)))
    places = []
    for seed in range(20):
        world = placed(faults=fault)
        world.place(0, HALL, STARTS, HALL.body.solid == 0, seed)
        places += world.faults.reshape(2, -1, FAULT_NUMBERS)[:, 0, [PLACE_X, PLACE_Y]].tolist()
    x, y = np.array(places).T
    assert ((x > KOBUKI.radius) & (x < 6.0 - KOBUKI.radius)).all()
    assert ((y > KOBUKI.radius) & (y < 4.0 - KOBUKI.radius)).all()
    assert np.ptp(x) > 3.0
    # Where nobody has room, it is one of the starts.
    cramped = KinematicWorld([KOBUKI] * 2, LIDAR, 0.1, 1, faults=fault)
    cramped.place(0, HALL, STARTS, np.zeros(HALL.body.solid.shape, np.bool_), 0)
    found = cramped.faults.reshape(2, -1, FAULT_NUMBERS)[:, 0, [PLACE_X, PLACE_Y]]
    assert all(place in STARTS[:, :2].tolist() for place in found.tolist())


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda world: pickle.loads(pickle.dumps(world))])
def test_a_copy_goes_on_alike_and_by_itself(copied):
    world = placed(odometry=ODOMETRY["typical"])
    drive(world, (0.4, 0.2), 10)
    twin = copied(world)
    drive(twin, (0.4, 0.2), 10)
    assert not np.array_equal(twin.poses, world.poses)
    drive(world, (0.4, 0.2), 10)
    assert np.array_equal(twin.poses, world.poses)
    assert np.array_equal(twin.ranges, world.ranges)
