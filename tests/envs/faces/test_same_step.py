"""Batches whose episodes begin again in the step that ends them, as Gymnasium's mode SAME_STEP has it."""

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

import lidarium

OPTIONS = {"robots": 2, "horizon_s": 0.5, "map_cells": 64, "observe": ("scan", "pose")}


def test_final_observations_and_infos_are_those_that_the_next_step_mode_returns():
    same = lidarium.vector_env(3, "scene_room", autoreset_mode=AutoresetMode.SAME_STEP, **OPTIONS, starts="fixed")
    later = lidarium.vector_env(3, "scene_room", **OPTIONS, starts="fixed")
    assert same.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    for one, other in zip(same.reset(seed=1)[0].values(), later.reset(seed=1)[0].values(), strict=True):
        assert np.array_equal(one, other)
    actions = np.full((6, 2), 0.3, np.float32)
    for _ in range(5):
        found, wanted = same.step(actions), later.step(actions)
        for k in (1, 2, 3):
            assert np.array_equal(found[k], wanted[k])
    infos = found[4]
    assert (found[2] | found[3]).all()
    assert infos["_final_obs"].all()
    for row in range(6):
        for key, values in wanted[0].items():
            assert np.array_equal(infos["final_obs"][row][key], values[row])
    assert np.array_equal(infos["final_info"]["truth"]["coverage"], wanted[4]["truth"]["coverage"])
    assert list(infos["final_info"]["ended_because"]) == ["horizon"] * 6
    began, *_ = later.step(actions)
    for key, values in began.items():
        assert np.array_equal(found[0][key], values)
    assert not same.step(actions)[3].any()


def test_other_modes_are_refused():
    with pytest.raises(ValueError, match="autoreset_mode is 'Disabled'; want NextStep or SameStep"):
        lidarium.vector_env(1, "scene_room", autoreset_mode="Disabled", **OPTIONS)


def test_rows_for_learners_have_the_state_of_each_team():
    pytest.importorskip("stable_baselines3")
    learners = lidarium.sb3_vec_env(2, "scene_room", **OPTIONS, starts="fixed")
    learners.reset()
    assert learners.num_envs == 4
    assert learners.state().shape == (
        2,
        lidarium.vector_env(2, "scene_room", **OPTIONS, starts="fixed").state_space.shape[0],
    )


def test_an_array_is_a_floor():
    solid = np.zeros((60, 80), bool)
    solid[[0, -1]] = solid[:, [0, -1]] = True
    solid[20, :50] = True
    env = lidarium.parallel_env(solid, image_resolution=0.05, robots=1, map_cells=64, starts="fixed")
    env.reset(seed=0)
    grey = np.where(solid, 0, 255).astype(np.uint8)
    assert lidarium.load_floor(grey, 0.05).sha256 == env.floor.sha256
    batch = lidarium.vector_env(2, solid, image_resolution=0.05, robots=1, map_cells=64, starts="fixed")
    assert batch.reset(seed=0)[0]["scan"].shape[0] == 2
    with pytest.raises(ValueError, match="array is an array without a scale; want image_resolution"):
        lidarium.parallel_env(solid, robots=1)
    with pytest.raises(ValueError, match=r"resolution is 0.0; want"):
        lidarium.load_floor(solid, 0.0)
    with pytest.raises(ValueError, match="want rows and columns of numbers"):
        lidarium.load_floor(np.zeros((2, 3, 4)), 0.05)


def test_infos_of_episodes_that_go_on_are_those_of_the_step():
    options = {**OPTIONS, "horizon_s": 60.0, "starts": "fixed"}
    same = lidarium.vector_env(2, "scene_room", autoreset_mode=AutoresetMode.SAME_STEP, **options)
    later = lidarium.vector_env(2, "scene_room", **options)
    infos = []
    for env in (same, later):
        env.reset(seed=1)
        for episode, agent, reason in ((0, "robot_0", "first"), (0, "robot_1", "second"), (1, "robot_0", "third")):
            env.team(episode).stop(agent, reason)
        *_, terminated, _, found = env.step(np.full((4, 2), 0.3, np.float32))
        assert terminated.tolist() == [True, True, True, False]
        infos.append(found)
    now, wanted = infos
    assert list(now["ended_because"]) == [None, None, "third", None]
    assert now["_ended_because"].tolist() == [False, False, True, False]
    assert list(now["final_info"]["ended_because"][:2]) == ["first", "second"]
    for name, values in wanted["reward_terms"].items():
        np.testing.assert_array_equal(now["reward_terms"][name][2:], values[2:])
    assert now["reward_terms"]["time"].tolist() == [0.0, 0.0, -0.001, -0.001]
    np.testing.assert_array_equal(now["truth"]["coverage"][2:], wanted["truth"]["coverage"][2:])


def test_the_step_that_ends_a_team_tells_which_robots_had_ended_before():
    for mode in AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP:
        env = lidarium.vector_env(1, "scene_room", autoreset_mode=mode, **OPTIONS, starts="fixed")
        env.reset(seed=0)
        env.team(0).stop("robot_0", "enough")
        told = [env.step(np.zeros((2, 2), np.float32))[4]["active"].tolist() for _ in range(6)]
        assert told == [[True, True], *[[False, True]] * 4, [True, True]]
