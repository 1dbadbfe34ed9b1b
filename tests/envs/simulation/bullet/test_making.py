"""The simulation of a world of PyBullet is made of settings."""

import numpy as np
import pytest

from lidarium.envs.settings.making import make_settings
from lidarium.envs.simulation.backends import BACKENDS
from lidarium.envs.simulation.kernels.floor_cache import FloorTables

pytest.importorskip("pybullet", reason="the extra bullet is not installed")
from linked_rooms import TWO_ROOMS

from lidarium.envs.simulation.bullet.bullet_world import BulletWorld
from lidarium.envs.simulation.bullet.making import make_bullet

CAMERA = {"columns": 64, "rows": 48, "height": 0.2}

SETTINGS = make_settings(robots=2, backend="bullet", kinds=("kobuki", "pioneer"), time_step=0.05, camera=CAMERA)


def test_it_has_the_team_the_step_and_the_camera_of_the_settings():
    simulation = make_bullet(SETTINGS, 3)
    world = simulation.world
    assert type(world) is BulletWorld
    assert (world.robots, world.episodes, world.time_step) == (2, 3, 0.05)
    assert np.array_equal(world.bodies, [robot.numbers for robot in SETTINGS.team])
    assert world.true_ranges.shape == (6, SETTINGS.lidar.beams)
    assert simulation.camera.camera == SETTINGS.camera
    assert not simulation.is_fused


def test_the_backend_of_that_name_drives_and_maps():
    simulation = BACKENDS["bullet"](SETTINGS, 1)
    tables = FloorTables.of_floor(TWO_ROOMS, SETTINGS.raster_resolution, SETTINGS.lidar.height, SETTINGS.robot.height)
    simulation.place(0, tables, TWO_ROOMS.starts, 1)
    simulation.step(np.zeros((2, 2)), moves_bodies=False)
    seen = simulation.score.coverage(0)
    for _ in range(20):
        simulation.step(np.full((2, 2), (0.4, 0.0)))
    assert simulation.world.poses[:, 0] == pytest.approx(1.0 + 0.4, abs=0.12)
    assert simulation.score.coverage(0) > seen > 0.0
    simulation.close()
