"""Every row of a batch is the robot of a ``ParallelEnv`` with the same seed, to the bit, whatever the level and the threads."""

import numpy as np
import pytest

import lidarium
from lidarium.envs.batch.vector_env import ExplorationVectorEnv

SMALL = {"lidar": "lidar_360_6m", "map_cells": 64, "observe": ["scan", "pose", "velocity", "bumper", "map", "egocentric_map"]}


def draw_actions(generator, level, rows, observations):
    if level == "frontier":
        masks = observations["action_mask"]
        return np.array([generator.choice(np.flatnonzero(mask)) for mask in masks])
    if level == "velocity":
        return generator.uniform((0.2, -0.5), (1.0, 0.5), (rows, 2)).astype(np.float32)
    return generator.uniform(-1.0, 1.0, (rows, 2)).astype(np.float32)


class Alone:
    """The same episodes one by one, resetting as the batch does."""

    def __init__(self, episodes, floors, seed, level, options):
        self.envs = [lidarium.parallel_env(floor, level=level, **options) for floor in floors]
        self.seeds = [seed + episode for episode in range(episodes)]

    def reset(self):
        return [env.reset(seed=seed) for env, seed in zip(self.envs, self.seeds, strict=True)]

    def step(self, actions, robots):
        results = []
        for episode, env in enumerate(self.envs):
            if env.agents:
                rows = {agent: episode * robots + env.possible_agents.index(agent) for agent in env.agents}
                results.append(env.step({agent: actions[row] for agent, row in rows.items()}))
            else:
                results.append(env.reset())
        return results


def check_row(batch_observations, row, observation):
    assert set(batch_observations) == set(observation)
    for name, value in observation.items():
        assert np.array_equal(batch_observations[name][row], value), name


def compare(level, threads, steps, floors, robots=2, seed=11, **options):
    options = {**SMALL, **options, "robots": robots}
    episodes = len(floors)
    batch = ExplorationVectorEnv(episodes, floors[0], level, threads=threads, **options)
    alone = Alone(episodes, floors, seed, level, options)
    observations, infos = batch.reset(seed=seed, options={"floor": list(floors)})
    for episode, (alone_observations, alone_infos) in enumerate(alone.reset()):
        for robot, agent in enumerate(alone_observations):
            row = episode * robots + robot
            check_row(observations, row, alone_observations[agent])
            assert np.array_equal(infos["truth"]["pose"][row], alone_infos[agent]["truth"]["pose"])
    generator = np.random.default_rng(seed)
    ends = 0
    for _ in range(steps):
        actions = draw_actions(generator, level, episodes * robots, observations)
        last, was_over = observations, [not env.agents for env in alone.envs]
        if any(was_over) and len(set(floors)) > 1:
            # A batch begins again on the floor that it was made for.
            break
        observations, rewards, terminated, truncated, infos = batch.step(actions)
        for episode, result in enumerate(alone.step(actions, robots)):
            own = result[0]
            if was_over[episode]:
                for robot, agent in enumerate(own):
                    row = episode * robots + robot
                    check_row(observations, row, own[agent])
                    assert (rewards[row], bool(terminated[row]), bool(truncated[row])) == (0.0, False, False)
                    assert infos["active"][row]
                continue
            is_over = not alone.envs[episode].agents
            for robot, agent in enumerate(alone.envs[episode].possible_agents):
                row = episode * robots + robot
                if agent not in own:
                    assert not infos["active"][row]
                    assert rewards[row] == 0.0
                    assert (bool(terminated[row]), bool(truncated[row])) == (False, is_over)
                    check_row(observations, row, {name: array[row] for name, array in last.items()})
                    continue
                assert infos["active"][row]
                check_row(observations, row, own[agent])
                assert rewards[row] == result[1][agent]
                assert bool(terminated[row]) == result[2][agent]
                assert bool(truncated[row]) == result[3][agent]
                info = result[4][agent]
                for name, value in info["truth"].items():
                    assert np.array_equal(infos["truth"][name][row], value), name
                for name in set(info) - {"truth"}:
                    assert infos[name][row] == info[name], name
                for name in set(infos) - {"truth", "active"}:
                    if not name.startswith("_") and infos[f"_{name}"][row]:
                        assert name in info
                ends += result[2][agent] or result[3][agent]
    return ends


FLOORS = ("apartment", "building:3", "clinic", "building:17", "scene_room")


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("level", ["velocity", "waypoint", "frontier"])
def test_rows_of_a_batch_are_the_robots_of_parallel_environments(level, threads):
    compare(level, threads, 25, FLOORS)


@pytest.mark.parametrize("level", ["velocity", "frontier"])
def test_rows_are_the_same_with_noise_and_unknown_starts(level):
    compare(level, 2, 12, FLOORS[:4], noise="datasheet", known_starts=False, seed=3)


def test_rows_are_the_same_where_robots_collide_and_end_one_by_one():
    assert compare("velocity", 2, 80, ["apartment"] * 5, robots=3, stop_on_contact=True, seed=5) > 3


@pytest.mark.parametrize("level", ["velocity", "waypoint", "frontier"])
def test_rows_are_the_same_at_the_horizon(level):
    assert compare(level, 2, 40, ["apartment"] * 4, horizon_s=3.0, decision_period_s=0.5, seed=9) >= 8


def test_rows_are_the_same_when_all_is_covered():
    assert compare("frontier", 2, 40, ["apartment"] * 4, stop_coverage=0.6, seed=1) >= 8
