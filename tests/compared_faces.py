"""Episodes of single environments, recorded, and the faces that are to return the same to the bit."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from gymnasium.vector.utils import concatenate, create_empty_array

import lidarium
from lidarium.envs.faces.merged_maps import MergedMaps
from lidarium.envs.faces.randomized import zeros_of

SMALL = {
    "lidar": "lidar_360_6m",
    "map_cells": 64,
    "observe": ["scan", "pose", "velocity", "bumper", "map", "egocentric_map"],
}


class Moment(NamedTuple):
    """What a reset or a step has returned, by agent; a reset has no rewards and ends."""

    observations: dict[str, Any]
    infos: dict[str, Any]
    rewards: dict[str, float]
    terminations: dict[str, bool]
    truncations: dict[str, bool]
    actions: dict[str, Any]  # by which it was reached
    state: np.ndarray
    is_over: bool


def assert_same(one, other, where=""):
    """Assert that values, or mappings of them, are equal to the bit and of one type of numbers."""
    if isinstance(one, Mapping):
        assert one.keys() == other.keys(), where
        for name in one:
            assert_same(one[name], other[name], f"{where}/{name}")
    elif isinstance(one, np.ndarray) and one.dtype != object:
        assert one.dtype == np.asarray(other).dtype, where
        assert np.array_equal(one, other), where
    else:
        assert np.all(one == other), where


def team_of(floor, level, merging=None, **options):
    """Make the environment of a team, with merged maps if they are asked for."""
    env = lidarium.parallel_env(floor, level=level, **{"starts": "fixed", **options})
    return env if merging is None else MergedMaps(env, merging)


def drawn_action(env, agent):
    """Draw an action, one that the mask allows if there is a mask."""
    space = env.action_space(agent)
    try:
        mask = env.unwrapped.action_masks(agent).astype(np.int8)
    except AttributeError:
        return space.sample()
    return space.sample(mask if space.shape is not None else {"action": mask, "message": None})


def recorded(env, seed, steps, options=None, before=None):
    """Reset an environment and step it by drawn actions; reset it again if the episode is over.

    ``before(step, team)`` is called before each step.
    """
    for k, agent in enumerate(env.possible_agents):
        env.action_space(agent).seed(seed + 1000 * k)
    outcome, actions, moments = env.reset(seed=seed, options=options), {}, []
    for step in range(steps + 1):
        results = outcome[1:4] if len(outcome) == 5 else ({}, {}, {})
        moments.append(Moment(outcome[0], outcome[-1], *results, actions, env.state(), not env.agents))
        if step == steps:
            break
        if env.agents:
            if before is not None:
                before(step, env)
            actions = {agent: drawn_action(env, agent) for agent in env.agents}
            outcome = env.step(actions)
        else:
            actions, outcome = {}, env.reset()
    return moments


def actions_of_rows(space, moments, agents):
    """Return the actions that lead to a moment of each episode; those of rows that do not act are drawn."""
    chosen = [moment.actions.get(agent, space.sample()) for moment in moments for agent in agents]
    return concatenate(space, chosen, create_empty_array(space, len(chosen), fn=np.zeros))


def of_row(values, row):
    """Return the entry of a row, of mappings one of each."""
    return {name: of_row(each, row) for name, each in values.items()} if isinstance(values, Mapping) else values[row]


def info_of_row(infos, row):
    """Return the infos that a row has by its masks."""
    return {
        name: of_row(each, row) for name, each in infos.items() if not name.startswith("_") and infos[f"_{name}"][row]
    }


def without_forms(info):
    """Return an info without the parts whose form depends on the face: `is_active`, and calibrations in arrays."""
    return {name: value for name, value in info.items() if name not in ("active", "camera")}


def is_active(moment, agent):
    """Return whether a robot had not ended before a moment; None if infos do not tell."""
    if agent not in moment.infos:
        return False
    info = moment.infos[agent]
    return bool(info.get("active", True)) if {"truth", "truth.coverage", "active"} & info.keys() else None


def assert_rows(batch, episodes, seed, options=None, before=None):
    """Assert that the rows of a batch are the robots of recorded episodes; return how many robots have ended.

    ``before(episode, step, team)`` is called before each step for each episode.
    """
    agents, last = batch.settings.agents, None
    ends = 0
    for step, moments in enumerate(zip(*episodes, strict=True)):
        if not step:
            outcome = batch.reset(seed=seed, options=options)
        else:
            for episode in range(len(episodes)) if before is not None else ():
                before(episode, step - 1, batch.team(episode))
            outcome = batch.step(actions_of_rows(batch.single_action_space, moments, agents))
        observations, infos = outcome[0], outcome[-1]
        assert batch.observation_space.contains(observations)
        nothing = np.zeros(batch.num_envs), *np.zeros((2, batch.num_envs), bool)
        rewards, terminated, truncated = outcome[1:4] if step else nothing
        assert (rewards.dtype, terminated.dtype, truncated.dtype) == (np.float64, bool, bool)
        states = batch.state()
        for episode, moment in enumerate(moments):
            assert_same(states[episode], moment.state)
            for row, agent in enumerate(agents, episode * len(agents)):
                own, is_there = of_row(observations, row), agent in moment.observations
                assert infos["_active"][row]
                assert is_active(moment, agent) in (None, infos["active"][row])
                if is_there:
                    assert_same(own, moment.observations[agent], agent)
                    wanted = moment.infos[agent]
                    assert_same(without_forms(info_of_row(infos, row)), without_forms(wanted), agent)
                else:
                    assert_same(own, of_row(last, row) if moment.rewards else zeros_of(batch.single_observation_space))
                assert rewards[row] == moment.rewards.get(agent, 0.0)
                assert terminated[row] == moment.terminations.get(agent, False)
                assert truncated[row] == moment.truncations.get(agent, moment.is_over)
                ends += int(is_there and (terminated[row] or truncated[row]))
        last = observations
    return ends


def compare_rows(level, threads, steps, floors, robots=2, seed=11, before=None, **options):
    """Step a batch and the same episodes one by one, assert that all that they return is equal, and return how many
    robots have ended; ``before(episode, step, team)`` is called before each step for each episode."""
    options = {**SMALL, **options, "robots": robots}
    episodes = []
    for episode, floor in enumerate(floors):
        own = None if before is None else lambda step, team, episode=episode: before(episode, step, team)
        env = team_of(floors[0], level, **options)
        episodes.append(recorded(env, seed + episode, steps, {"floor": floor}, own))
        env.close()
    batch = lidarium.vector_env(len(floors), floors[0], level=level, threads=threads, **{"starts": "fixed", **options})
    ends = assert_rows(batch, episodes, seed, {"floor": list(floors)}, before)
    batch.close()
    return ends
