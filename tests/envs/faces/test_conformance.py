"""The libraries' own tests of their contracts, over every form, level and registered id."""

import math
import sys
import warnings
from importlib.util import find_spec

import gymnasium
import numpy as np
import pettingzoo
import pytest
from gymnasium.utils.env_checker import check_env

import lidarium

with warnings.catch_warnings():
    # Importing PettingZoo's tests imports its example environments in a deprecated way.
    warnings.simplefilter("ignore")
    from pettingzoo.test import (
        api_test,
        max_cycles_test,
        parallel_api_test,
        parallel_seed_test,
        performance_benchmark,
        render_test,
        seed_test,
    )

LEVELS = {"Exploration": "velocity", "WaypointExploration": "waypoint", "FrontierExploration": "frontier"}
CHOICES = (["egocentric_map"], ["egocentric_map", "velocity", "bumper"], ["scan", "pose"])
IDS = [f"lidarium/{name}-v1" for name in LEVELS]
BULLET = {"backend": "bullet", "map_cells": 64, "lidar": "lidar_360_6m", "resolution": 0.1}
needs_bullet = pytest.mark.skipif(find_spec("pybullet") is None, reason="the extra bullet is not installed")


@pytest.fixture
def no_display(monkeypatch):
    """A machine without a screen: windows cannot open, and the environment says so once."""
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=r"render_mode is 'human'")
        yield


@pytest.mark.parametrize("level", LEVELS.values())
@pytest.mark.parametrize("robots", [1, 3])
def test_the_parallel_api_is_pettingzoos(level, robots, capsys):
    env = lidarium.parallel_env(
        level=level, robots=robots, horizon_s=15.0 if level == "velocity" else 60.0, map_cells=64
    )
    parallel_api_test(env, num_cycles=200)
    assert "Passed" in capsys.readouterr().out


@pytest.mark.parametrize("observe", CHOICES)
def test_the_parallel_api_is_pettingzoos_whatever_is_observed(observe, capsys):
    parallel_api_test(
        lidarium.parallel_env(robots=2, horizon_s=5.0, observe=observe, egocentric_cells=32), num_cycles=60
    )
    assert "Passed" in capsys.readouterr().out


@pytest.mark.parametrize("level", LEVELS.values())
@pytest.mark.parametrize("noise", ["none", "datasheet"])
def test_equal_seeds_give_equal_parallel_environments(level, noise):
    parallel_seed_test(lambda: lidarium.parallel_env(level=level, noise=noise, map_cells=64), num_cycles=10)


@pytest.mark.parametrize("level", LEVELS.values())
def test_the_turn_based_form_passes_the_api_test(level, capsys):
    with warnings.catch_warnings():
        # The test was written for observations that are arrays.
        warnings.filterwarnings("ignore", message="Observation is not a NumPy array")
        warnings.filterwarnings("ignore", message="Observation space for each agent probably should be")
        api_test(lidarium.env(level=level, robots=2, horizon_s=40.0, map_cells=64), num_cycles=60)
    assert "Passed" in capsys.readouterr().out


def test_equal_seeds_give_equal_turn_based_environments():
    seed_test(lambda: lidarium.env(robots=2, noise="datasheet", map_cells=64), num_cycles=20)


def test_max_cycles_are_what_was_asked_for():
    max_cycles_test(lidarium)


@pytest.mark.parametrize("level", LEVELS.values())
@pytest.mark.usefixtures("no_display")
def test_all_render_modes_render(level):
    render_test(lambda **options: lidarium.env("scene_room", level=level, robots=2, map_cells=64, **options))


def test_the_performance_benchmark_runs(monkeypatch, capsys):
    module, now = sys.modules["pettingzoo.test.performance_benchmark"], [0.0]

    class Clock:
        @staticmethod
        def time():
            now[0] += 0.05
            return now[0]

    monkeypatch.setattr(module, "time", Clock)
    performance_benchmark(lidarium.env(robots=2, horizon_s=3.0, map_cells=64))
    assert "cycles per second" in capsys.readouterr().out


@pytest.mark.parametrize("name", IDS)
@pytest.mark.parametrize("render_mode", [None, "rgb_array"])
@pytest.mark.usefixtures("no_display")
def test_gymnasiums_checker_finds_nothing(name, render_mode):
    check_env(gymnasium.make(name, render_mode=render_mode, map_cells=64).unwrapped)


