"""Gymnasium's RecordVideo and stable-baselines3's recorder film batches and single robots."""

import gymnasium
import numpy as np
import pytest

import lidarium

pytest.importorskip("moviepy", reason="moviepy is not installed: extra [video]")
# Recorders warn that they write, and about each other's versions.
pytestmark = pytest.mark.filterwarnings("ignore")

SMALL = {"lidar": "lidar_360_6m", "map_cells": 32, "horizon_s": 1.0, "render_mode": "rgb_array"}


def films_in(folder):
    return sorted(path.name for path in folder.glob("*.mp4") if path.stat().st_size > 1000)


@pytest.mark.parametrize("kind", ["vector_env", "make_vec"])
def test_each_episode_of_a_batch_is_filmed(kind, tmp_path):
    if kind == "vector_env":
        env = lidarium.vector_env(2, "scene_room", robots=2, **SMALL, starts="fixed")
    else:
        env = gymnasium.make_vec("lidarium/Exploration-v1", 2, floor="scene_room", **SMALL)
    filmed = gymnasium.wrappers.vector.RecordVideo(env, str(tmp_path), episode_trigger=lambda _: True)
    filmed.reset(seed=0)
    for _ in range(14):
        filmed.step(env.action_space.sample())
    filmed.close()
    assert "rl-video-episode-0.mp4" in films_in(tmp_path)


def test_a_robot_alone_is_filmed(tmp_path):
    env = gymnasium.make("lidarium/Exploration-v1", floor="scene_room", **SMALL)
    filmed = gymnasium.wrappers.RecordVideo(env, str(tmp_path))
    filmed.reset(seed=0)
    for _ in range(10):
        filmed.step(np.array([0.5, 0.0], np.float32))
    filmed.close()
    assert films_in(tmp_path) == ["rl-video-episode-0.mp4"]


def test_rows_of_stable_baselines_are_filmed_as_tiles(tmp_path):
    pytest.importorskip("stable_baselines3")
    from stable_baselines3.common.vec_env import VecVideoRecorder

    env = lidarium.sb3_vec_env(4, "scene_room", robots=1, **SMALL, starts="fixed")
    filmed = VecVideoRecorder(env, str(tmp_path), lambda step: step == 0, video_length=6)
    filmed.reset()
    for _ in range(8):
        filmed.step(np.zeros((4, 2), np.float32))
    filmed.close()
    assert len(films_in(tmp_path)) == 1
