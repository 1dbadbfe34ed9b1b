"""Depth images are those of the bodies as they are, in both worlds."""

import copy
import pickle
from importlib.util import find_spec

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from pettingzoo.test import parallel_seed_test

import lidarium
from lidarium.envs.simulation.depth.frames import image_of

OPTIONS = {"robots": 2, "camera": "depth_64x48", "observe": ["pose", "depth"], "noise": "datasheet"}
NEEDS_BULLET = pytest.mark.skipif(find_spec("pybullet") is None, reason="the extra bullet is missing")
BACKENDS = ["kinematic", pytest.param("bullet", marks=NEEDS_BULLET)]
SMALL = {**OPTIONS, "noise": "none", "map_cells": 64, "lidar": "lidar_360_6m", "resolution": 0.1}


@pytest.mark.parametrize("backend", BACKENDS)
def test_equal_seeds_give_equal_noisy_images(backend):
    options = {**SMALL, "camera": "xtion_noisy"}
    parallel_seed_test(lambda: lidarium.parallel_env(backend=backend, **{"starts": "fixed", **options}), num_cycles=5)


@pytest.mark.parametrize("backend", BACKENDS)
def test_gymnasiums_checker_finds_nothing_in_the_id(backend):
    options = {name: value for name, value in SMALL.items() if name not in ("observe", "robots")}
    env = gymnasium.make("lidarium/Exploration3D-v1", backend=backend, horizon_s=1.0, **options)
    assert env.observation_space["depth"].shape == (1, 48, 64)
    check_env(env.unwrapped, skip_render_check=True)
    env.close()


@pytest.mark.parametrize("backend", BACKENDS)
def test_an_image_is_that_of_the_body_as_it_leans(backend):
    env = lidarium.parallel_env(backend=backend, **SMALL, starts="fixed")
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
    env = lidarium.parallel_env(backend="bullet", **{**SMALL, "robots": 1, "robot": "service"}, starts="fixed")
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


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_a_copy_goes_on_seeing(duplicate):
    env = lidarium.parallel_env("apartment", **OPTIONS, starts="fixed")
    env.reset(seed=0)
    other = duplicate(env)
    actions = {agent: np.array([0.5, 0.2], np.float32) for agent in env.agents}
    (ours, *_), (theirs, *_) = env.step(actions), other.step(actions)
    for agent in actions:
        assert (ours[agent]["depth"] == theirs[agent]["depth"]).all()
        assert ours[agent]["depth"].any()
