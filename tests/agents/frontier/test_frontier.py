"""The frontier explorers: what they choose, what they give up and that they name it."""

import math

import numpy as np
import pytest
from two_rooms import TWO_ROOMS, wall

import lidarium
from lidarium.agents.frontier.policies import NearestFrontier
from lidarium.envs.floors.floor import Floor
from lidarium.evaluation.episodes.runner import run_episode

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
        with_a_crack(0.2), robots=robots, horizon_s=None, stop_coverage=None, map_cells=32, starts="fixed"
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
    env = lidarium.parallel_env(
        with_a_crack(0.5), robots=1, horizon_s=None, stop_coverage=None, map_cells=32, starts="fixed"
    )
    run_episode(lidarium.policy(name), env, 1)
    assert env.scorer.coverage == 1.0
    assert env.world.poses[0, 0] > 3.2 or env.world.travelled[0] > 2.5
    assert env.world.collisions.sum() == 0


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("noise", ["datasheet", "thesis"])
def test_a_noisy_laser_still_ends_with_nearly_all_seen(name, noise):
    env = lidarium.parallel_env(TWO_ROOMS, robots=2, noise=noise, horizon_s=300.0, map_cells=32, starts="fixed")
    run_episode(lidarium.policy(name), env, 1)
    assert env.scorer.coverage >= 0.95


@pytest.mark.parametrize("name", NAMES)
def test_unknown_starts_mean_that_each_robot_explores_alone(name):
    env = lidarium.parallel_env(TWO_ROOMS, robots=2, known_starts=False, horizon_s=300.0, map_cells=32, starts="fixed")
    run_episode(lidarium.policy(name), env, 1)
    assert env.scorer.coverage >= 0.99 or set(env.scorer.ended_because.values()) <= {
        "no_frontier",
        "frontier_unreachable",
    }


def test_policies_read_beliefs_and_never_the_truth():
    """With noise in the map, what a policy may ask for is the believed pose and the noisy map."""
    env = lidarium.parallel_env(TWO_ROOMS, robots=2, noise="thesis", map_cells=32, starts="fixed")
    env.reset(seed=0)
    belief = env.belief("robot_0")
    public = {name for name in dir(belief) if not name.startswith("_")}
    assert public == {
        "frame",
        "pose",
        "velocity",
        "spread",
        "radius",
        "robot",
        "lidar",
        "map",
        "map_origin",
        "predicted_map",
        "shared_map",
        "sparse_map",
        "shared_sparse_map",
        "teammates",
        "energy_left_j",
        "goal",
        "yielding",
    }


def test_names_of_what_was_given_up_lie_on_the_floor_in_the_robots_frame():
    env = lidarium.parallel_env("apartment", robots=1, horizon_s=None, stop_coverage=None, map_cells=32, starts="fixed")
    episode = run_episode(NearestFrontier(), env, 1)
    x_min, y_min, x_max, y_max = env.floor.bounds
    for entry in episode.given_up:
        x, y = np.array([entry.x, entry.y]) + env.perception.poses.offset(0)
        assert x_min - 0.2 <= x <= x_max + 0.2
        assert y_min - 0.2 <= y <= y_max + 0.2
        assert math.isfinite(entry.size_m)
