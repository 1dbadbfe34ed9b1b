"""One engine steps single environments and batches, and a batch does everything that a single environment does."""

import copy

import numpy as np
import pytest
from linked_rooms import TWO_ROOMS

import lidarium
from lidarium.envs.engine.engine import Engine
from lidarium.envs.settings.making import make_settings

SMALL = {"robots": 2, "map_cells": 32, "lidar": "lidar_360_6m", "stop_coverage": None, "observe": ["scan", "pose"]}


def both(level="velocity", episodes=3, **options):
    """A batch, and a single environment for each of its episodes."""
    options = {**SMALL, **options}
    batch = lidarium.vector_env(episodes, TWO_ROOMS, level=level, **options)
    alone = [lidarium.parallel_env(TWO_ROOMS, level=level, **options) for _ in range(episodes)]
    return batch, alone


def actions_of(level, generator, rows):
    if level == "frontier":
        return generator.integers(0, 3, rows)
    return generator.uniform(-0.2, 0.9, (rows, 2)).astype(np.float32)


def compared(batch, alone, level, steps=20, before_step=None):
    """Step both with the same actions, and check that they are the same; return the reasons of endings."""
    seen, _ = batch.reset(seed=3)
    observations = [env.reset(seed=3 + k)[0] for k, env in enumerate(alone)]
    generator, reasons = np.random.default_rng(1), []
    robots = batch.batch.robots
    for step in range(steps):
        if before_step is not None:
            before_step(step)
        actions = actions_of(level, generator, batch.num_envs)
        seen, rewards, terminated, truncated, infos = batch.step(actions)
        for k, env in enumerate(alone):
            if not env.agents:
                observations[k] = env.reset()[0]
                continue
            rows = {agent: k * robots + n for n, agent in enumerate(env.possible_agents)}
            live = list(env.agents)
            observations[k], earned, ended, cut, told = env.step({agent: actions[rows[agent]] for agent in live})
            for agent in live:
                row = rows[agent]
                assert all(np.array_equal(seen[name][row], value) for name, value in observations[k][agent].items())
                assert rewards[row] == earned[agent]
                assert terminated[row] == ended[agent]
                assert truncated[row] == cut[agent]
                assert infos["state"][row] == told[agent]["state"]
                assert infos["order"][row] == told[agent]["order"]
                if "energy_j" in told[agent]:
                    assert infos["energy_j"][row] == told[agent]["energy_j"]
                reasons.append(told[agent].get("ended_because"))
    return {reason for reason in reasons if reason}


def test_single_environments_and_batches_are_the_same_engine():
    env = lidarium.parallel_env(TWO_ROOMS, **SMALL)
    rows = lidarium.vector_env(1, TWO_ROOMS, **SMALL)
    assert type(env.engine) is type(rows.engine) is Engine
    assert env.engine.episodes == rows.engine.episodes == 1


@pytest.mark.parametrize("level", ["velocity", "waypoint", "frontier"])
def test_a_batch_empties_batteries_as_single_environments_do(level):
    batch, alone = both(level, battery={"capacity_j": 60.0})
    assert "battery" in compared(batch, alone, level, 80 if level == "velocity" else 12)


@pytest.mark.parametrize("level", ["velocity", "waypoint"])
def test_a_batch_pauses_robots_as_single_environments_do(level):
    batch, alone = both(level, pauses_when_blocked=True)
    compared(batch, alone, level, 60 if level == "velocity" else 10)
    if level == "velocity":
        ahead = np.tile(np.array([1.0, 0.0], np.float32), (batch.num_envs, 1))
        assert any("paused" in batch.step(ahead)[4]["state"] for _ in range(200))


@pytest.mark.parametrize("radio", ["all", "line_of_sight"])
def test_a_batch_takes_orders_as_single_environments_do(radio):
    kinds = lidarium.OrderKind
    batch, alone = both("waypoint", radio=radio)
    orders = {
        1: lidarium.Order(kinds.GO_TO, lidarium.Target(0.5, 0.2), "test"),
        3: lidarium.Order(kinds.PAUSE, None, "test"),
        5: lidarium.Order(kinds.RESUME, None, "test"),
        7: lidarium.Order(kinds.STOP, None, "enough"),
    }

    def order(step):
        if step in orders:
            alone[1].order("robot_1", orders[step])
            batch.team(1).order("robot_1", orders[step])

    assert "enough" in compared(batch, alone, "waypoint", 10, order)


