"""One robot alone, as Gymnasium has it; ids, and what libraries ask of environments by name."""

import importlib
import math
import sys
import warnings

import gymnasium
import numpy as np
import pettingzoo
import pytest
from linked_rooms import TWO_ROOMS
from pettingzoo.test import max_cycles_test, performance_benchmark

import lidarium
from lidarium.envs.faces.gymnasium_env import SoloExploration
from lidarium.envs.onboard.radio.messages import Order, OrderKind

IDS = [f"lidarium/{name}Exploration-v1" for name in ("", "Waypoint", "Frontier")]
SMALL = {"map_cells": 32, "lidar": "lidar_360_6m", "stop_coverage": None}


def test_an_episode_ends_once_and_has_to_be_reset():
    env = SoloExploration(TWO_ROOMS, horizon_s=0.2, **SMALL, starts="fixed")
    with pytest.raises(RuntimeError, match=r"over or was not started; call reset\(\) before step\(\)"):
        env.step([0.0, 0.0])
    env.reset(seed=0)
    assert env.step([0.0, 0.0])[2:4] == (False, False)
    assert env.step([0.0, 0.0])[2:4] == (False, True)
    with pytest.raises(RuntimeError, match="call reset"):
        env.step([0.0, 0.0])
    env.reset()
    env.stop("bored")
    *_, terminated, truncated, info = env.step([0.0, 0.0])
    assert (terminated, truncated) == (True, False)
    assert info["ended_because"] == "bored"


def test_actions_of_frontiers_have_masks_and_others_have_none():
    env = SoloExploration(TWO_ROOMS, "frontier", observation="flat", **SMALL, starts="fixed")
    env.reset(seed=0)
    masks = env.action_masks()
    assert masks.dtype == np.bool_
    assert masks.shape == (env.action_space.n,)
    assert masks[-1]
    assert masks[0]
    with pytest.raises(AttributeError, match="use level='frontier'"):
        SoloExploration(TWO_ROOMS, "waypoint", **SMALL).action_masks()


def test_the_robot_takes_orders_and_is_drawn():
    env = SoloExploration(TWO_ROOMS, render_mode="rgb_array", time_step=0.05, **SMALL, starts="fixed")
    env.reset(seed=0)
    env.order(Order(OrderKind.PAUSE))
    assert env.step([1.0, 0.0])[4]["state"] == "paused"
    assert env.parallel.world.travelled[0] == 0.0
    assert env.render().shape[2] == 3
    assert env.metadata["render_fps"] == env.parallel.metadata["render_fps"] == pytest.approx(20)
    env.close()


def test_max_cycles_are_what_was_asked_for():
    max_cycles_test(lidarium)


def test_the_performance_benchmark_runs(monkeypatch, capsys):
    module, now = sys.modules["pettingzoo.test.performance_benchmark"], [0.0]

    class Clock:
        @staticmethod
        def time():
            now[0] += 0.05
            return now[0]

    monkeypatch.setattr(module, "time", Clock)
    performance_benchmark(lidarium.env(robots=2, horizon_s=3.0, map_cells=64, starts="fixed"))
    assert "cycles per second" in capsys.readouterr().out


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
    importlib.reload(lidarium)
    assert set(IDS) <= gymnasium.registry.keys()


@pytest.mark.parametrize("level", lidarium.registry("level"))
def test_agents_have_action_spaces_of_their_own_and_metadata_is_complete(level):
    env = lidarium.parallel_env(level=level, robots=2, starts="fixed")
    assert env.action_space("robot_0") is not env.action_space("robot_1")
    assert set(env.metadata) >= {"name", "render_modes", "render_fps", "is_parallelizable"}
    assert env.metadata["render_modes"] == ["human", "rgb_array"]
    assert env.metadata["render_fps"] == pytest.approx({"velocity": 10, "tour": 2}.get(level, 0.5))


def test_the_solo_form_has_one_robot_and_says_what_to_use_for_more():
    with pytest.raises(ValueError, match=r"lidarium\.parallel_env"):
        gymnasium.make("lidarium/Exploration-v1", robots=2)


def test_random_actions_never_break_the_bounds_of_velocity_and_heading():
    env = lidarium.parallel_env(
        "scene_corner", robots=2, map_cells=32, observe=["scan", "pose", "velocity"], starts="fixed"
    )
    env.reset(seed=0)
    generator = np.random.default_rng(1)
    for _ in range(300):
        observations = env.step({agent: generator.choice([-1.0, 1.0], 2).astype(np.float32) for agent in env.agents})[0]
        for observation in observations.values():
            assert abs(observation["velocity"][0]) <= np.float32(0.77)
            assert abs(observation["pose"][2]) <= math.pi + 1e-6


def test_gymnasium_plays_it_by_keys(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of pygame, about its own packages
        pygame = pytest.importorskip("pygame", reason="pygame is not installed: pip install pygame")
        from gymnasium.utils.play import play
    env = gymnasium.make("lidarium/Exploration-v1", render_mode="rgb_array", horizon_s=60.0, resolution=0.05)
    taken = []

    def press(before, after, action, *outcome):
        taken.append(np.array(action).tolist())
        event = {1: (pygame.KEYDOWN, "w"), 2: (pygame.KEYDOWN, "a"), 3: (pygame.KEYUP, "w")}.get(len(taken))
        if event is not None:
            pygame.event.post(pygame.event.Event(event[0], key=ord(event[1])))
        if len(taken) == 5:
            pygame.event.post(pygame.event.Event(pygame.QUIT))

    play(env, callback=press, seed=0, fps=1000, noop=np.zeros(2, np.float32))
    assert taken[0] == [0.0, 0.0]
    assert [1.0, 0.0] in taken
    assert [1.0, 0.5] in taken
    assert taken[-1] == [0.0, 0.5]
    with pytest.raises(AttributeError, match="want level='velocity'"):
        gymnasium.make("lidarium/FrontierExploration-v1").unwrapped.get_keys_to_action()
