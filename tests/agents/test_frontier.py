"""The frontier explorers: what they choose, what they give up and that they name it."""

import math

import numpy as np
import pytest

import lidarium
from lidarium.agents.frontier_policies import ExploreLite, NearestFrontier, UtilityFrontier
from lidarium.envs.floors.floor import Floor, Solid
from lidarium.evaluation.episodes.runner import run_episode


def wall(x, y, width, height):
    return Solid(np.array([[x, y], [x + width, y], [x + width, y + height], [x, y + height]]))


TWO_ROOMS = Floor(
    "two_rooms",
    (0.0, 0.0, 7.0, 4.5),
    (wall(3.4, 0.0, 0.2, 1.6), wall(3.4, 2.6, 0.2, 1.9), wall(5.0, 2.0, 0.6, 0.6)),
    starts=np.array([[1.0, 1.0, 0.5], [1.0, 3.0, -0.5]]),
)
NAMES = (
    "nearest_frontier",
    "nearest_frontier_own_map",
    "utility_frontier",
    "explore_lite",
    "tour_frontier",
)


def with_a_crack(crack):
    """Two rooms with a crack in the wall between: light enough to see through, too narrow to pass."""
    return Floor(
        "crack",
        (0.0, 0.0, 6.0, 4.0),
        (wall(3.0, 0.0, 0.2, 2.0), wall(3.0, 2.0 + crack, 0.2, 2.0 - crack)),
        starts=np.array([[1.0, 2.0, 0.0], [1.0, 3.0, 0.0]]),
    )


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("robots", [1, 2])
def test_an_unreachable_room_is_named_and_does_not_count(name, robots):
    env = lidarium.parallel_env(
        with_a_crack(0.2), robots=robots, horizon_s=None, stop_coverage=None, map_cells=32
    )
    episode = run_episode(lidarium.policy(name), env, 1)
    assert env.scorer.coverage == 1.0
    assert set(env.scorer.ended_because.values()) <= {"no_frontier", "frontier_unreachable"}
    assert "frontier_unreachable" in env.scorer.ended_because.values()
    assert env.world.collisions.sum() == 0
    offset = env.perception.poses.offset(0)
    beyond = [entry for entry in episode.given_up if entry.agent == "robot_0" and entry.x + offset[0] > 3.0]
    assert beyond
    assert all(
        entry.reason in ("unseen", "hidden", "narrow", "blocked", "no_progress") and entry.size_m > 0.0
        for entry in episode.given_up
    )


@pytest.mark.parametrize("name", NAMES)
def test_a_door_that_just_fits_is_driven_through(name):
    env = lidarium.parallel_env(with_a_crack(0.5), robots=1, horizon_s=None, stop_coverage=None, map_cells=32)
    run_episode(lidarium.policy(name), env, 1)
    assert env.scorer.coverage == 1.0
    assert env.world.poses[0, 0] > 3.2 or env.world.travelled[0] > 2.5
    assert env.world.collisions.sum() == 0


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("noise", ["datasheet", "thesis"])
def test_a_noisy_laser_still_ends_with_nearly_all_seen(name, noise):
    env = lidarium.parallel_env(TWO_ROOMS, robots=2, noise=noise, horizon_s=300.0, map_cells=32)
    run_episode(lidarium.policy(name), env, 1)
    assert env.scorer.coverage >= 0.95


@pytest.mark.parametrize("name", NAMES)
def test_unknown_starts_mean_that_each_robot_explores_alone(name):
    env = lidarium.parallel_env(TWO_ROOMS, robots=2, known_starts=False, horizon_s=300.0, map_cells=32)
    run_episode(lidarium.policy(name), env, 1)
    assert env.scorer.coverage >= 0.99 or set(env.scorer.ended_because.values()) <= {
        "no_frontier",
        "frontier_unreachable",
    }


def test_with_the_own_map_each_robot_sees_it_all_itself():
    env = lidarium.parallel_env(TWO_ROOMS, robots=2, horizon_s=None, stop_coverage=None, map_cells=32)
    run_episode(lidarium.policy("nearest_frontier_own_map"), env, 1)
    shares = env.score.seen / env.score.counted[0]
    assert (shares >= 0.98).all()
    shared = lidarium.parallel_env(TWO_ROOMS, robots=2, horizon_s=None, stop_coverage=None, map_cells=32)
    run_episode(lidarium.policy("nearest_frontier"), shared, 1)
    assert shared.world.travelled.sum() < env.world.travelled.sum()


def test_the_team_shares_its_frontiers_out():
    """Two robots side by side between two corridors take one each."""
    solids = (wall(2.0, 1.0, 6.0, 2.0),)
    floor = Floor(
        "two_ways", (0.0, 0.0, 10.0, 4.0), solids, starts=np.array([[0.6, 1.6, 0.0], [0.6, 2.4, 0.0]])
    )
    env = lidarium.parallel_env(floor, robots=2, horizon_s=14.0, stop_coverage=None, map_cells=32)
    run_episode(UtilityFrontier(cost_weight=0.05), env, 1)
    y = env.world.poses[:, 1]
    assert sorted(y < 2.0) == [False, True]


def test_policies_read_beliefs_and_never_the_truth():
    """With noise in the map, what a policy may ask for is the believed pose and the noisy map."""
    env = lidarium.parallel_env(TWO_ROOMS, robots=2, noise="thesis", map_cells=32)
    env.reset(seed=0)
    belief = env.belief("robot_0")
    public = {name for name in dir(belief) if not name.startswith("_")}
    assert public == {
        "pose",
        "velocity",
        "spread",
        "radius",
        "robot",
        "lidar",
        "map",
        "map_origin",
        "shared_map",
        "sparse_map",
        "shared_sparse_map",
        "teammates",
        "energy_left_j",
        "goal",
    }


@pytest.mark.parametrize("policy", [NearestFrontier, UtilityFrontier, ExploreLite])
def test_explorers_reconsider_nothing_of_an_earlier_episode(policy):
    explorer = policy()
    env = lidarium.parallel_env(TWO_ROOMS, robots=1, stop_coverage=None, map_cells=32)
    first = run_episode(explorer, env, 1)
    given_up, place = list(first.given_up), env.world.poses.copy()
    second = run_episode(explorer, env, 1)
    assert second.given_up == given_up
    assert np.array_equal(env.world.poses, place)


def test_a_robot_in_a_sealed_room_has_no_frontier_and_ends_at_once():
    floor = Floor("cell", (0.0, 0.0, 1.5, 1.5), starts=np.array([[0.75, 0.75, 0.0]]))
    env = lidarium.parallel_env(floor, robots=1, lidar="lidar_360_6m", stop_coverage=None, map_cells=32)
    episode = run_episode(NearestFrontier(), env, 1)
    assert env.scorer.ended_because["robot_0"] in ("no_frontier", "frontier_unreachable")
    assert env.scorer.time < 5.0
    if env.scorer.ended_because["robot_0"] == "frontier_unreachable":
        assert episode.given_up


def test_names_of_what_was_given_up_lie_on_the_floor_in_the_robots_frame():
    env = lidarium.parallel_env("apartment", robots=1, horizon_s=None, stop_coverage=None, map_cells=32)
    episode = run_episode(NearestFrontier(), env, 1)
    x_min, y_min, x_max, y_max = env.floor.bounds
    for entry in episode.given_up:
        x, y = np.array([entry.x, entry.y]) + env.perception.poses.offset(0)
        assert x_min - 0.2 <= x <= x_max + 0.2
        assert y_min - 0.2 <= y <= y_max + 0.2
        assert math.isfinite(entry.size_m)
