"""Sparse frontier: robots see all ground with their cameras, and say what they leave unseen."""

import copy
import math

import numpy as np
import pytest

import lidarium
from lidarium.agents import PerRobot
from lidarium.agents.policy import settings_for
from lidarium.agents.sparse.frontier import BLOCKED_S, CLAIMED_M, OBSTACLE_S, PATIENCE_S, STUCK_S, SparseFrontier, _Work
from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.floors.free_space import reachable_free_space
from lidarium.envs.onboard.radio.messages import DriveState
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.suites.suite import Suite
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.sparse.exploring.views import View

SMALL = {"columns": 80, "rows": 60, "pitch": 0.35}


def block(x, y, width, depth, low=0.0, high=2.0):
    return Solid(np.array([[x, y], [x + width, y], [x + width, y + depth], [x, y + depth]]), low, high)


TWO_ROOMS = Floor(
    "two_rooms",
    (0.0, 0.0, 7.0, 4.5),
    (block(3.4, 0.0, 0.2, 1.6), block(3.4, 2.6, 0.2, 1.9), block(5.0, 2.0, 0.6, 0.6, 0.38, 0.42)),
    starts=np.array([[1.0, 1.0, 0.5], [1.0, 3.0, -0.5]]),
)


def made(floor=TWO_ROOMS, **options):
    chosen = {
        "robots": 1,
        "camera": SMALL,
        "observe": ["pose", "depth"],
        "resolution": 0.05,
        "horizon_s": 300.0,
        "stop_coverage": None,
        **options,
    }
    return lidarium.parallel_env(floor, **chosen, starts="fixed")


def explored(env, seed=0, **settings):
    policy = lidarium.policy("sparse_frontier", **settings)
    return run_episode(policy, env, seed=seed)


def seen_share(env):
    """Share of the floor's free cells, as bodies reach them, that the robots' cameras have seen."""
    tables = env.world.floors[0]
    free = reachable_free_space(tables.body, float(env.world.bodies[:, 0].min()), env.world.starts)
    rows, columns = np.nonzero(free & (tables.laser.solid == 0))
    places = (np.stack([columns, rows], axis=1) + 0.5) * tables.laser.resolution + tables.laser.origin
    seen = np.zeros(len(places), np.bool_)
    for row, agent in enumerate(env.possible_agents):
        frame = Transform(*env.perception.poses.offset(row))
        if not env.settings.known_starts:
            frame = Transform(*env.world.starts[row])
        seen |= ~env.belief(agent).sparse_map.are_unknown(frame.inverse().apply(places))
    return float(seen.mean())


ENDINGS = {"no_frontier", "frontier_unreachable"}


@pytest.mark.parametrize("backend", ["kinematic", "bullet"])
def test_both_rooms_are_seen_in_both_worlds(backend):
    if backend == "bullet":
        pytest.importorskip("pybullet", reason="the extra bullet is not installed")
    env = made(backend=backend)
    explored(env)
    assert seen_share(env) > 0.97
    assert set(env.scorer.ended_because.values()) <= ENDINGS
    assert env.world.collisions.sum() == 0
    assert env.world.poses[0, 0] > 3.6 or env.world.travelled[0] > 5.0
    env.close()


def test_robots_drive_round_a_table_that_their_lasers_do_not_see():
    env, trail = made(), []
    policy = lidarium.policy("sparse_frontier")
    run_episode(policy, env, 0, on_decision=lambda each: trail.append(each.world.poses[0, :2].copy()))
    gaps = np.maximum(np.maximum((5.0, 2.0) - np.array(trail), np.array(trail) - (5.6, 2.6)), 0.0)
    assert np.hypot(*gaps.T).min() > env.settings.robot.radius
    boxes = env.perception.sparse_maps.of(0).map.boxes
    assert ((boxes[:, 0, :2] > (4.9, 1.9)).all(axis=1) & (boxes[:, 1, :2] < (5.7, 2.7)).all(axis=1)).any()


def test_the_same_seed_gives_the_same_run_to_the_bit():
    ends = []
    for _ in range(2):
        env = made(realism="lab", robots=2, horizon_s=20.0)
        episode = explored(env, seed=3)
        ends.append((env.world.poses.copy(), env.beliefs.believed.copy(), episode.given_up))
    assert np.array_equal(ends[0][0], ends[1][0])
    assert np.array_equal(ends[0][1], ends[1][1])
    assert ends[0][2] == ends[1][2]


