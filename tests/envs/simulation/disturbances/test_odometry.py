"""Wheels: what they tell of the way, and what drives make of a command."""

import math

import numpy as np
import pytest

import lidarium
from lidarium.envs.floors.floor import Floor
from lidarium.envs.settings.odometry import ODOMETRY, OdometrySettings
from lidarium.envs.settings.robots import ROBOTS
from lidarium.mapping.geometry.rigid import wrapped

HALL = Floor("hall", (0.0, 0.0, 60.0, 40.0))
FORWARD, TURNING = (0.4, 0.0), (0.0, 0.3)


def drive(action, steps=40, robots=1, seed=1, **options):
    """Drive the same way from the middle of a free floor; return the world."""
    options = {"localization": "odometry", "stop_coverage": None, "lidar": "lidar_360_6m", **options}
    env = lidarium.parallel_env(HALL, robots=robots, **{"starts": "fixed", **options})
    env.reset(seed=seed, options={"starts": [[4.0, 4.0 + 2.0 * k, 0.0] for k in range(robots)]})
    for _ in range(steps):
        env.step({agent: np.array(action, np.float32) for agent in env.agents})
    return env.simulation


def bias(**values):
    return OdometrySettings(**values)


def test_ideal_wheels_tell_the_truth_to_within_rounding():
    simulation = drive((0.5, 0.2), 100, odometry="ideal")
    assert np.allclose(simulation.beliefs.believed, simulation.world.poses, atol=1e-9)
    assert np.allclose(simulation.measured, simulation.world.velocities, atol=1e-12)


def test_wheels_that_nobody_reckons_with_change_nothing():
    plain = drive((0.5, 0.2), localization="truth", noise="datasheet")
    biased = drive(
        (0.5, 0.2), localization="truth", noise="datasheet", odometry=bias(distance_bias=0.05, turn_bias=0.05)
    )
    assert np.array_equal(plain.world.poses, biased.world.poses)
    assert np.array_equal(plain.ranges, biased.ranges)
    assert all(np.array_equal(a, b) for a, b in zip(plain.beliefs.log_odds, biased.beliefs.log_odds, strict=True))
    assert not np.array_equal(plain.measured, biased.measured)


@pytest.mark.parametrize("share", [0.01, 0.05, 0.1])
def test_a_bias_of_distance_makes_every_way_longer_or_shorter_by_its_share(share):
    simulation = drive(FORWARD, 60, robots=4, odometry=bias(distance_bias=share))
    told = simulation.odometry[:, 0] / simulation.world.travelled
    assert np.allclose(np.abs(told - 1.0), share, atol=1e-9)


def test_a_bias_of_turn_makes_every_turn_wider_or_narrower_by_its_share():
    simulation = drive(TURNING, 20, robots=4, odometry=bias(turn_bias=0.05))
    turned = simulation.world.poses[:, 2]
    assert (turned > 0.5).all()
    assert np.allclose(np.abs(simulation.odometry[:, 2] / turned - 1.0), 0.05, atol=1e-9)


def test_drift_turns_the_reckoned_heading_with_the_way():
    simulation = drive(FORWARD, 60, robots=4, odometry=bias(drift=0.01))
    assert np.allclose(np.abs(simulation.odometry[:, 2]), 0.01 * simulation.world.travelled, atol=1e-9)


def test_signs_of_biases_are_drawn_for_each_robot_and_episode():
    told = [drive(FORWARD, 5, robots=4, seed=seed, odometry=bias(distance_bias=0.05)) for seed in range(6)]
    longer = np.array([simulation.odometry[:, 0] > simulation.world.travelled for simulation in told])
    assert 0 < longer.sum() < longer.size
    assert len({tuple(row) for row in longer.tolist()}) > 1


