"""Teams and batches are drawn: a picture of each episode, all of one size, and tiles."""

import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from pettingzoo.test import render_test

import lidarium
from lidarium.envs.drawing.batch_frames import batch_frames
from lidarium.envs.floors.floor import Floor

SMALL = {"robots": 2, "map_cells": 32, "lidar": "lidar_360_6m"}
WIDE = Floor("wide", (0.0, 0.0, 6.0, 2.0))


@pytest.fixture
def no_display(monkeypatch):
    """A machine without a screen: windows cannot open, and the environment says so once."""
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=r"render_mode is 'human'")
        yield


@pytest.mark.parametrize("level", lidarium.registry("level"))
@pytest.mark.usefixtures("no_display")
def test_all_render_modes_render(level):
    render_test(lambda **options: lidarium.env("scene_room", level=level, **SMALL, **{"starts": "fixed", **options}))


@pytest.mark.usefixtures("no_display")
def test_gymnasiums_checker_finds_nothing_in_pictures():
    env = gymnasium.make("lidarium/Exploration-v1", floor=WIDE, render_mode="rgb_array", **{**SMALL, "robots": 1})
    check_env(env.unwrapped)


@pytest.mark.parametrize("level", lidarium.registry("level"))
def test_pictures_follow_each_other_as_simulated_time_goes_alone_and_in_batches(level):
    options = {"robots": 1, "time_step": 0.05, "decision_period_s": 0.5}
    alone = lidarium.parallel_env(level=level, **{"starts": "fixed", **options})
    batch = lidarium.vector_env(1, level=level, **{"starts": "fixed", **options})
    for env in (alone, batch):
        assert env.metadata["render_fps"] == pytest.approx(20 if level == "velocity" else 2)
    assert type(batch).metadata["render_fps"] == 10


@pytest.mark.usefixtures("no_display")
def test_frames_are_images_that_change_as_robots_drive():
    env = lidarium.parallel_env("scene_room", render_mode="rgb_array", **SMALL, starts="fixed")
    env.reset(seed=0)
    first = env.render()
    for _ in range(20):
        env.step({agent: np.array([0.5, 0.5], np.float32) for agent in env.agents})
    second = env.render()
    assert first.shape == second.shape
    assert first.dtype == np.uint8
    assert not np.array_equal(first, second)
    env.close()
    env.close()


def test_no_mode_renders_nothing_and_rendering_needs_a_reset():
    env = lidarium.parallel_env("scene_room", robots=1, starts="fixed")
    env.reset(seed=0)
    assert env.render() is None
    with pytest.raises(RuntimeError, match="reset"):
        lidarium.parallel_env("scene_room", robots=1, render_mode="rgb_array").render()


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
    batch = lidarium.vector_env(2, "scene_room", render_mode="rgb_array", **SMALL, starts="fixed")
    batch.reset(seed=4, options={"starts": "drawn"})
    first, second = batch.render()[0], batch.render()[2]
    assert (first != second).any()
    batch.reset(seed=[5, 4], options={"starts": "drawn"})
    assert np.array_equal(batch.render()[2], first)


def test_a_batch_without_a_mode_draws_nothing_but_its_picture():
    env = lidarium.vector_env(5, "scene_room", **SMALL, starts="fixed")
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
    env = lidarium.sb3_vec_env(4, "scene_room", render_mode="rgb_array", **SMALL, starts="fixed")
    env.seed(0)
    env.reset()
    frame = env.get_images()[0]
    assert env.render().shape == (2 * frame.shape[0], 2 * frame.shape[1], 3)