def test_an_environment_and_a_policy_are_used_again_as_if_new():
    env, policy = made(horizon_s=15.0), lidarium.policy("sparse_frontier")
    ends = []
    for _ in range(2):
        run_episode(policy, env, seed=1)
        ends.append(env.world.poses.copy())
    assert np.array_equal(ends[0], ends[1])


@pytest.mark.parametrize("known_starts", [True, False])
def test_robots_that_localize_by_slam_see_both_rooms(known_starts):
    env = made(robots=2, realism="lab", known_starts=known_starts)
    explored(env)
    assert seen_share(env) > 0.95
    assert set(env.scorer.ended_because.values()) <= ENDINGS
    assert env.world.collisions.sum() == 0


def test_an_apartment_is_explored_by_slam():
    env = made("apartment", realism="lab", horizon_s=65.0)
    explored(env)
    assert seen_share(env) > 0.7
    assert env.perception.sparse_maps.of(0).corrections > 0
    assert env.world.collisions.sum() == 0


def test_more_robots_see_more_and_share_what_they_have_seen():
    alone = made("apartment", horizon_s=20.0)
    team = made("apartment", robots=3, horizon_s=20.0)
    apart = made("apartment", robots=3, horizon_s=20.0)
    explored(alone)
    explored(team)
    explored(apart, shares_map=False)
    assert seen_share(team) > 1.3 * seen_share(alone)
    assert seen_share(team) > seen_share(apart)
    assert team.world.collisions.sum() == 0


def test_a_decentralised_team_explores_as_well():
    env = made(robots=2)
    run_episode(PerRobot(lambda: lidarium.policy("sparse_frontier")), env, seed=0)
    assert seen_share(env) > 0.97


def test_a_room_behind_a_crack_is_named_and_not_driven_to():
    crack = Floor(
        "crack",
        (0.0, 0.0, 6.0, 4.0),
        (block(3.0, 0.0, 0.2, 2.0), block(3.0, 2.3, 0.2, 1.7)),
        starts=np.array([[1.0, 2.0, 0.0]]),
    )
    env = made(crack, resolution=0.025)
    episode = explored(env)
    assert env.scorer.ended_because == {"robot_0": "frontier_unreachable"}
    beyond = [entry for entry in episode.given_up if entry.x + env.perception.poses.offset(0)[0] > 3.1]
    assert beyond
    assert {entry.reason for entry in episode.given_up} <= {"unseen", "hidden", "blocked", "no_progress"}
    assert all(entry.size_m > 0.0 for entry in episode.given_up)
    assert env.world.poses[0, 0] < 3.0


def test_a_robot_that_faces_a_wall_looks_around_first():
    facing = Floor("facing", (0.0, 0.0, 6.0, 4.0), (block(1.4, 1.0, 0.2, 2.0),), starts=np.array([[1.0, 2.0, 0.0]]))
    env = made(facing)
    explored(env)
    assert seen_share(env) > 0.97


# -- Recovery ---------------------------------------------------------------------------------------------


def started(env):
    """A policy that has begun an episode, and what its robots observe."""
    env.use_level("waypoint")
    policy = SparseFrontier()
    observations, _ = env.reset(seed=0)
    policy.reset(env, 0)
    return env, policy, observations


def test_what_stands_in_the_way_for_now_is_driven_round_and_forgotten():
    level, policy, observations = started(made())
    for _ in range(8):
        observations = level.step(policy.act(observations))[0]
    work = policy._work["robot_0"]
    place = level.unwrapped.belief("robot_0").pose[:2]
    work.obstacles.append((policy.team.time_s + 5.0, place))
    blocked, free = policy._known_now("robot_0"), policy._known("robot_0")
    through = np.array([place - np.array([0.8, 0.0]), place + np.array([0.8, 0.0])])
    assert free.is_free(through)
    assert not blocked.is_free(through)
    end_s = policy.team.time_s + 5.0
    while policy.team.time_s <= end_s:
        observations = level.step(policy.act(observations))[0]
    policy.act(observations)
    assert not work.obstacles


