"""The choices of the frontier policies."""

import numpy as np
import pytest
from two_rooms import TWO_ROOMS, wall

import lidarium
from lidarium.agents.frontier.policies import ExploreLite, NearestFrontier, UtilityFrontier
from lidarium.envs.floors.floor import Floor
from lidarium.evaluation.episodes.runner import run_episode


def test_with_the_own_map_each_robot_sees_it_all_itself():
    env = lidarium.parallel_env(TWO_ROOMS, robots=2, horizon_s=None, stop_coverage=None, map_cells=32, starts="fixed")
    run_episode(lidarium.policy("nearest_frontier_own_map"), env, 1)
    shares = env.score.seen / env.score.counted[0]
    assert (shares >= 0.98).all()
    shared = lidarium.parallel_env(
        TWO_ROOMS, robots=2, horizon_s=None, stop_coverage=None, map_cells=32, starts="fixed"
    )
    run_episode(lidarium.policy("nearest_frontier"), shared, 1)
    assert shared.world.travelled.sum() < env.world.travelled.sum()


def test_the_team_shares_its_frontiers_out():
    """Two robots side by side between two corridors take one each."""
    solids = (wall(2.0, 1.0, 6.0, 2.0),)
    floor = Floor("two_ways", (0.0, 0.0, 10.0, 4.0), solids, starts=np.array([[0.6, 1.6, 0.0], [0.6, 2.4, 0.0]]))
    env = lidarium.parallel_env(floor, robots=2, horizon_s=14.0, stop_coverage=None, map_cells=32, starts="fixed")
    run_episode(UtilityFrontier(cost_weight=0.05), env, 1)
    y = env.world.poses[:, 1]
    assert sorted(y < 2.0) == [False, True]


@pytest.mark.parametrize("policy", [NearestFrontier, UtilityFrontier, ExploreLite])
def test_explorers_reconsider_nothing_of_an_earlier_episode(policy):
    explorer = policy()
    env = lidarium.parallel_env(TWO_ROOMS, robots=1, stop_coverage=None, map_cells=32, starts="fixed")
    first = run_episode(explorer, env, 1)
    given_up, place = list(first.given_up), env.world.poses.copy()
    second = run_episode(explorer, env, 1)
    assert second.given_up == given_up
    assert np.array_equal(env.world.poses, place)


def test_a_robot_in_a_sealed_room_has_no_frontier_and_ends_at_once():
    floor = Floor("cell", (0.0, 0.0, 1.5, 1.5), starts=np.array([[0.75, 0.75, 0.0]]))
    env = lidarium.parallel_env(floor, robots=1, lidar="lidar_360_6m", stop_coverage=None, map_cells=32, starts="fixed")
    episode = run_episode(NearestFrontier(), env, 1)
    assert env.scorer.ended_because["robot_0"] in ("no_frontier", "frontier_unreachable")
    assert env.scorer.time < 5.0
    if env.scorer.ended_because["robot_0"] == "frontier_unreachable":
        assert episode.given_up
