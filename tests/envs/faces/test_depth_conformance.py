"""Environments with depth cameras pass the checks of their makers in both worlds."""

from importlib.util import find_spec

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from pettingzoo.test import parallel_api_test, parallel_seed_test

import lidarium
from lidarium.envs.simulation.depth.frames import image_of

BACKENDS = [
    "kinematic",
    pytest.param(
        "bullet",
        marks=pytest.mark.skipif(find_spec("pybullet") is None, reason="the extra bullet is missing"),
    ),
]
SMALL = {"camera": "depth_64x48", "map_cells": 64, "lidar": "lidar_360_6m", "resolution": 0.1}
OBSERVE = ["pose", "depth"]


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("level", ["velocity", "waypoint", "frontier"])
def test_the_parallel_api_is_pettingzoos(backend, level, capsys):
    observe = [*OBSERVE, "map"] if level == "waypoint" else OBSERVE
    env = lidarium.parallel_env(backend=backend, level=level, robots=2, horizon_s=3.0, observe=observe, **SMALL)
    parallel_api_test(env, num_cycles=40)
    assert "Passed" in capsys.readouterr().out


@pytest.mark.parametrize("backend", BACKENDS)
def test_equal_seeds_give_equal_images(backend):
    parallel_seed_test(
        lambda: lidarium.parallel_env(backend=backend, robots=2, observe=OBSERVE, **{**SMALL, "camera": "xtion_noisy"}),
        num_cycles=5,
    )


@pytest.mark.parametrize("backend", BACKENDS)
def test_gymnasiums_checker_finds_nothing_in_the_id(backend):
    env = gymnasium.make("lidarium/Exploration3D-v1", backend=backend, horizon_s=1.0, **SMALL)
    check_env(env.unwrapped, skip_render_check=True)
    env.close()


@pytest.mark.parametrize("backend", BACKENDS)
def test_an_image_is_that_of_the_body_as_it_leans(backend):
    env = lidarium.parallel_env(backend=backend, robots=2, observe=OBSERVE, **SMALL)
    env.reset(seed=1)
    for _ in range(12):
        observations, *_ = env.step({agent: np.array([1.0, 0.4], np.float32) for agent in env.agents})
    world, camera = env.world, env.settings.camera
    for robot in range(2):
        expected = image_of(world.floors[0].faces, world.poses, world.attitudes, world.bodies, robot, camera)
        assert (observations[f"robot_{robot}"]["depth"][0] == expected).all()
    if backend == "bullet":
        assert np.abs(world.attitudes).max() > 0.0
    env.close()


def test_the_camera_follows_a_body_that_is_tilted():
    pytest.importorskip("pybullet", reason="the extra bullet is missing")
    env = lidarium.parallel_env(backend="bullet", robots=1, observe=OBSERVE, robot="service", **SMALL)
    observations, _ = env.reset(seed=1)
    before = observations["robot_0"]["depth"].copy()
    bodies, leans = env.world.bodies_of(0), []
    for _ in range(6):
        bodies.push(0, (0.0, 9000.0, 0.0), 1.0)
        observations, *_ = env.step({agent: np.zeros(2, np.float32) for agent in env.agents})
        leans.append(np.abs(env.world.attitudes[0, 1:]).max())
        if not env.agents:
            break
    assert max(leans) > 0.02
    assert (observations["robot_0"]["depth"] != before).any()
    env.close()
