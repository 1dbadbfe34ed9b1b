"""Episodes in PyBullet: the same run for the same seed, records, endings, clients that are given back."""

import gc
import json
import sys
from pathlib import Path

import numpy as np
import pytest

import lidarium
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.settings.faults import Fault, FaultSettings
from lidarium.envs.settings.making import make_settings
from lidarium.envs.settings.robots import ROBOTS
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.record.recorder import Recorder
from lidarium.evaluation.record.replay import WatchedExploration, is_same, rerun, state_sha256

pybullet = pytest.importorskip("pybullet", reason="the extra bullet is not installed")
FLOOR = "building:5"
PLAIN = {"resolution": 0.1, "lidar": "lidar_360_6m", "observe": ("scan", "pose")}


def make(**options):
    options = {"robots": 2, "resolution": 0.1, "lidar": "lidar_360_6m", **options}
    return ExplorationEnv(FLOOR, make_settings(backend="bullet", **options))


def run(env, seed=0, steps=25):
    env.reset(seed=seed)
    generator = np.random.default_rng(seed)
    for _ in range(steps):
        env.step({agent: generator.uniform(-0.3, 1.0, 2).astype(np.float32) for agent in env.agents})
    return state_sha256(env)


def clients():
    return sum(pybullet.isConnected(number) for number in range(64))


def test_equal_seeds_give_equal_runs_in_fresh_clients_and_after_a_reset():
    env = make(noise="datasheet", odometry="typical")
    first = run(env, 3)
    assert run(env, 4) != first
    assert run(env, 3) == first
    assert run(make(noise="datasheet", odometry="typical"), 3) == first


def test_the_rows_of_a_batch_are_lone_environments_to_the_bit():
    batch = lidarium.vector_env(8, floor=FLOOR, backend="bullet", robots=2, **PLAIN, starts="fixed")
    batch.reset(seed=[7] * 7 + [8])
    for _ in range(4):
        batch.step(np.full((16, 2), 0.5, np.float32))
    poses = batch.engine.world.poses.reshape(8, 2, 3)
    assert (poses[:7] == poses[0]).all()
    env = lidarium.parallel_env(FLOOR, backend="bullet", robots=2, **PLAIN, starts="fixed")
    env.reset(seed=7)
    for _ in range(4):
        env.step(dict.fromkeys(env.agents, np.full(2, 0.5, np.float32)))
    assert np.array_equal(env.world.poses, poses[0])
    batch.close()
    env.close()
    assert clients() == 0


def resident_kib():
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="memory is read from /proc")
def test_no_client_is_left_and_memory_stays_flat_after_many_episodes():
    env, sizes = make(robots=1), []
    for episode in range(60):
        env.reset(seed=0)
        env.step(dict.fromkeys(env.agents, np.zeros(2, np.float32)))
        if episode in (20, 59):
            gc.collect()
            sizes.append(resident_kib())
    assert clients() == 1
    assert sizes[1] - sizes[0] <= 1024
    env.close()
    env.close()
    assert clients() == 0
    env = lidarium.parallel_env(FLOOR, backend="bullet", robots=2, **PLAIN, starts="fixed")
    env.reset(seed=1)
    assert clients() == 1
    del env
    gc.collect()
    assert clients() == 0


def test_scans_scores_and_maps_are_the_kinematic_ones_at_the_same_poses():
    options = {"robots": 2, "resolution": 0.05, "noise": "thesis"}
    bullet, kinematic = (
        ExplorationEnv(FLOOR, make_settings(backend=backend, **options)) for backend in ("bullet", "kinematic")
    )
    bullet.reset(seed=3)
    kinematic.reset(seed=3)
    still = np.zeros((2, 2))
    for number in range(20):
        for env in (bullet, kinematic):
            env.world.poses[:] = env.world.starts + 0.02 * number * np.array([1.0, 0.5, 2.0])
            env.simulation.step(still, moves_bodies=False)
        assert np.array_equal(bullet.world.ranges, kinematic.world.ranges)
    assert np.array_equal(bullet.score.seen, kinematic.score.seen)
    assert np.array_equal(bullet.score.rewards, kinematic.score.rewards)
    for ours, theirs in zip(bullet.beliefs.log_odds, kinematic.beliefs.log_odds, strict=True):
        assert np.array_equal(ours, theirs)
    for ours, theirs in zip(bullet.score.masks, kinematic.score.masks, strict=True):
        assert np.array_equal(ours, theirs)


def test_a_record_runs_again_and_names_the_version():
    recorder = Recorder("by hand", 2, FLOOR)
    env = WatchedExploration(FLOOR, make(odometry="typical", localization="odometry").settings)
    env.watchers.append(recorder)
    env.reset(seed=2)
    generator = np.random.default_rng(2)
    for _ in range(30):
        env.step({agent: generator.uniform(-0.3, 1.0, 2).astype(np.float32) for agent in env.agents})
    record = recorder.finish()
    assert "pybullet" in record.header["made_with"]
    json.dumps(record.header)
    assert is_same(record, rerun(record, FLOOR))


def test_physics_that_give_no_numbers_end_the_episode():
    env = make()
    env.reset(seed=0)
    world = env.world
    world.bodies_of(0).client.call("resetBaseVelocity", 2, (float("nan"),) * 3, (0.0,) * 3)
    *_, terminations, _, infos = env.step(dict.fromkeys(env.agents, np.zeros(2, np.float32)))
    assert all(terminations.values())
    assert {info["ended_because"] for info in infos.values()} == {"physics"}
    assert env.agents == []


def test_a_kidnapped_robot_is_put_elsewhere():
    env = make(faults=FaultSettings(schedule=(Fault(kind="kidnapping", at_s=0.5),)))
    env.reset(seed=0)
    for _ in range(10):
        before = env.world.poses[0].copy()
        env.step(dict.fromkeys(env.agents, np.array([0.2, 0.0], np.float32)))
        if np.hypot(*(env.world.poses[0] - before)[:2]) > 0.3:
            break
    else:
        pytest.fail("the robot was not kidnapped")
    assert env.world.travelled[0] < 0.5


def test_a_policy_explores():
    settings = make_settings(robots=2, backend="bullet", resolution=0.1, stop_coverage=0.9)
    env = ExplorationEnv("scene_corner", settings)
    run_episode(lidarium.policy("nearest_frontier"), env, seed=0)
    assert env.scorer.coverage >= 0.9
    env.close()


@pytest.mark.parametrize("backend", ["kinematic", "bullet"])
def test_a_robot_as_high_as_the_ceiling_is_refused(backend):
    settings = make_settings(robot={"height": 2.6}, backend=backend)
    with pytest.raises(ValueError, match=r"ceiling at 2\.5 m, the robot is 2\.6 m high; want a lower"):
        ExplorationEnv("apartment", settings).reset(seed=0)


def test_a_start_inside_furniture_is_refused():
    with pytest.raises(ValueError, match="start"):
        make(robots=1).reset(seed=0, options={"starts": np.array([[0.01, 0.01, 0.0]])})


def test_builds_are_settings():
    made = make_settings(robot={"build": {"base_mass": 3.0}}, assigned=("robot.build.motor_torque=0.7",))
    assert (made.robot.build.base_mass, made.robot.build.motor_torque) == (3.0, 0.7)
    with pytest.raises(ValueError, match="base_mass of the build is 0"):
        make_settings(assigned=("robot.build.base_mass=0",))
    with pytest.raises(ValueError, match="clearance of the build"):
        make_settings(robot={"height": 0.01})
    assert len({robot.build for robot in ROBOTS.values()}) == len(ROBOTS)
