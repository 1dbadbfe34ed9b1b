"""Where robots start: drawn by the seed, at the floor's starts, or where a reset says; alone and in batches."""

import gymnasium
import numpy as np
import pytest

import lidarium

SMALL = {"robots": 2, "map_cells": 64, "lidar": "lidar_360_6m"}


def begun(env, seed, **options):
    env.reset(seed=seed, options=options)
    return env.unwrapped.world.starts.copy()


@pytest.mark.parametrize("floor", ["apartment", "set:test:1", ["apartment"]])
def test_makers_draw_starts_by_the_seed_unless_fixed_ones_are_asked_for(floor):
    drawn = lidarium.parallel_env(floor, **SMALL)
    fixed = lidarium.parallel_env(floor, starts="fixed", **SMALL)
    assert np.abs(begun(drawn, 0) - begun(drawn, 1)).max() > 0.1
    assert np.array_equal(begun(drawn, 0), begun(drawn, 0))
    assert np.array_equal(begun(fixed, 0)[0], begun(fixed, 1)[0])


def test_every_face_draws_the_same_starts_for_a_seed():
    alone = [begun(lidarium.parallel_env(**SMALL), seed) for seed in (3, 4, 5)]
    batch = lidarium.vector_env(3, **SMALL)
    batch.reset(seed=3)
    assert np.array_equal(batch.engine.world.starts.reshape(3, 2, 3), alone)
    assert np.array_equal(begun(lidarium.env(**SMALL), 3), alone[0])
    one = {**SMALL, "robots": 1}
    solo = gymnasium.make("lidarium/Exploration-v1", **one).unwrapped.parallel
    assert np.array_equal(begun(solo, 3), begun(lidarium.parallel_env(**one), 3))


def test_rows_for_learners_draw_the_same_starts():
    pytest.importorskip("stable_baselines3")
    batch = lidarium.sb3_vec_env(3, **SMALL)
    batch.seed(3)
    batch.reset()
    alone = [begun(lidarium.parallel_env(**SMALL), seed) for seed in (3, 4, 5)]
    assert np.array_equal(batch.engine.world.starts.reshape(3, 2, 3), alone)
    assert repr(batch) == "<ExplorationVecEnv: 6 rows = 3 episodes x 2 robots>"


def test_settings_that_name_no_starts_leave_the_default_and_others_hold():
    env = lidarium.parallel_env(settings=lidarium.make_settings(robots=2))
    assert np.abs(begun(env, 3) - begun(env, 4)).max() > 0.1
    env = lidarium.parallel_env(settings=lidarium.make_settings(robots=2, starts="fixed"))
    assert begun(env, 3) == pytest.approx(lidarium.load_floor("apartment").starts[:2])


def test_a_run_of_one_floor_takes_its_starts():
    env = lidarium.ExplorationEnv("apartment", lidarium.make_settings(robots=2))
    assert begun(env, 3) == pytest.approx(lidarium.load_floor("apartment").starts[:2])


def test_an_option_of_a_reset_goes_before_the_setting():
    env = lidarium.parallel_env("apartment", **SMALL, starts="fixed")
    fixed = begun(env, 0)
    drawn = begun(env, 0, starts="drawn")
    assert not np.array_equal(fixed, drawn)
    assert np.array_equal(begun(env, 1, starts="fixed"), fixed)
    assert np.array_equal(begun(lidarium.parallel_env("apartment", starts="drawn", **SMALL), 0), drawn)


def test_rows_of_a_batch_start_where_single_episodes_do():
    batch = lidarium.vector_env(3, ["apartment", "clinic"], **SMALL)
    batch.reset(seed=4)
    alone = lidarium.parallel_env(["apartment", "clinic"], **SMALL)
    starts = np.concatenate([begun(alone, 4 + episode) for episode in range(3)])
    assert np.array_equal(batch.engine.world.starts, starts)
    batch.reset(seed=4, options={"starts": "fixed"})
    again = np.concatenate([begun(alone, 4 + episode, starts="fixed") for episode in range(3)])
    assert np.array_equal(batch.engine.world.starts, again)


@pytest.mark.parametrize("starts", ["random", "fixd"])
def test_unknown_kinds_of_starts_are_refused(starts):
    with pytest.raises(ValueError, match=r"starts is .*; want fixed, drawn or None"):
        lidarium.parallel_env("apartment", starts=starts)
    with pytest.raises(ValueError, match=r"option starts is .*; want \(3, 3\) .*one of fixed, drawn"):
        lidarium.parallel_env("apartment").reset(options={"starts": starts})


def growing(number):
    """A curriculum of two floors."""
    return {"floor": "scene_room" if number < 3 else "apartment", "starts": "drawn"}


def test_a_curriculum_chooses_by_the_number_of_the_episode():
    env = lidarium.parallel_env("clinic", curriculum=growing, **SMALL, starts="fixed")
    names = []
    for _ in range(5):
        env.reset()
        names.append(env.floor.name)
    assert names == ["scene_room"] * 3 + ["apartment"] * 2
    env.reset(options={"floor": "clinic"})
    assert env.floor.name == "clinic"


def test_episodes_of_a_batch_are_counted_as_they_begin():
    batch = lidarium.vector_env(2, "clinic", curriculum=growing, **SMALL, starts="fixed")
    names = []
    for _ in range(2):
        batch.reset(seed=1)
        names += [floor.name for floor in batch.engine.floors]
    assert names == ["scene_room"] * 3 + ["apartment"]


def test_bad_options_of_a_curriculum_are_refused_with_the_number():
    env = lidarium.parallel_env("clinic", curriculum=lambda number: {"start": number}, **SMALL, starts="fixed")
    with pytest.raises(ValueError, match="the curriculum of episode 0: unknown reset option 'start'"):
        env.reset(seed=0)
