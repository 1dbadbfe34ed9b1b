"""Actions are checked in the same words at all levels."""

import math

import numpy as np
import pytest

from lidarium.envs.agent_actions import check_agents, missing_action, numbers_of, whole_number

AGENTS = ("robot_0", "robot_1")


def test_actions_are_given_by_agents_that_there_are():
    check_agents({"robot_0": 1}, AGENTS)
    check_agents({}, AGENTS)
    with pytest.raises(ValueError, match="actions are a list; want a dict with an action for each agent"):
        check_agents([1, 2], AGENTS)
    with pytest.raises(ValueError, match="unknown agent 'robot_2'"):
        check_agents({"robot_2": 1}, AGENTS)
    assert "no action for robot_1" in str(missing_action("robot_1"))


@pytest.mark.parametrize("action", [0, 3, np.int64(3), 2.0, np.array([1]), np.array(1.0, np.float32)])
def test_a_whole_number_is_taken_in_any_form(action):
    assert whole_number(action, 3) == int(np.asarray(action).item())


@pytest.mark.parametrize(
    "action", [-1, 4, 1.5, math.nan, math.inf, True, "1", None, [1, 2], [[1], [2, 3]], np.array([[1]])]
)
def test_what_is_no_choice_is_none(action):
    assert whole_number(action, 3) is None


def test_what_is_no_array_of_numbers_is_empty():
    assert numbers_of([1, 2.5]).tolist() == [1.0, 2.5]
    assert numbers_of("fast").size == numbers_of([[1], [2, 3]]).size == numbers_of({}).size == 0