def test_a_batch_reports_to_stations_as_single_environments_do():
    batch, alone = both_with_reports()
    compared(batch, alone, "waypoint", 4)
    for k, env in enumerate(alone):
        for agent in env.possible_agents:
            ours, theirs = batch.team(k).report(agent), env.report(agent)
            assert ours.pose == theirs.pose
            assert ours.travelled_m == theirs.travelled_m
            assert np.array_equal(ours.map.levels, theirs.map.levels)
    with pytest.raises(ValueError, match="make it with reports=True"):
        lidarium.vector_env(1, TWO_ROOMS, **SMALL).team(0).report("robot_0")
    with pytest.raises(ValueError, match="episode is 7; want a number from 0 to 2"):
        batch.team(7)


def both_with_reports():
    options = {**SMALL, "localization": "odometry", "odometry": "typical", "radio": "line_of_sight"}
    batch = lidarium.vector_env(3, TWO_ROOMS, level="waypoint", reports=True, **options)
    return batch, [lidarium.parallel_env(TWO_ROOMS, level="waypoint", **options) for _ in range(3)]


@pytest.mark.parametrize("infos", ["full", "flat", "none"])
def test_a_batch_keeps_agents_that_have_ended(infos):
    batch, alone = both("velocity", 2, ended_agents="zeros", infos=infos, horizon_s=2.0)
    batch.reset(seed=0)
    for k, env in enumerate(alone):
        env.reset(seed=k)
    batch.team(0).stop("robot_1", "enough")
    alone[0].stop("robot_1", "enough")
    for _ in range(20):
        actions = np.full((4, 2), 0.2, np.float32)
        seen, rewards, terminated, truncated, told = batch.step(actions)
        for k, env in enumerate(alone):
            found = env.step(dict.fromkeys(env.agents, actions[0]))
            for n, agent in enumerate(env.possible_agents):
                row = 2 * k + n
                assert np.array_equal(seen["scan"][row], found[0][agent]["scan"])
                assert rewards[row] == found[1][agent]
                assert (terminated[row], truncated[row]) == (found[2][agent], found[3][agent])
                if infos == "full":
                    assert told["active"][row] == found[4][agent]["active"]
                if infos == "flat":
                    assert told["truth.pose.0"][row] == found[4][agent]["truth.pose.0"]
                    assert told["ended"][row] == found[4][agent]["ended"]
    assert terminated.tolist() == [False, True, False, False]
    assert truncated.tolist() == [True, False, True, True]


def test_step_by_step_comes_to_what_the_kernel_does():
    for level in ("velocity", "waypoint"):
        engines = [Engine(2, TWO_ROOMS, make_settings(**SMALL, noise="datasheet"), level) for _ in range(2)]
        actions = np.tile([0.4, 0.2], (4, 1))
        for engine in engines:
            engine.run(None, np.arange(2), [1, 2])
        for _ in range(6):
            for engine, hook in zip(engines, (None, lambda commands: None), strict=True):
                engine.run(engine.level.read_rows(actions, engine.live), after_step=hook)
            assert np.array_equal(engines[0].world.steps, engines[1].world.steps)
            assert np.array_equal(engines[0].world.poses, engines[1].world.poses)
            for name, array in engines[0].observations.items():
                assert np.array_equal(array, engines[1].observations[name]), name


def test_a_copy_goes_on_by_itself():
    env = lidarium.parallel_env(TWO_ROOMS, **SMALL)
    env.reset(seed=0)
    twin = copy.deepcopy(env)
    ahead = dict.fromkeys(env.agents, np.array([0.5, 0.1], np.float32))
    first = [env.step(ahead) for _ in range(3)][-1]
    second = [twin.step(ahead) for _ in range(3)][-1]
    assert first[1] == second[1]
    assert np.array_equal(env.world.poses, twin.world.poses)


def test_waypoints_of_a_batch_may_be_targets_in_an_array_of_objects():
    batch, alone = both("waypoint", 1)
    batch.reset(seed=0)
    alone[0].reset(seed=0)
    actions = np.array([lidarium.Target(0.6, 0.3), None], object)
    for _ in range(3):
        seen, *_ = batch.step(actions)
        wanted, *_ = alone[0].step({"robot_0": actions[0], "robot_1": None})
        assert np.array_equal(seen["pose"][0], wanted["robot_0"]["pose"])
    with pytest.raises(ValueError, match="waypoint of row 0 is"):
        batch.step(np.array(["there", None], object))
