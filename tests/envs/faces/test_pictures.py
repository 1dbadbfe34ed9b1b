"""Batches are drawn: a picture of each episode, all of one size, and tiles."""

import numpy as np
import pytest

import lidarium
from lidarium.envs.drawing.batch_frames import batch_frames
from lidarium.envs.floors.floor import Floor

SMALL = {"robots": 2, "map_cells": 32, "lidar": "lidar_360_6m"}
WIDE = Floor("wide", (0.0, 0.0, 6.0, 2.0))


def test_each_row_has_the_picture_of_its_episode():
    env = lidarium.vector_env(3, ["scene_room", WIDE], render_mode="rgb_array", **SMALL)
    env.reset(seed=1)
    frames = env.render()
    assert len(frames) == env.num_envs
    assert {frame.shape for frame in frames} == {frames[0].shape}
    assert all(frame.dtype == np.uint8 for frame in frames)
    assert frames[0] is frames[1]
    before = [frame.copy() for frame in frames]
    for _ in range(20):
        env.step(np.full((6, 2), 0.5, np.float32))
    assert all((old != new).any() for old, new in zip(before, env.render(), strict=True))


def test_pictures_of_a_batch_show_the_floor_and_the_robots_of_each_episode():
    batch = lidarium.vector_env(2, "scene_room", render_mode="rgb_array", **SMALL)
    batch.reset(seed=4, options={"starts": "drawn"})
    first, second = batch.render()[0], batch.render()[2]
    assert (first != second).any()
    batch.reset(seed=[5, 4], options={"starts": "drawn"})
    assert np.array_equal(batch.render()[2], first)


def test_a_batch_without_a_mode_draws_nothing_but_its_picture():
    env = lidarium.vector_env(5, "scene_room", **SMALL)
    with pytest.raises(RuntimeError, match="not reset; call reset"):
        env.picture()
    env.reset(seed=0)
    assert env.render() is None
    height, width, _ = batch_frames(env.batch.scenes())[0].shape
    assert env.picture().shape == (2 * height, 3 * width, 3)


def test_other_modes_are_refused():
    for make in (lidarium.vector_env, lidarium.sb3_vec_env):
        with pytest.raises(ValueError, match="render_mode is 'human'; want rgb_array or None"):
            make(2, "scene_room", render_mode="human", **SMALL)


def test_rows_for_stable_baselines_are_drawn_as_tiles():
    pytest.importorskip("stable_baselines3")
    env = lidarium.sb3_vec_env(4, "scene_room", render_mode="rgb_array", **SMALL)
    env.seed(0)
    env.reset()
    frame = env.get_images()[0]
    assert env.render().shape == (2 * frame.shape[0], 2 * frame.shape[1], 3)
