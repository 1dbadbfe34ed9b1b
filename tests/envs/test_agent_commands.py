"""Actions become speeds and turn rates of the robots."""

import numpy as np
import pytest
from linked_rooms import TWO_ROOMS

import lidarium
from lidarium.envs.agent_commands import AgentCommands
from lidarium.envs.onboard.radio.messages import Order, OrderKind

STILL = np.zeros(2)


def team(**options):
    env = lidarium.parallel_env(TWO_ROOMS, **{"robots": 2, **options})
    env.reset(seed=0)
    return AgentCommands(env.settings, env.operating), env


def test_an_action_is_shares_of_the_own_limits_of_each_robot():
    commands, env = team(robots=2, kinds=("kobuki", "pioneer"))
    taken = commands.take(env.agents, {"robot_0": np.array([0.5, -1.0]), "robot_1": [3, -0.25]})
    (speed, turn_rate), (other_speed, other_turn_rate) = env.settings.speed_limits
    assert speed != other_speed
    assert taken == pytest.approx(
        np.array([[0.5 * speed, -turn_rate], [other_speed, -0.25 * other_turn_rate]])
    )
    assert taken is commands.values


def test_a_robot_that_is_not_asked_for_stays_as_it_was():
    commands, _ = team()
    commands.values[1] = 0.0
    taken = commands.take(["robot_0"], {"robot_0": [1.0, 0.0]})
    assert taken[0, 0] > 0.0
    assert not taken[1].any()


def test_who_has_an_order_or_is_to_end_needs_no_action_and_stands():
    commands, env = team()
    commands.values[:] = 0.3
    with pytest.raises(ValueError, match="no action for robot_1"):
        commands.take(env.agents, {"robot_0": STILL})
    env.order("robot_1", Order(OrderKind.PAUSE))
    env.stop("robot_0", "no_frontier")
    assert not commands.take(env.agents, {}).any()


@pytest.mark.parametrize(
    ("action", "words"),
    [
        ([1.0], r"action of robot_1 is .*; want two numbers within \[-1, 1\]: shares of speed and turn rate"),
        (np.array([True, False]), "action of robot_1 is .*; want two numbers"),
        ("fast", "action of robot_1 is 'fast'; want two numbers"),
        ([np.nan, 0.0], "an action is nan or infinite .*; want two finite numbers"),
        (np.array([0.0, np.inf]), "an action is nan or infinite"),
    ],
)
def test_what_is_no_pair_of_finite_numbers_is_refused(action, words):
    commands, env = team()
    with pytest.raises(ValueError, match=words):
        commands.take(env.agents, {"robot_0": STILL, "robot_1": action})
