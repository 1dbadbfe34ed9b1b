"""What every world has: arrays of the documented shapes and types that keep their place."""

from importlib.util import find_spec

import numpy as np
import pytest
from linked_rooms import TWO_ROOMS
from plain_world import PlainWorld

from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.settings.robots import ROBOTS
from lidarium.envs.simulation.backend import World
from lidarium.envs.simulation.bullet.bullet_world import BulletWorld
from lidarium.envs.simulation.kernels.floor_cache import FloorTables
from lidarium.envs.simulation.kinematic_world import KinematicWorld

NEEDS_BULLET = pytest.mark.skipif(find_spec("pybullet") is None, reason="the extra bullet is not installed")
WORLDS = [KinematicWorld, PlainWorld, pytest.param(BulletWorld, marks=NEEDS_BULLET)]
EPISODES, TEAM, LIDAR = 2, [ROBOTS["kobuki"]] * 2, Lidar(beams=21, range_max=3.0)
ROWS = EPISODES * len(TEAM)
ARRAYS = {
    "bodies": ((2, 8), np.float64),
    "seeds": ((EPISODES,), np.uint64),
    "steps": ((EPISODES,), np.int64),
    "starts": ((ROWS, 3), np.float64),
    "poses": ((ROWS, 3), np.float64),
    "velocities": ((ROWS, 2), np.float64),
    "moves": ((ROWS,), np.uint8),
    "flags": ((ROWS,), np.int64),
    "failed": ((ROWS,), np.uint8),
    "contacts": ((ROWS,), np.uint8),
    "travelled": ((ROWS,), np.float64),
    "collisions": ((ROWS,), np.int64),
    "true_ranges": ((ROWS, 21), np.float32),
    "attitudes": ((ROWS, 3), np.float64),
}
SENSORS = {
    "scan": ((ROWS, 21), np.float32),
    "odometry": ((ROWS, 3), np.float64),
    "velocity": ((ROWS, 2), np.float64),
    "bumper": ((ROWS, 3), np.int8),
}


def placed(kind):
    world: World = kind(TEAM, LIDAR, 0.1, EPISODES)
    tables = FloorTables.of_floor(TWO_ROOMS, 0.05, LIDAR.height, TEAM[0].height)
    for episode in range(EPISODES):
        world.place(episode, tables, TWO_ROOMS.starts, tables.body.solid == 0, 7 + episode)
    return world


@pytest.mark.parametrize("kind", WORLDS)
def test_arrays_have_their_shapes_and_types(kind):
    world = placed(kind)
    assert (world.robots, world.episodes) == (2, EPISODES)
    for name, (shape, dtype) in ARRAYS.items():
        array = getattr(world, name)
        assert (array.shape, array.dtype) == (shape, dtype), name
    for name, (shape, dtype) in SENSORS.items():
        assert (world.sensors[name].shape, world.sensors[name].dtype) == (shape, dtype), name
    assert world.faults.shape[0] == ROWS
    assert world.seeds.tolist() == [7, 8]
    assert world.steps.tolist() == [-1, -1]
    assert world.poses == pytest.approx(np.tile(TWO_ROOMS.starts, (EPISODES, 1)), abs=2e-3)


@pytest.mark.parametrize("kind", WORLDS)
def test_arrays_keep_their_place_and_steps_are_left_to_be_counted(kind):
    world = placed(kind)
    owned = [name for name in ARRAYS if name != "attitudes"]
    before = [getattr(world, name).ctypes.data for name in owned]
    sensed = [world.sensors[name].ctypes.data for name in SENSORS]
    world.move_and_sense(np.zeros((ROWS, 2)), moves_bodies=False)
    world.move_and_sense(np.full((ROWS, 2), 0.2))
    assert [getattr(world, name).ctypes.data for name in owned] == before
    assert [world.sensors[name].ctypes.data for name in SENSORS] == sensed
    assert world.steps.tolist() == [-1, -1]
    assert (world.travelled > 0.0).all()
    world.close()
    world.close()


@pytest.mark.parametrize("kind", [KinematicWorld, PlainWorld])
def test_a_world_without_a_window_says_so(kind):
    assert not placed(kind).show()
