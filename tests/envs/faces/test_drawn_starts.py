"""Where robots start: every maker draws poses by the seed, unless they are given."""

import gymnasium
import numpy as np
import pytest

import lidarium
from lidarium.envs.settings.making import make_settings

FEW = {"robots": 2, "map_cells": 32, "max_cycles": 5}


def poses(env, seed):
    env.reset(seed=seed)
    return env.unwrapped.world.poses.copy()


def rows(env):
    env.reset(seed=3)
    return env.engine.world.poses.reshape(-1, 2, 3).copy()


def learner(**options):
    pytest.importorskip("stable_baselines3")
    env = lidarium.sb3_vec_env(3, **options)
    env.seed(3)
    env.reset()
    return env.engine.world.poses.reshape(-1, 2, 3).copy()


def test_starts_are_drawn_by_the_seed():
    env = lidarium.parallel_env(**FEW)
    first, again, other = (poses(env, seed) for seed in (3, 3, 4))
    assert np.array_equal(first, again)
    assert np.abs(first - other).max() > 0.5
    assert env.settings.starts == "drawn"


def test_every_row_starts_where_a_single_environment_with_its_seed_starts():
    alone = [poses(lidarium.parallel_env(**FEW), seed) for seed in (3, 4, 5)]
    assert np.array_equal(rows(lidarium.vector_env(3, **FEW)), alone)
    assert np.array_equal(learner(**FEW), alone)
    turns = lidarium.env(**FEW)
    assert np.array_equal(poses(turns, 3), alone[0])


def test_the_gymnasium_form_starts_as_the_makers_do():
    solo = gymnasium.make("lidarium/Exploration-v1", map_cells=32)
    assert np.array_equal(poses(solo.unwrapped.parallel, 3), poses(lidarium.parallel_env(robots=1, map_cells=32), 3))


@pytest.mark.parametrize("options", [{"starts": "fixed"}, {"settings": make_settings(robots=2, starts="fixed")}])
def test_starts_that_are_asked_for_are_those_of_the_floor(options):
    given = {name: value for name, value in FEW.items() if "settings" not in options or name != "robots"}
    floor = lidarium.load_floor("apartment")
    made = poses(lidarium.parallel_env("apartment", **given, **options), 3)
    assert made == pytest.approx(floor.starts[:2])
    assert rows(lidarium.vector_env(3, "apartment", **given, **options)) == pytest.approx(np.stack([made] * 3))


def test_settings_that_do_not_name_starts_leave_the_makers_default():
    env = lidarium.parallel_env(settings=make_settings(robots=2))
    assert np.abs(poses(env, 3) - poses(env, 4)).max() > 0.5


def test_starts_of_a_reset_hold():
    env = lidarium.parallel_env(**FEW)
    given = np.array([[2.5, 4.0, 0.0], [2.5, 4.6, 0.0]])
    env.reset(seed=3, options={"starts": given})
    assert np.array_equal(env.world.poses, given)


def test_a_batch_says_how_its_rows_are_episodes_and_robots():
    pytest.importorskip("stable_baselines3")
    assert repr(lidarium.sb3_vec_env(16)) == "<ExplorationVecEnv: 48 rows = 16 episodes x 3 robots>"
    assert repr(lidarium.vector_env(2, **FEW)) == "<ExplorationVectorEnv: 4 rows = 2 episodes x 2 robots>"
