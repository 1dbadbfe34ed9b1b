"""Depth cameras take their images when these are due."""

import copy

import numpy as np
import pytest
from linked_rooms import ROOM, TWO_ROOMS

from lidarium.envs.settings.cameras import DepthCamera
from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.settings.robots import ROBOTS
from lidarium.envs.simulation.depth.depth_sensor import DepthSensor
from lidarium.envs.simulation.kernels.arrays import ENDED
from lidarium.envs.simulation.kernels.floor_cache import FloorTables
from lidarium.envs.simulation.kinematic_world import KinematicWorld

CAMERA = DepthCamera(columns=17, rows=13, depth_min=0.1, depth_max=6.0, field_of_view=0.1, rate_hz=5.0)
LIDAR = Lidar(beams=11)


def sensor(floors=(ROOM, ROOM), camera=CAMERA, threads=1):
    """One robot in each episode, which looks along x from the middle of its floor's first start."""
    world = KinematicWorld([ROBOTS["kobuki"]], LIDAR, 0.1, len(floors))
    made = DepthSensor(world, camera, 0.1, threads)
    for episode, floor in enumerate(floors):
        tables = FloorTables.of_floor(floor, 0.05, LIDAR.height, ROBOTS["kobuki"].height)
        world.place(episode, tables, floor.starts[:1], tables.body.solid == 0, episode)
        made.place(episode, tables)
    return made, world


def test_before_the_first_image_nothing_was_measured():
    made, _ = sensor()
    assert made.frames.shape == (2, 13, 17)
    assert not made.frames.any()
    assert made.taken_at.tolist() == [-1, -1]


def test_an_image_shows_how_far_the_wall_is():
    made, world = sensor((ROOM, TWO_ROOMS))
    made.take(np.array([-1, -1]))
    # The walls at x = 4 m and 8 m, from 2 m and, through the door, from 1 m.
    assert made.frames[0] == pytest.approx(2.0, abs=1e-5)
    assert not made.frames[1].any()
    world.poses[1, 0] = 3.0
    made.take(np.array([1, 1]))
    assert made.frames[1] == pytest.approx(5.0, abs=1e-5)


def test_images_are_taken_at_the_period_and_of_the_episodes_that_run():
    made, world = sensor()
    made.take(np.array([-1, -1]))
    assert made.taken_at.tolist() == [0, 0]
    before = made.frames.copy()
    world.poses[:, 0] += 0.5
    made.take(np.array([0, 0]))
    assert np.array_equal(made.frames, before)
    made.take(np.array([1, 1]), np.array([False, True]))
    assert made.taken_at.tolist() == [0, 2]
    assert np.array_equal(made.frames[0], before[0])
    assert made.frames[1] == pytest.approx(1.5, abs=1e-5)


def test_who_has_ended_takes_no_image():
    made, world = sensor()
    world.flags[1] |= ENDED
    made.take(np.array([-1, -1]))
    assert made.taken_at.tolist() == [0, -1]
    assert not made.frames[1].any()


def test_an_episode_begins_without_an_image():
    made, _ = sensor()
    made.take(np.array([-1, -1]))
    made.place(1, FloorTables.of_floor(ROOM, 0.05, LIDAR.height, ROBOTS["kobuki"].height))
    assert made.taken_at.tolist() == [0, -1]
    assert made.frames[0].any()
    assert not made.frames[1].any()


def test_noise_comes_from_the_seed_of_the_episode_and_a_copy_draws_the_same():
    noisy = DepthCamera(columns=17, rows=13, depth_max=6.0, noise_floor=0.02, rate_hz=5.0)
    made, _ = sensor(camera=noisy)
    twin = copy.deepcopy(made)
    for each in (made, twin):
        each.take(np.array([-1, -1]))
    assert np.array_equal(made.frames, twin.frames)
    assert not np.array_equal(made.frames[0], made.frames[1])
