"""Agents end by rules or by reasons of their own, and stand from then on."""

import copy

import pytest
from linked_rooms import TWO_ROOMS

import lidarium
from lidarium.envs.agent_endings import AgentEndings
from lidarium.envs.onboard.meters import Meters
from lidarium.envs.onboard.radio.messages import OperatingState
from lidarium.envs.simulation.kernels.arrays import ENDED


def team(goal=None, **options):
    env = lidarium.parallel_env(TWO_ROOMS, **{"robots": 2, "stop_coverage": None, **options})
    env.reset(seed=0)
    meters = Meters(env.world, env.settings)
    endings = AgentEndings(env.simulation, env.settings, meters, env.operating)
    endings.start(goal)
    return endings, env, meters


def test_nobody_ends_before_a_rule_holds():
    endings, env, _ = team(horizon_s=5.0)
    assert endings.count() == 0
    assert endings.due(env.agents) == ({}, False)
    env.world.steps[0] = 50
    assert endings.count() == 2
    assert endings.due(env.agents) == ({}, True)


def test_a_goal_ends_the_robot_that_is_there():
    endings, env, _ = team(goal=(1.0, 2.0))
    assert endings.due(env.agents) == ({"robot_0": "reached"}, False)
    endings.start(None)
    assert endings.due(env.agents) == ({}, False)


def test_what_happens_to_a_robot_counts_before_its_own_reason():
    endings, env, _ = team(stop_on_contact=True)
    env.stop("robot_0", "no_frontier")
    env.stop("robot_1", "no_frontier")
    env.world.contacts[1] = 1
    assert endings.due(env.agents) == ({"robot_0": "no_frontier", "robot_1": "collision"}, False)
    assert not env.stopping
    env.stop("robot_0", "no_frontier")
    assert endings.due(["robot_1"])[0] == {"robot_1": "collision"}


@pytest.mark.parametrize(
    ("reason", "state", "is_off"),
    [
        ("reached", OperatingState.STOPPED, False),
        ("failed", OperatingState.FAILED, False),
        ("battery", OperatingState.STOPPED, True),
    ],
)
def test_who_has_ended_stands_and_has_no_further_reason(reason, state, is_off):
    endings, env, _ = team(goal=(1.0, 2.0))
    endings.end("robot_0", reason)
    assert env.world.moves.tolist() == [0, 1]
    assert [bool(flags & ENDED) for flags in env.world.flags] == [True, False]
    assert env.operating.states == [state, OperatingState.OPERATING]
    assert env.world.failed.tolist() == [is_off, 0]
    assert endings.count() == 0


def test_an_empty_battery_ends_a_robot():
    endings, env, meters = team(battery={"capacity_j": 100.0})
    assert endings.due(env.agents) == ({}, False)
    meters.used_j[1] = 100.0
    assert endings.due(env.agents) == ({"robot_1": "battery"}, False)


def test_a_copy_judges_its_own_world():
    endings, env, _ = team(horizon_s=5.0)
    assert endings.count() == 0
    other, world = copy.deepcopy((endings, env.world))
    world.steps[0] = 50
    assert other.count() == 2
    assert endings.count() == 0