def test_a_robot_that_does_not_get_on_takes_something_to_stand_there_and_then_gives_up():
    env = made()
    level, policy, observations = started(env)
    while policy._work["robot_0"].view is None or policy._work["robot_0"].view.cost < 0.9:
        observations = level.step(policy.act(observations))[0]
    # From now on the wheels are stuck.
    move = env.engine._step
    env.engine._step = lambda commands, **options: move(np.zeros_like(commands), **options)
    stuck, obstacles = policy.team.time_s, 0
    while not any(entry.reason == "no_progress" for entry in policy.given_up):
        assert policy.team.time_s < stuck + 1.5 * PATIENCE_S
        observations = level.step(policy.act(observations))[0]
        obstacles = max(obstacles, len(policy._work["robot_0"].obstacles))
    assert obstacles > 0
    assert policy.team.time_s > stuck + 0.5 * PATIENCE_S


def test_a_robot_goes_back_where_its_map_has_it_in_collision():
    env = made()
    level, policy, observations = started(env)
    while policy.team.time_s < 15.0:
        observations = level.step(policy.act(observations))[0]
    belief = env.belief("robot_0")
    known = belief.sparse_map.amid(belief.pose[None, :2], 0.05, 0.5)
    assert not known.is_free(belief.pose[None, :2])
    route = known.route(belief.pose[:2], np.zeros(2))
    assert not route.reason
    assert route.points[0] == pytest.approx(belief.pose[:2])
    assert known.is_free(route.points[-1:])


def test_blacklisted_ground_is_not_chosen_again_and_counts_until_it_is_seen():
    level, policy, observations = started(made())
    policy.act(observations)
    view = policy._work["robot_0"].view
    policy._give_up("robot_0", view.points, "unseen")
    assert [entry.reason for entry in policy.given_up] == ["unseen"]
    policy._work["robot_0"].view = None
    policy.act(observations)
    again = policy._work["robot_0"].view.points
    gaps = np.hypot(*(again[:, None, :2] - view.points[None, :, :2]).transpose(2, 0, 1))
    assert gaps.min() > 0.2
    entry, mapper = policy.given_up[0], level.unwrapped.perception.sparse_maps.of(0)
    place = np.array([entry.x, entry.y]) + level.unwrapped.perception.poses.offset(0)
    column, row = np.floor(place / mapper.ground.cell_m).astype(int) - mapper.ground.low
    mapper.ground.cells[row, column] = True
    mapper.version += 1
    assert policy.given_up == []


# -- What is asked of the environment ----------------------------------------------------------------------


def test_without_depth_images_the_message_names_the_cure():
    env = lidarium.parallel_env("apartment", robots=1, starts="fixed")
    with pytest.raises(ValueError, match=r"needs depth, .*add to settings\.observe, with a depth camera: camera="):
        run_episode(lidarium.policy("sparse_frontier"), env, 0)


def test_settings_are_completed_by_what_a_policy_reads_where_there_are_sensors():
    policy = lidarium.policy("sparse_frontier")
    plain = make_settings(camera="xtion_tilted")
    assert settings_for(policy, plain).observe == (*plain.observe, "depth")
    assert settings_for(lidarium.policy("nearest_frontier"), plain) is plain
    with pytest.raises(ValueError, match="observe has 'depth', which needs a camera"):
        settings_for(policy, make_settings())


def test_a_suite_without_cameras_is_refused_before_it_begins():
    with pytest.raises(ValueError, match=r"policy 'sparse_frontier' cannot run with variant 'default'.*a camera"):
        Suite(policies=("nearest_frontier", "sparse_frontier"), floors=("apartment",))
    assert Suite(
        policies=("sparse_frontier",),
        floors=("apartment",),
        variants={"default": {"camera": "xtion_tilted"}},
        policy_settings={"sparse_frontier": {"minimum_size": 0.5}},
    )


@pytest.mark.parametrize(
    ("settings", "match"),
    [
        ({"minimum_size": 0.0}, "minimum_size of views is 0.0; want a number above 0"),
        ({"near_share": 1.5}, "near_share of views is 1.5"),
        ({"gain": math.nan}, "gain of views is nan"),
    ],
)
def test_bad_settings_are_refused(settings, match):
    with pytest.raises(ValueError, match=match):
        lidarium.policy("sparse_frontier", **settings)