@pytest.mark.parametrize("name", IDS)
@pytest.mark.parametrize("observe", CHOICES)
def test_gymnasiums_checker_finds_nothing_whatever_is_observed(name, observe):
    check_env(
        gymnasium.make(name, observe=observe, egocentric_cells=40, egocentric_scales=(1, 2, 4)).unwrapped,
        skip_render_check=True,
    )


@pytest.mark.parametrize("name", IDS)
def test_ids_are_found_through_the_module_prefix(name):
    env = gymnasium.make(f"lidarium:{name}", floor="scene_room")
    assert env.spec is not None
    assert env.spec.id == name
    observation, info = env.reset(seed=1)
    assert env.observation_space.contains(observation)
    assert "truth" in info
    env.close()


@pytest.mark.skipif(not hasattr(pettingzoo, "make"), reason="PettingZoo before 1.27 has no register")
@pytest.mark.parametrize("name", IDS)
def test_pettingzoo_makes_both_forms_by_the_same_ids(name):
    parallel = pettingzoo.make("parallel", name, robots=2)
    assert parallel.reset(seed=0)[0].keys() == {"robot_0", "robot_1"}
    turns = pettingzoo.make("aec", name, robots=2)
    turns.reset(seed=0)
    assert turns.agents == ["robot_0", "robot_1"]
    assert parallel.metadata["name"] == turns.metadata["name"]


def test_importing_twice_registers_once():
    import importlib

    importlib.reload(lidarium)
    assert set(IDS) <= gymnasium.registry.keys()


@pytest.mark.parametrize("level", LEVELS.values())
def test_every_observation_lies_in_its_space_and_is_of_its_type(level):
    env = lidarium.parallel_env("building:5", level=level, robots=3, noise="thesis", map_cells=64)
    generator = np.random.default_rng(0)
    observations, _ = env.reset(seed=3)
    for _ in range(40):
        for agent, observation in observations.items():
            assert env.observation_space(agent).contains(observation)
            for name, box in env.observation_space(agent).spaces.items():
                assert observation[name].dtype == box.dtype
                assert box.is_bounded() or name == "action_mask"
        if level == "frontier":
            actions = {
                agent: int(generator.choice(np.flatnonzero(observations[agent]["action_mask"]))) for agent in env.agents
            }
        else:
            actions = {agent: generator.uniform(-1.0, 1.0, 2).astype(np.float32) for agent in env.agents}
        observations = env.step(actions)[0]


@pytest.mark.parametrize("level", LEVELS.values())
def test_spaces_are_the_same_objects_at_each_call_and_metadata_is_complete(level):
    env = lidarium.parallel_env(level=level, robots=2)
    for agent in env.possible_agents:
        assert env.observation_space(agent) is env.observation_space(agent)
        assert env.action_space(agent) is env.action_space(agent)
    assert env.action_space("robot_0") is not env.action_space("robot_1")
    assert set(env.metadata) >= {"name", "render_modes", "render_fps", "is_parallelizable"}
    assert env.metadata["render_modes"] == ["human", "rgb_array"]
    assert env.metadata["render_fps"] == pytest.approx(10 if level == "velocity" else 0.5)


@pytest.mark.parametrize("level", LEVELS.values())
def test_pictures_follow_each_other_as_simulated_time_goes_alone_and_in_batches(level):
    options = {"robots": 1, "time_step": 0.05, "decision_period_s": 0.5}
    alone = lidarium.parallel_env(level=level, **options)
    batch = lidarium.vector_env(1, level=level, **options)
    for env in (alone, batch):
        assert env.metadata["render_fps"] == pytest.approx(20 if level == "velocity" else 2)
    assert type(batch).metadata["render_fps"] == 10


@pytest.mark.usefixtures("no_display")
def test_frames_are_images_that_change_as_robots_drive():
    env = lidarium.parallel_env("scene_room", robots=2, render_mode="rgb_array", map_cells=64)
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
    env = lidarium.parallel_env("scene_room", robots=1)
    env.reset(seed=0)
    assert env.render() is None
    with pytest.raises(RuntimeError, match="reset"):
        lidarium.parallel_env("scene_room", robots=1, render_mode="rgb_array").render()


