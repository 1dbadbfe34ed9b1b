"""The true state of a team: of one size on every floor, the same in batches."""

import numpy as np
import pytest

import lidarium
from lidarium.envs.engine.team_state import ROBOT_NUMBERS, TEAM_NUMBERS
from lidarium.envs.simulation.coverage import unpack_bits

OPTIONS = {"robots": 2, "map_cells": 64, "lidar": "lidar_360_6m", "state_cells": 24}
HEAD = 2 * len(ROBOT_NUMBERS) + len(TEAM_NUMBERS)


def drive(env, steps=40):
    env.reset(seed=2)
    for _ in range(steps):
        env.step(dict.fromkeys(env.agents, np.array([0.5, 0.1], np.float32)))
    return env


def test_numbers_of_the_state_are_the_truth():
    env = drive(lidarium.parallel_env("apartment", horizon_s=100.0, **OPTIONS, starts="fixed"))
    state, robots = env.state(), env.state()[: HEAD - 3].reshape(2, -1)
    side = 100.0 * state[HEAD - 3]
    corner = env.simulation.frames[0, :2]
    assert np.allclose(robots[:, :2] * side + corner, env.world.poses[:, :2], atol=1e-4)
    assert np.allclose(np.arctan2(robots[:, 3], robots[:, 2]), env.world.poses[:, 2], atol=1e-6)
    assert robots[:, 6].tolist() == [1.0, 1.0]
    assert state[HEAD - 2] == np.float32(env.scorer.coverage)
    assert state[HEAD - 1] == pytest.approx(0.96)


def test_pictures_of_the_state_show_what_counts_and_what_was_seen():
    env = drive(lidarium.parallel_env("apartment", **OPTIONS, starts="fixed"))
    counted, seen = env.state()[HEAD:].reshape(2, 24, 24)
    assert (seen <= counted).all()
    cells = unpack_bits(env.score.team_masks[0], env.score.team_masks[0].shape[1] * 64)
    side = 100.0 * float(env.state()[HEAD - 3]) / env.settings.occupancy.resolution
    block = round(side / 24)
    assert seen[2, 3] == pytest.approx(cells[2 * block : 3 * block, 3 * block : 4 * block].mean())
    assert seen.sum() * block**2 == pytest.approx(env.score.team_seen[0], rel=1e-5)
    assert counted.sum() * block**2 == pytest.approx(env.score.counted[0], rel=1e-5)


def test_a_robot_that_has_ended_is_not_live():
    env = drive(lidarium.parallel_env("apartment", **OPTIONS, starts="fixed"), 1)
    env.stop("robot_0", "enough")
    env.step(dict.fromkeys(env.agents, np.zeros(2, np.float32)))
    assert env.state()[: HEAD - 3].reshape(2, -1)[:, 6].tolist() == [0.0, 1.0]


def test_wrappers_pass_the_state_on():
    env = lidarium.parallel_env("scene_room", level="frontier", infos="flat", **OPTIONS, starts="fixed")
    env.reset(seed=0)
    assert env.state_space.contains(env.state())
    assert np.array_equal(env.state(), env.unwrapped.state())
    with pytest.raises(RuntimeError, match="not reset; call reset"):
        lidarium.parallel_env("scene_room").state()
