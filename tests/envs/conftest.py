"""How the rows of a batch are compared with the robots of parallel environments."""

import numpy as np
import pytest

import lidarium
from lidarium.envs.faces.vector_env import ExplorationVectorEnv

SMALL = {
    "lidar": "lidar_360_6m",
    "map_cells": 64,
    "observe": ["scan", "pose", "velocity", "bumper", "map", "egocentric_map"],
}


def draw_actions(generator, level, rows, observations):
    if level == "frontier":
        return np.array([generator.choice(np.flatnonzero(mask)) for mask in observations["action_mask"]])
    return generator.uniform(-1.0, 1.0, (rows, 2)).astype(np.float32)


class Alone:
    """The same episodes one by one: the first ones on floors of their own, the later ones on that of the
    batch."""

    def __init__(self, floors, level, options):
        self.floors = floors
        self.envs = [lidarium.parallel_env(floors[0], level=level, **options) for _ in floors]

    def reset(self, seed):
        return [
            env.reset(seed=seed + k, options={"floor": floor})
            for k, (env, floor) in enumerate(zip(self.envs, self.floors, strict=True))
        ]

    def step(self, actions):
        """What step, or reset where the episode is over, returns for each episode."""
        results, row = [], 0
        for env in self.envs:
            own = dict(zip(env.possible_agents, actions[row : row + len(env.possible_agents)], strict=True))
            results.append(env.step({agent: own[agent] for agent in env.agents}) if env.agents else env.reset())
            row += len(own)
        return results


def check_observation(observations, row, wanted):
    assert set(observations) == set(wanted)
    for name, value in wanted.items():
        assert np.array_equal(observations[name][row], value), name


def check_info(infos, row, wanted):
    for name, value in wanted["truth"].items():
        assert np.array_equal(infos["truth"][name][row], value), name
    told = {name for name in infos if not name.startswith("_") and infos[f"_{name}"][row]}
    assert told - {"active"} == set(wanted)
    assert {name: each[row] for name, each in infos["reward_terms"].items()} == wanted["reward_terms"]
    for name in set(wanted) - {"truth", "reward_terms"}:
        assert infos[name][row] == wanted[name], name


def compare_rows(level, threads, steps, floors, robots=2, seed=11, **options):
    """Step a batch and the same episodes one by one, assert that all they tell is equal, and return how
    many robots have ended."""
    options = {**SMALL, **options, "robots": robots}
    batch = ExplorationVectorEnv(len(floors), floors[0], level, threads=threads, **options)
    alone = Alone(floors, level, options)
    observations, infos = batch.reset(seed=seed, options={"floor": list(floors)})
    agents = batch.settings.agents
    for episode, (own, own_infos) in enumerate(alone.reset(seed)):
        for row, agent in enumerate(agents, episode * robots):
            check_observation(observations, row, own[agent])
            check_info(infos, row, own_infos[agent])
    generator = np.random.default_rng(seed)
    ends = 0
    for _ in range(steps):
        actions = draw_actions(generator, level, batch.num_envs, observations)
        last = observations
        observations, rewards, terminated, truncated, infos = batch.step(actions)
        for episode, result in enumerate(alone.step(actions)):
            is_over = not alone.envs[episode].agents
            own, own_infos = result[0], result[-1]
            gains, ended, cut = result[1:4] if len(result) == 5 else ({}, {}, {})
            for row, agent in enumerate(agents, episode * robots):
                assert bool(infos["active"][row]) == (agent in own)
                if agent in own:
                    check_observation(observations, row, own[agent])
                    check_info(infos, row, own_infos[agent])
                else:
                    check_observation(observations, row, {name: array[row] for name, array in last.items()})
                assert rewards[row] == gains.get(agent, 0.0)
                assert terminated[row] == ended.get(agent, False)
                assert truncated[row] == (cut[agent] if agent in own and cut else agent not in own and is_over)
                ends += int(terminated[row] or (truncated[row] and agent in own))
    return ends


@pytest.fixture(scope="session")
def compare():
    return compare_rows
