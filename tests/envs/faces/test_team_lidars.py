"""Teams whose robots have lidars of their own: each senses, maps and drives as it would with that lidar alone."""

import math
from dataclasses import replace

import numpy as np
import pytest
from two_rooms import wall

import lidarium
from lidarium.envs.floors.floor import Floor
from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.settings.making import make_settings
from lidarium.envs.simulation.backends import kinematic_world, make_kinematic, simulation_of
from lidarium.envs.simulation.kernels.floor_cache import floor_tables
from lidarium.evaluation.bounds.bound import known_floor_bound
from lidarium.evaluation.episodes.watching import WatchedExploration
from lidarium.evaluation.record.file import read_record
from lidarium.evaluation.record.replay import rerun
from lidarium.evaluation.viewing.moment import moment_of

# Lasers above the bodies do not see teammates.
NEAR = Lidar(beams=181, range_max=2.0, height=0.6)
FAR = Lidar(beams=181, range_max=8.0, field_of_view=math.pi, range_min=0.1, height=0.6)
LIDARS = [NEAR, FAR]

# Robots in the two halves do not meet, and see nothing of each other's half.
HALL = Floor(
    "hall",
    (0.0, 0.0, 40.0, 6.0),
    (wall(5.0, 0.0, 0.2, 4.0), wall(9.0, 3.0, 0.2, 3.0), wall(30.0, 1.0, 0.5, 0.5), wall(35.0, 2.5, 0.2, 3.5)),
)
STARTS = np.array([[4.0, 3.0, 0.7], [32.0, 3.0, 2.0]])
OPTIONS = {"robots": 2, "lidar": LIDARS, "resolution": 0.05, "observe": ["scan", "velocity", "map"]}


def team(level="velocity", **options):
    """A team in the hall at its start, and its first observations."""
    env = lidarium.parallel_env(HALL, level=level, **{**OPTIONS, **options})
    if level != "velocity":
        env.use_level(level, shares_map=False)
    starts = STARTS if env.settings.robots == 2 else STARTS[[LIDARS.index(env.settings.lidar)]]
    return env, env.reset(seed=4, options={"starts": starts})[0]


def assert_same_robot(env, row, alone, observed, observed_alone):
    """Check that a robot of a team has seen, mapped and scored the same as it has alone."""
    assert observed.keys() == observed_alone.keys()
    for name, value in observed.items():
        assert np.array_equal(value, observed_alone[name]), name
    for array in ("poses", "ranges", "travelled"):
        owners = [each.simulation if array == "ranges" else each.world for each in (env, alone)]
        assert np.array_equal(getattr(owners[0], array)[row], getattr(owners[1], array)[0]), array
    assert np.array_equal(env.beliefs.log_odds[row], alone.beliefs.log_odds[0])
    score, score_alone = env.simulation.score, alone.simulation.score
    assert np.array_equal(score.masks[row], score_alone.masks[0])
    assert score.seen[row] == score_alone.seen[0] > 1000


@pytest.mark.parametrize("row", [0, 1])
def test_a_robot_of_a_team_senses_maps_and_scores_as_alone(row):
    (env, _), (alone, _) = team(), team(robots=1, lidar=LIDARS[row])
    for step in range(40):
        action = np.array([0.8, math.sin(0.2 * step)], np.float32)
        seen = env.step(dict.fromkeys(env.agents, action))[0]
        seen_alone = alone.step({"robot_0": action})[0]
    assert_same_robot(env, row, alone, seen[f"robot_{row}"], seen_alone["robot_0"])


@pytest.mark.parametrize("row", [0, 1])
def test_a_robot_of_a_team_drives_to_frontiers_as_alone(row):
    # A decision takes one step: it does not end early because a teammate has arrived.
    seen_by = ["scan", "frontiers", "action_mask", "frontier_gains"]
    options = {"level": "frontier", "decision_period_s": 0.1, "observe": seen_by}
    (env, _), (alone, seen_alone) = team(**options), team(**options, robots=1, lidar=LIDARS[row])
    assert seen_alone["robot_0"]["frontier_gains"].max() > 0.0
    for _ in range(80):
        seen = env.step(dict.fromkeys(env.agents, 0))[0]
        seen_alone = alone.step({"robot_0": 0})[0]
    assert env.world.travelled[row] > 0.1
    assert_same_robot(env, row, alone, seen[f"robot_{row}"], seen_alone["robot_0"])


def test_no_return_is_observed_as_the_own_range_within_one_space():
    env, seen = team()
    assert seen["robot_0"]["scan"].max() == np.float32(2.0)
    assert 2.0 < seen["robot_1"]["scan"].max() <= np.float32(8.0)
    assert env.observation_space("robot_0") == env.observation_space("robot_1")
    assert env.observation_space("robot_0")["scan"].high[0] == np.float32(8.0)
    assert all(env.observation_space(agent).contains(each) for agent, each in seen.items())
    assert [env.belief(agent).lidar for agent in env.agents] == LIDARS


def test_noise_is_that_of_the_own_lidar():
    noisy = replace(FAR, noise_floor=0.05)
    exact, all_noisy, mixed = (team(lidar=lidars)[0].simulation.ranges for lidars in (FAR, noisy, [FAR, noisy]))
    assert np.array_equal(mixed[0], exact[0])
    assert np.array_equal(mixed[1], all_noisy[1])
    met = np.isfinite(exact[1])
    assert 0.03 < (mixed[1, met] - exact[1, met]).std() < 0.07


