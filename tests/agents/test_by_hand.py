"""A person drives one robot, a policy the others."""

import numpy as np
import pytest
from scipy.ndimage import minimum_filter

import lidarium
from lidarium.agents.by_hand import ByHand
from lidarium.envs.onboard.radio.messages import Stop, Target

SETTINGS = {"level": "velocity", "horizon_s": 10.0, "resolution": 0.05, "stop_coverage": None}


def driven(policy, robots, **options):
    """Return an environment after a run, and the way of each robot [m]."""
    env = lidarium.parallel_env("apartment", robots=robots, **SETTINGS, **options)
    observations, _ = env.reset(seed=3)
    policy.reset(env, seed=3)
    while env.agents:
        observations = env.step(policy.act(observations))[0]
    return env, env.world.travelled.copy()


def test_the_other_robots_stand_still_without_a_policy():
    env, ways = driven(ByHand(lambda: np.array([1.0, 0.5], np.float32)), 2)
    assert ways[0] > 1.0
    assert ways[1] == 0.0
    assert env.time_s == pytest.approx(10.0)


def test_the_other_robots_are_driven_as_without_the_person():
    """With its robot where it stands, the others go where they would go beside a robot that stands."""
    policy = ByHand(lambda: np.zeros(2, np.float32), lidarium.policy("tour_frontier"))
    _, ways = driven(policy, 2)
    assert ways[0] == 0.0
    assert ways[1] > 1.0


def test_a_goal_is_driven_to_by_the_robots_own_driver():
    env = lidarium.parallel_env("apartment", robots=1, **SETTINGS)
    env.reset(seed=3)
    nearest = minimum_filter(env.simulation.ranges[0], 241)
    beam = int(np.argmax(nearest))
    heading = env.world.poses[0, 2] + env.settings.lidar.angles[beam]
    goal = env.world.poses[0, :2] + 0.5 * nearest[beam] * np.array([np.cos(heading), np.sin(heading)])
    env, _ = driven(ByHand(lambda: Target(*(goal - env.belief("robot_0").frame))), 1)
    assert np.hypot(*(env.world.poses[0, :2] - goal)) < 0.2 < 0.4 * nearest[beam]


def test_a_stop_ends_the_persons_robot():
    env, _ = driven(ByHand(lambda: Stop("ended by hand"), lidarium.policy("nearest_frontier")), 2)
    assert env.scorer.time == pytest.approx(10.0)
    assert env.scorer.ended_because["robot_0"] == "ended by hand"


def test_a_robot_that_is_not_there_is_refused():
    env = lidarium.parallel_env("apartment", robots=1, **SETTINGS)
    env.reset(seed=0)
    with pytest.raises(ValueError, match="there is no 'robot_7' to drive by hand; want one of robot_0"):
        ByHand(lambda: None, agent="robot_7").reset(env)


def test_others_that_decide_by_frontiers_are_refused():
    class ByFrontiers(lidarium.Policy):
        level = "frontier"

        def reset(self, team, seed=0):
            pass

        def act(self, observations):
            return dict.fromkeys(observations, 0)

    env = lidarium.parallel_env("apartment", robots=2, **SETTINGS)
    env.reset(seed=0)
    with pytest.raises(ValueError, match="want level='frontier'"):
        ByHand(lambda: None, ByFrontiers()).reset(env)
