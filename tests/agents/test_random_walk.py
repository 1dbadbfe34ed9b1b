"""The random walk keeps clear of walls and turns by angles of its own seed."""

import math

import numpy as np
import pytest
from all_observed import ALL

import lidarium
from lidarium.agents.random_walk import RandomWalk
from lidarium.evaluation.episodes.runner import run_episode


@pytest.mark.parametrize("floor", ["scene_loop", "building:5"])
@pytest.mark.parametrize("lidar", ["urg", "lidar_360_6m"])
def test_it_drives_on_and_on_without_getting_stuck(floor, lidar):
    env = lidarium.parallel_env(
        floor, robots=2, lidar=lidar, horizon_s=90.0, stop_coverage=None, map_cells=32, observe=ALL, starts="fixed"
    )
    run_episode(RandomWalk(), env, 3)
    assert (env.world.travelled > 4.0).all()
    assert env.scorer.coverage > 0.1


def test_it_turns_away_where_something_is_near_ahead():
    env = lidarium.parallel_env("scene_room", robots=1, map_cells=32, observe=ALL, starts="fixed")
    walk = RandomWalk()
    headings = []

    class Team:
        agents = ("robot_0",)

        @staticmethod
        def belief(agent):
            return env.belief(agent)

    env.reset(seed=0)
    walk.reset(Team(), 0)
    observation = {
        "scan": np.full(727, 0.4, np.float32),
        "pose": np.zeros(3, np.float32),
        "bumper": np.zeros(3, np.int8),
    }
    for _ in range(20):
        walk.reset(Team(), len(headings))
        action = walk.act({"robot_0": observation})["robot_0"]
        assert action[0] == 0.0
        headings.append(walk._headings["robot_0"])
    sizes = np.abs(headings)
    assert sizes.min() >= math.pi / 3
    assert sizes.max() <= math.pi
    assert len(set(headings)) == 20
    assert min(headings) < 0.0 < max(headings)


def test_it_drives_straight_on_in_the_open():
    env = lidarium.parallel_env("scene_room", robots=1, map_cells=32, observe=ALL, starts="fixed")
    env.reset(seed=0)

    class Team:
        agents = ("robot_0",)

        @staticmethod
        def belief(agent):
            return env.belief(agent)

    walk = RandomWalk(speed=0.6)
    walk.reset(Team(), 1)
    observation = {
        "scan": np.full(727, 4.0, np.float32),
        "pose": np.zeros(3, np.float32),
        "bumper": np.zeros(3, np.int8),
    }
    assert walk.act({"robot_0": observation})["robot_0"].tolist() == pytest.approx([0.6, 0.0])


@pytest.mark.parametrize("speed", [0.0, -0.1, 1.5, math.nan])
def test_a_speed_that_is_no_share_is_refused(speed):
    with pytest.raises(ValueError, match="speed"):
        RandomWalk(speed=speed)
