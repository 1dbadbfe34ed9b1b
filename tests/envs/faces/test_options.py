"""What environments answer to requests that cannot be meant: the thing, its value, and the cure."""

import gymnasium
import numpy as np
import pytest

import lidarium

LEVELS = ("velocity", "waypoint", "frontier")
SMALL = {"robots": 2, "map_cells": 64, "lidar": "lidar_360_6m"}


@pytest.fixture(scope="module")
def teams():
    envs = {level: lidarium.parallel_env("scene_room", level=level, **SMALL) for level in LEVELS}
    for env in envs.values():
        env.reset(seed=0)
    return envs


@pytest.mark.parametrize("level", LEVELS)
def test_a_list_in_place_of_actions_by_agent_is_refused(teams, level):
    with pytest.raises(ValueError, match="actions are a list; want a dict with an action for each agent"):
        teams[level].step([0, 0])


@pytest.mark.parametrize("level", LEVELS)
def test_an_unknown_agent_is_named_with_the_nearest(teams, level):
    env = teams[level]
    actions = {agent: env.action_space(agent).sample() for agent in ("robot_0", "robot_1")}
    with pytest.raises(ValueError, match=r"unknown agent 'robot_9'; did you mean 'robot_.'"):
        env.step({**actions, "robot_9": actions["robot_0"]})


def test_the_action_of_an_agent_that_has_ended_is_no_error():
    env = lidarium.parallel_env("scene_room", **SMALL)
    env.reset(seed=0)
    env.stop("robot_0", "enough")
    stay = np.zeros(2, np.float32)
    env.step({"robot_0": stay, "robot_1": stay})
    assert env.agents == ["robot_1"]
    observations, *_ = env.step({"robot_0": stay, "robot_1": stay})
    assert set(observations) == {"robot_1"}


@pytest.mark.parametrize(
    "action", [1.7, np.float32(0.5), [0, 1], np.zeros((2, 1)), "0", -1, 99, float("nan"), [[1], [1, 2]]]
)
def test_what_is_no_number_of_a_frontier_is_refused(teams, action):
    with pytest.raises(ValueError, match=r"action of robot_0 is .*; want a frontier from 0 to \d+, or \d+"):
        teams["frontier"].step({"robot_0": action, "robot_1": 0})


@pytest.mark.parametrize("action", [0, np.int64(0), np.array(0), np.array([0]), 0.0])
def test_a_number_of_a_frontier_is_taken_in_each_form(teams, action):
    teams["frontier"].step({"robot_0": action, "robot_1": action})


@pytest.mark.parametrize("level", ["velocity", "waypoint"])
@pytest.mark.parametrize("action", ["left", 0.5, [0.1, 0.2, 0.3], {"speed": 1}, [[0.1], [0.1, 0.2]]])
def test_what_is_not_two_numbers_is_refused_by_the_agents_name(teams, level, action):
    with pytest.raises(ValueError, match=r"of robot_0 is .*; want two"):
        teams[level].step({"robot_0": action, "robot_1": np.zeros(2)})


@pytest.mark.parametrize("seed", [-1, "a", 1.5, True])
def test_bad_seeds_are_refused_alike_by_every_environment(seed):
    floor, wanted = "scene_room", "want a whole number of zero or more"
    with pytest.raises(ValueError, match=wanted):
        lidarium.parallel_env(floor).reset(seed=seed)
    with pytest.raises(ValueError, match=wanted):
        gymnasium.make("lidarium/Exploration-v1", floor=floor).unwrapped.reset(seed=seed)
    with pytest.raises(ValueError, match=wanted):
        lidarium.vector_env(1, floor).reset(seed=seed)


def test_options_that_are_no_mapping_are_refused():
    with pytest.raises(ValueError, match=r"options of reset are .*; want a dict of any of floor, starts, goal"):
        lidarium.parallel_env("scene_room").reset(options=["floor"])
    with pytest.raises(ValueError, match="options of reset are"):
        lidarium.vector_env(1, "scene_room").reset(options=["floor"])


@pytest.mark.parametrize(("name", "meant"), [("start", "starts"), ("floors", "floor"), ("goals", "goal")])
def test_reset_options_that_are_nearly_known_are_named(name, meant):
    with pytest.raises(ValueError, match=f"unknown reset option '{name}'; did you mean '{meant}'"):
        lidarium.parallel_env("scene_room").reset(options={name: None})
    with pytest.raises(ValueError, match=f"unknown reset option '{name}'; did you mean '{meant}'"):
        lidarium.vector_env(2, "scene_room").reset(options={name: None})


def test_other_unknown_reset_options_are_ignored():
    lidarium.parallel_env("scene_room").reset(seed=0, options={"options": 1, "curriculum": 3, 7: None})


def test_settings_that_are_nearly_known_are_named():
    with pytest.raises(TypeError, match="unknown option 'horizon'; did you mean 'horizon_s'"):
        lidarium.parallel_env(horizon=3)


def test_two_horizons_are_refused():
    with pytest.raises(ValueError, match=r"max_cycles is 30 and horizon_s is 3\.0; want one of them"):
        lidarium.parallel_env(max_cycles=30, horizon_s=3.0)
