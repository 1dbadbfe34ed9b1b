"""Merged maps in batches are those of single teams, to the bit."""

import numpy as np
import pytest

import lidarium
from lidarium.envs.faces.merged_maps import MergedMaps, MergingSettings

OPTIONS = {"robots": 2, "map_cells": 64, "lidar": "lidar_360_6m", "observe": ["pose"], "horizon_s": 8.0}
FLOORS = ["scene_room", "apartment"]


@pytest.mark.parametrize(
    ("level", "options"),
    [
        ("velocity", {"known_starts": False, "radio": "line_of_sight"}),
        ("frontier", {"known_starts": False}),
        ("velocity", {"known_starts": True}),
    ],
)
def test_rows_see_and_are_told_what_single_teams_are(level, options):
    merging = MergingSettings(period_s=2.0, known_starts=level == "frontier")
    batch = lidarium.vector_env(2, FLOORS, level=level, merging=merging, **OPTIONS, **options)
    teams = [MergedMaps(lidarium.parallel_env(FLOORS, level=level, **OPTIONS, **options), merging) for _ in FLOORS]
    assert batch.single_observation_space == teams[0].observation_space("robot_0")
    observations, infos = batch.reset(seed=5)
    alone = [env.reset(seed=5 + episode) for episode, env in enumerate(teams)]
    merges = 0
    for _ in range(100 if level == "velocity" else 8):
        for episode, outcome in enumerate(alone):
            for agent, own in outcome[0].items():
                row, info = 2 * episode + int(agent[-1]), outcome[-1][agent]
                assert all(np.array_equal(observations[name][row], value) for name, value in own.items())
                assert infos["merges"][row] == info["merges"]
                assert infos["truth"]["merges"][row] == info["truth"]["merges"]
                merges += len(info["merges"])
        action = 0 if level == "frontier" else np.array([0.5, 0.2], np.float32)
        observations, *_, infos = batch.step(np.array([action] * 4))
        alone = [env.step(dict.fromkeys(env.agents, action)) if env.agents else env.reset() for env in teams]
    assert merges or level == "velocity"
    batch.close()


def test_rows_of_stable_baselines_see_merged_maps():
    pytest.importorskip("stable_baselines3")
    env = lidarium.sb3_vec_env(2, "scene_room", merging=MergingSettings(), known_starts=False, **OPTIONS)
    env.seed(1)
    observations = env.reset()
    assert (observations["team_map"] != 127).any(axis=(1, 2, 3)).all()
    assert env.step(np.zeros((4, 2)))[0]["teammates"].shape == (4, 1, 5)


def test_a_robot_alone_has_nobody_to_merge_with():
    with pytest.raises(ValueError, match="robots is 1; merging maps wants two or more"):
        lidarium.vector_env(2, "scene_room", merging=MergingSettings(), **{**OPTIONS, "robots": 1})
