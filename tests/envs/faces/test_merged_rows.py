"""Merged maps in batches."""

import numpy as np
import pytest

import lidarium
from lidarium.envs.faces.merged_maps import MergingSettings

OPTIONS = {"robots": 2, "map_cells": 64, "lidar": "lidar_360_6m", "observe": ["pose"], "horizon_s": 8.0}


def test_rows_of_stable_baselines_see_merged_maps():
    pytest.importorskip("stable_baselines3")
    env = lidarium.sb3_vec_env(
        2, "scene_room", merging=MergingSettings(), known_starts=False, **OPTIONS, starts="fixed"
    )
    env.seed(1)
    observations = env.reset()
    assert (observations["team_map"] != 127).any(axis=(1, 2, 3)).all()
    assert env.step(np.zeros((4, 2)))[0]["teammates"].shape == (4, 1, 5)


def test_a_robot_alone_has_nobody_to_merge_with():
    with pytest.raises(ValueError, match="robots is 1; merging maps wants two or more"):
        lidarium.vector_env(2, "scene_room", merging=MergingSettings(), **{**OPTIONS, "robots": 1})


@pytest.mark.parametrize("given", [{"period_s": 2.0}, "thesis"])
def test_settings_of_another_kind_are_refused_in_batches_and_episodes(given):
    with pytest.raises(ValueError, match=r"merging is .*; want True or MergingSettings"):
        lidarium.vector_env(2, "scene_room", merging=given, **OPTIONS)
    env = lidarium.parallel_env("scene_room", **OPTIONS)
    with pytest.raises(ValueError, match=r"merging is .*; want True or MergingSettings"):
        lidarium.run_episode(lidarium.policy("nearest_frontier"), env, seed=0, merging=given)


def test_robots_of_a_batch_that_cannot_talk_know_nothing_of_each_other():
    merging = MergingSettings(known_starts=True)
    for can_talk in (np.eye(2, dtype=bool), lambda time_s, poses: np.eye(2, dtype=bool)):
        env = lidarium.vector_env(2, "scene_room", merging=merging, can_talk=can_talk, **OPTIONS)
        observations, _ = env.reset(seed=0)
        assert not observations["teammates"].any()
    with pytest.raises(ValueError, match="can_talk is given, but merging is not"):
        lidarium.vector_env(2, "scene_room", can_talk=np.eye(2, dtype=bool), **OPTIONS)