@pytest.mark.parametrize("name", IDS)
def test_the_solo_form_is_the_parallel_one_with_one_robot(name):
    level = LEVELS[name.split("/")[1].removesuffix("-v1")]
    solo = gymnasium.make(name, floor="building:5", noise="datasheet", map_cells=64, disable_env_checker=True).unwrapped
    team = lidarium.parallel_env("building:5", level=level, robots=1, starts="drawn", noise="datasheet", map_cells=64)
    ours, _ = solo.reset(seed=3)
    theirs, _ = team.reset(seed=3)
    for _ in range(5):
        for key, value in ours.items():
            assert np.array_equal(value, theirs["robot_0"][key])
        action = 0 if level == "frontier" else np.array([0.3, 0.1], np.float32)
        ours, reward, terminated, truncated, info = solo.step(action)
        theirs, rewards, terminations, truncations, infos = team.step({"robot_0": action})
        assert (reward, terminated, truncated) == (
            rewards["robot_0"],
            terminations["robot_0"],
            truncations["robot_0"],
        )
        assert info.keys() == infos["robot_0"].keys()


def test_the_solo_form_has_one_robot_and_says_what_to_use_for_more():
    with pytest.raises(ValueError, match=r"lidarium\.parallel_env"):
        gymnasium.make("lidarium/Exploration-v1", robots=2)
    env = gymnasium.make("lidarium/Exploration-v1", horizon_s=0.1).unwrapped
    with pytest.raises(RuntimeError, match="reset"):
        env.step(np.zeros(2, np.float32))
    env.reset(seed=0)
    assert env.step(np.zeros(2, np.float32))[3]
    with pytest.raises(RuntimeError, match="over"):
        env.step(np.zeros(2, np.float32))


def test_random_actions_never_break_the_bounds_of_velocity_and_heading():
    env = lidarium.parallel_env("scene_corner", robots=2, map_cells=32, observe=["scan", "pose", "velocity"])
    env.reset(seed=0)
    generator = np.random.default_rng(1)
    for _ in range(300):
        observations = env.step({agent: generator.choice([-1.0, 1.0], 2).astype(np.float32) for agent in env.agents})[0]
        for observation in observations.values():
            assert abs(observation["velocity"][0]) <= np.float32(0.77)
            assert abs(observation["pose"][2]) <= math.pi + 1e-6


@needs_bullet
@pytest.mark.parametrize("level", LEVELS.values())
def test_the_apis_hold_in_pybullet(level, capsys):
    options = {"level": level, "robots": 2, "horizon_s": 3.0 if level == "velocity" else 20.0, **BULLET}
    parallel_api_test(lidarium.parallel_env(**options), num_cycles=20)
    parallel_seed_test(lambda: lidarium.parallel_env(noise="datasheet", **options), num_cycles=5)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Observation is not a NumPy array")
        warnings.filterwarnings("ignore", message="Observation space for each agent probably should be")
        api_test(lidarium.env(**options), num_cycles=20)
    assert capsys.readouterr().out.count("Passed") == 2


@needs_bullet
@pytest.mark.parametrize("name", IDS)
@pytest.mark.usefixtures("no_display")
def test_gymnasiums_checker_finds_nothing_in_pybullet(name):
    check_env(gymnasium.make(name, render_mode="rgb_array", **BULLET).unwrapped)


@needs_bullet
@pytest.mark.parametrize("level", LEVELS.values())
def test_batches_step_in_pybullet(level):
    batch = lidarium.vector_env(2, "building:5", level=level, robots=2, **BULLET)
    lone = lidarium.parallel_env("building:5", level=level, robots=2, **BULLET)
    observations, _ = batch.reset(seed=[4, 5])
    theirs, _ = lone.reset(seed=5)
    for _ in range(3):
        for row, agent in enumerate(lone.possible_agents, 2):
            assert all(np.array_equal(observations[key][row], theirs[agent][key]) for key in observations)
        action = 0 if level == "frontier" else np.array([0.4, 0.1], np.float32)
        observations, *_ = batch.step(np.stack([action] * 4))
        theirs, *_ = lone.step(dict.fromkeys(lone.agents, action))
    batch.close()
    lone.close()