def test_a_camera_that_sees_no_ground_is_refused_at_the_start():
    env = made(camera={**SMALL, "pitch": -0.8})
    with pytest.raises(ValueError, match=r"sees the ground only from inf m on.*a larger pitch"):
        explored(env)


def test_an_environment_that_maps_can_be_copied():
    env = made(horizon_s=20.0)
    level, policy, observations = started(env)
    level.step(policy.act(observations))
    twin = copy.deepcopy(env)
    for each in (env, twin):
        for _ in range(20):
            each.drive_at(np.array([[0.2, 0.4]]))
    own, other = (each.belief("robot_0").sparse_map for each in (env, twin))
    assert np.array_equal(own.navigation.index.boxes, other.navigation.index.boxes)
    assert np.array_equal(own.navigation.ground.levels, other.navigation.ground.levels)


def test_robots_wait_while_one_gives_way():
    level, policy, observations = started(made(robots=2))
    for _ in range(6):
        observations = level.step(policy.act(observations))[0]
    policy.act(observations)
    work = policy._work["robot_0"]
    route, work.moved_s = work.route, -2.0 * PATIENCE_S
    level.driver.drives.passing[0] = 1
    assert level.drive_state("robot_0") is DriveState.GIVING_WAY
    assert policy.act(observations)["robot_0"] is route
    assert work.moved_s == policy.team.time_s


HERE = np.array([1.0, 2.0, 3.0])
VIEW = View(np.array([4.0, 2.0]), 0.0, 3.0, np.array([[5.0, 2.0], [5.0, 3.0]]))


def begun():
    work = _Work()
    work.begin(VIEW, 10.0, HERE)
    return work


def test_what_a_robot_is_about_to_see_is_left_to_it_until_it_drops_it():
    work = begun()
    np.testing.assert_allclose(work.claimed[:, :2], VIEW.points)
    np.testing.assert_allclose(work.claimed[:, 2], CLAIMED_M)
    work.drop()
    assert work.claimed.shape == (0, 3)


def test_a_robot_that_does_not_move_is_stuck_and_then_in_vain():
    work = begun()
    work.watch(11.0, HERE + np.array([0.05, 0.0, 0.1]), DriveState.DRIVING)
    assert (work.is_stuck(10.0 + STUCK_S), work.is_stuck(10.1 + STUCK_S)) == (False, True)
    assert (work.is_in_vain(10.0 + PATIENCE_S), work.is_in_vain(10.1 + PATIENCE_S)) == (False, True)


@pytest.mark.parametrize("motion", [(0.2, 0.0, 0.0), (0.0, 0.0, 0.3), (0.0, 0.0, 0.25 + math.tau)])
def test_a_motion_or_a_turn_begins_the_time_anew(motion):
    work = begun()
    work.watch(20.0, HERE + np.array(motion), DriveState.DRIVING)
    assert not work.is_stuck(19.9 + STUCK_S)


def test_giving_way_is_no_standing_still_and_a_blocked_path_is():
    work = begun()
    work.watch(20.0, HERE, DriveState.GIVING_WAY)
    assert work.moved_s == 20.0
    for now in (21.0, 22.0):
        work.watch(now, HERE, DriveState.BLOCKED)
    assert (work.is_stuck(21.0 + BLOCKED_S), work.is_stuck(21.1 + BLOCKED_S)) == (False, True)
    work.watch(22.5, HERE, DriveState.DRIVING)
    assert work.blocked_s == math.inf


def test_what_is_taken_to_stand_there_does_so_for_a_while():
    work = begun()
    work.watch(11.0, HERE, DriveState.BLOCKED)
    work.take_to_stand(np.array([2.0, 2.0]), 12.0)
    work.take_to_stand(np.array([3.0, 2.0]), 20.0)
    assert work.blocked_s == math.inf
    assert work.obstacles_at(12.0 + OBSTACLE_S - 0.1).tolist() == [[2.0, 2.0], [3.0, 2.0]]
    assert work.obstacles_at(12.0 + OBSTACLE_S).tolist() == [[3.0, 2.0]]
    assert work.obstacles_at(99.0).shape == (0, 2)