def test_encoders_count_whole_ticks_and_lose_none():
    simulation = drive((0.37, 0.21), 80, robot="pioneer", odometry=bias(counts_ticks=True))
    robot = ROBOTS["pioneer"]
    ways = simulation.measured[0, 0] * 0.1 + np.array([-0.5, 0.5]) * simulation.measured[0, 1] * 0.1 * robot.wheel_base
    ticks = ways * robot.ticks_per_metre
    assert np.allclose(ticks, np.round(ticks), atol=1e-6)
    # What is left of a tick counts in the next step: never more than a tick and a half is missing.
    assert (
        abs(math.hypot(*simulation.odometry[0, :2]) - math.hypot(*(simulation.world.poses[0, :2] - [4.0, 4.0]))) < 0.02
    )
    assert (
        abs(wrapped(simulation.odometry[0, 2] - simulation.world.poses[0, 2]))
        < 2.0 / robot.ticks_per_metre / robot.wheel_base
    )


def test_noise_spreads_with_the_root_of_the_way_whatever_the_time_step():
    model = bias(distance_noise_of_distance=0.02)
    for time_step, steps in ((0.1, 50), (0.05, 100)):
        errors = []
        for seed in range(12):
            simulation = drive(FORWARD, steps, robots=8, seed=seed, odometry=model, time_step=time_step)
            errors += (
                (simulation.odometry[:, 0] - simulation.world.travelled) / np.sqrt(simulation.world.travelled)
            ).tolist()
        assert np.std(errors) == pytest.approx(0.02, rel=0.25)
        assert abs(np.mean(errors)) < 0.008


def test_drives_do_not_quite_what_they_are_told_and_the_wheels_know_it():
    model = bias(speed_noise=0.05, turn_rate_noise=0.05)
    exact, noisy = drive((0.5, 0.2), odometry="ideal"), drive((0.5, 0.2), odometry=model)
    assert not np.allclose(exact.world.poses, noisy.world.poses, atol=1e-6)
    assert np.allclose(noisy.beliefs.believed, noisy.world.poses, atol=1e-9)


def test_the_same_seed_is_the_same_run_to_the_bit():
    one, other, another = (drive((0.5, 0.2), seed=seed, odometry="poor", noise="datasheet") for seed in (3, 3, 4))
    assert np.array_equal(one.beliefs.believed, other.beliefs.believed)
    assert np.array_equal(one.beliefs.log_odds[0], other.beliefs.log_odds[0])
    assert not np.array_equal(one.beliefs.believed, another.beliefs.believed)


def test_with_unknown_starts_reckoning_begins_at_zero():
    simulation = drive(FORWARD, 30, odometry="typical", known_starts=False)
    assert np.array_equal(simulation.beliefs.believed, simulation.odometry)


def test_the_velocity_that_is_observed_is_what_wheels_tell():
    env = lidarium.parallel_env(HALL, robots=1, odometry=bias(distance_bias=0.1), lidar="lidar_360_6m", starts="fixed")
    env.reset(seed=1, options={"starts": [[4.0, 4.0, 0.0]]})
    for _ in range(10):
        observations, *_ = env.step({"robot_0": np.array(FORWARD, np.float32)})
    true_speed, told = float(env.world.velocities[0, 0]), float(observations["robot_0"]["velocity"][0])
    assert told == pytest.approx(true_speed * (1.1 if told > true_speed else 0.9), rel=1e-5)


def test_presets_grow_worse_by_their_names():
    names = ["ideal", "good", "typical", "poor"]
    assert list(ODOMETRY) == names
    errors = [drive((0.4, 0.05), 150, seed=2, odometry=name) for name in names]
    away = [float(np.hypot(*(simulation.beliefs.believed - simulation.world.poses)[0, :2])) for simulation in errors]
    assert away == sorted(away)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"distance_bias": -0.1}, "distance_bias of the odometry is -0.1; want a share of 0 or more"),
        ({"drift": math.nan}, "drift of the odometry is nan"),
        ({"turn_bias": 1.0}, "turn_bias of the odometry is 1.0; want a share of 0 or more and below 1"),
    ],
)
def test_numbers_that_make_no_sense_are_refused(values, message):
    with pytest.raises(ValueError, match=message):
        OdometrySettings(**values)