def test_stages_one_by_one_equal_the_fused_step():
    settings = make_settings(**OPTIONS)
    tables = floor_tables(HALL, settings.raster_resolution, settings.lidar.height, settings.robot.height)
    fused, staged = make_kinematic(settings), simulation_of(kinematic_world(settings), settings)
    for simulation in (fused, staged):
        simulation.place(0, tables, STARTS, 5)
        for _ in range(20):
            simulation.step(np.array([[0.5, 0.3], [0.3, -0.5]]))
    assert np.array_equal(fused.ranges, staged.ranges)
    for row in range(2):
        assert np.array_equal(fused.beliefs.log_odds[row], staged.beliefs.log_odds[row])
        assert np.array_equal(fused.score.masks[row], staged.score.masks[row])


@pytest.mark.parametrize(("level", "action"), [("velocity", (0.7, 0.3)), ("frontier", 0)])
def test_batches_equal_single_environments(level, action):
    options = {**OPTIONS, "level": level, "noise": "datasheet"}
    batch = lidarium.vector_env(2, HALL, **options)
    singles = [lidarium.parallel_env(HALL, **options) for _ in range(2)]
    rows, _ = batch.reset(seed=7)
    teams = [env.reset(seed=7 + episode)[0] for episode, env in enumerate(singles)]
    for _ in range(5):
        for name, values in rows.items():
            alone = [teams[episode][f"robot_{robot}"][name] for episode in range(2) for robot in range(2)]
            assert np.array_equal(values, np.stack(alone)), name
        rows = batch.step(np.array([action] * 4))[0]
        teams = [env.step(dict.fromkeys(env.agents, np.asarray(action)))[0] for env in singles]


@pytest.mark.parametrize("lidars", [LIDARS, LIDARS[::-1]], ids=["near first", "far first"])
def test_slam_works_with_the_own_lidar(lidars):
    options = {"localization": "slam", "odometry": "typical", "noise": "datasheet"}
    starts = STARTS if lidars == LIDARS else STARTS[::-1]
    env, alone = (
        lidarium.parallel_env(HALL, **{**OPTIONS, **options, "robots": robots, "lidar": lidars}) for robots in (2, 1)
    )
    env.reset(seed=4, options={"starts": starts})
    alone.reset(seed=4, options={"starts": starts[:1]})
    for step in range(60):
        action = np.array([0.6, math.sin(0.1 * step)], np.float32)
        env.step(dict.fromkeys(env.agents, action))
        alone.step({"robot_0": action})
    assert np.array_equal(env.beliefs.believed[0], alone.beliefs.believed[0])
    assert np.array_equal(env.beliefs.log_odds[0], alone.beliefs.log_odds[0])
    assert not np.array_equal(env.beliefs.believed, env.world.poses)
    # The near lidar sees a single wall for a while, along which nothing holds its pose.
    far = lidars.index(FAR)
    assert np.abs(env.beliefs.believed[far] - env.world.poses[far]).max() < 0.1


def test_pybullet_senses_with_the_own_lidar():
    pytest.importorskip("pybullet", reason="the extra bullet is not installed")
    (env, _), (plain, _) = team(backend="bullet"), team()
    assert np.array_equal(env.simulation.ranges, plain.simulation.ranges)
    level = env.simulation.ranges.copy()
    # Rays of PyBullet, as if the bodies leaned: the same walls, as far as each lidar sees.
    env.world.attitudes[:, 1] = 1.0
    env.world.move_and_sense(np.zeros((2, 2)), moves_bodies=False)
    rays = env.simulation.ranges
    assert not np.array_equal(rays, level)
    both = np.isfinite(rays) & np.isfinite(level)
    assert both.sum(axis=1).min() > 20
    assert np.median(np.abs(rays[both] - level[both])) < 0.03
    assert all(rays[row][np.isfinite(rays[row])].max() < lidar.range_max for row, lidar in enumerate(LIDARS))


def test_a_record_runs_again_to_the_bit(tmp_path):
    settings = make_settings(robots=2, lidar=LIDARS, resolution=0.05, horizon_s=10.0)
    path = tmp_path / "episode.npz"
    lidarium.record("tour_frontier", settings=settings, seed=2, path=path)
    env = rerun(read_record(path))
    assert env.settings == settings
    assert env.settings.team_lidars == LIDARS


def test_a_scan_is_shown_with_the_angles_and_ranges_of_the_own_lidar():
    env = WatchedExploration(HALL, make_settings(**OPTIONS), watchers=[])
    env.reset(seed=4, options={"starts": STARTS})
    for robot, lidar, pose in zip(moment_of(env).robots, LIDARS, STARTS, strict=True):
        x, y = (robot.ends - robot.laser)[:, :2].T
        assert np.hypot(x, y).max() <= lidar.range_max + 1e-6
        bearings = np.arctan2(np.sin(np.arctan2(y, x) - pose[2]), np.cos(np.arctan2(y, x) - pose[2]))
        assert np.abs(bearings).max() == pytest.approx(lidar.field_of_view / 2.0, abs=1e-6)


def test_values_are_drawn_for_each_lidar():
    env = lidarium.parallel_env(HALL, **OPTIONS, randomize={"lidar.noise_floor": (0.01, 0.05)})
    env.reset(seed=0)
    near, far = env.settings.team_lidars
    assert near.noise_floor == far.noise_floor == env.drawn["lidar.noise_floor"]
    assert (near.range_max, far.range_max) == (2.0, 8.0)


def test_bounds_are_for_one_lidar():
    with pytest.raises(ValueError, match="the lidars of the robots differ; bounds are for teams"):
        known_floor_bound(HALL, make_settings(robots=2, lidar=LIDARS), STARTS.tolist())
