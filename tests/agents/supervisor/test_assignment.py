"""Who goes where: alone, by the least sum of costs, and best pair first."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from lidarium.agents.supervisor.assignment import assign_by_cost, assign_by_utility, best_goal

COSTS = np.array([[1.0, 2.0, 9.0], [1.5, 6.0, 9.0]])
NOTHING_SEEN = np.eye(3)


def test_one_robot_takes_what_is_worth_most_less_its_way():
    worth = np.array([1.0, 1.0, 1.0])
    assert best_goal(COSTS[0], worth, 0.05) == 0
    assert best_goal(COSTS[0], np.array([0.2, 1.0, 1.0]), 0.05) == 1
    assert best_goal(COSTS[0], np.array([-math.inf, 1.0, 1.0]), 0.0) == 1


def test_there_is_no_best_goal_where_none_is_in_reach_or_all_are_taken():
    assert best_goal(np.array([math.inf, math.inf]), np.ones(2), 0.05) == -1
    assert best_goal(np.ones(2), np.full(2, -math.inf), 0.05) == -1
    assert best_goal(np.zeros(0), np.zeros(0), 0.05) == -1


def test_by_cost_a_robot_leaves_its_nearest_goal_to_another_where_that_saves_more():
    assert assign_by_cost(COSTS).tolist() == [1, 0]


def test_by_utility_the_best_pair_goes_first_and_goals_that_it_sees_are_worth_less():
    assert assign_by_utility(COSTS, NOTHING_SEEN, np.ones(3), 0.05).tolist() == [0, 1]
    seen = np.array([[1.0, 0.9, 0.0], [0.9, 1.0, 0.0], [0.0, 0.0, 1.0]])
    assert assign_by_utility(COSTS, seen, np.ones(3), 0.05).tolist() == [0, 2]


def test_more_robots_than_goals_leave_some_without_and_no_way_is_no_goal():
    costs = np.array([[1.0], [2.0], [math.inf]])
    assert assign_by_cost(costs).tolist() == [0, -1, -1]
    assert assign_by_utility(costs, np.eye(1), np.ones(1), 0.05).tolist() == [0, -1, -1]
    assert assign_by_cost(np.full((2, 2), math.inf)).tolist() == [-1, -1]
    assert assign_by_cost(np.zeros((2, 0))).tolist() == [-1, -1]
    assert assign_by_utility(np.zeros((2, 0)), np.zeros((0, 0)), np.zeros(0), 0.05).tolist() == [-1, -1]


@given(st.integers(1, 5), st.integers(1, 5), st.integers(0, 1000))
def test_no_goal_is_given_twice_and_none_that_cannot_be_reached(robots, goals, seed):
    generator = np.random.default_rng(seed)
    costs = np.where(generator.random((robots, goals)) < 0.3, math.inf, generator.uniform(0.0, 20.0, (robots, goals)))
    seen = np.eye(goals)
    for given_goals in (assign_by_cost(costs), assign_by_utility(costs, seen, np.ones(goals), 0.05)):
        taken = [(robot, goal) for robot, goal in enumerate(given_goals) if goal >= 0]
        assert len({goal for _, goal in taken}) == len(taken)
        assert all(math.isfinite(costs[pair]) for pair in taken)
