"""Faults: each does what its name says, at its time, and what is downstream goes on or ends with a reason."""

import math

import numpy as np
import pytest

import lidarium
from lidarium.envs.floors.floor import Floor
from lidarium.envs.settings.faults import KINDS, MOST_DRAWN, Fault, FaultSettings
from lidarium.envs.simulation.disturbances.faults import FAULT_NUMBERS, plan_faults
from lidarium.evaluation.episodes.runner import run_episode

HALL = Floor("hall", (0.0, 0.0, 30.0, 20.0))
PLACES = np.array([[10.0, 10.0], [12.0, 10.0]])


def run(*faults, steps=30, action=(0.4, 0.0), robots=2, **options):
    """Drive straight ahead with faults; return the environment and what every step returned."""
    env = lidarium.parallel_env(
        HALL, robots=robots, faults=FaultSettings(schedule=faults), stop_coverage=None, **{"starts": "fixed", **options}
    )
    env.reset(seed=1, options={"starts": [[4.0, 4.0 + 4.0 * k, 0.0] for k in range(robots)]})
    outcomes = [
        env.step({agent: np.array(action, np.float32) for agent in env.agents}) for _ in range(steps) if env.agents
    ]
    return env, outcomes


def scans(outcomes, agent="robot_0"):
    return np.array([outcome[0][agent]["scan"] for outcome in outcomes])


def test_without_faults_nothing_is_read_and_nothing_changes():
    env, outcomes = run()
    other, others = run(Fault(kind="dead_robot", robot=1, at_s=500.0))
    assert env.world.faults.shape == (2, 0)
    assert np.array_equal(env.world.poses, other.world.poses)
    assert np.array_equal(scans(outcomes), scans(others))


@pytest.mark.parametrize("noise", ["none", "datasheet"])
def test_a_laser_that_drops_out_has_no_valid_beam_for_its_time_and_sees_nothing(noise):
    env, outcomes = run(Fault(kind="laser_dropout", at_s=1.0, lasts_s=0.5), noise=noise)
    is_blind = (scans(outcomes) == 0.0).all(axis=1)
    assert np.flatnonzero(is_blind).tolist() == [10, 11, 12, 13, 14]
    assert not (scans(outcomes, "robot_1") == 0.0).all(axis=1).any()
    seen = np.array([outcome[4]["robot_0"]["truth"]["seen_cells"] for outcome in outcomes])
    assert (np.diff(seen)[9:14] == 0).all()
    assert env.agents == ["robot_0", "robot_1"]


def test_a_blind_sector_takes_its_beams_and_no_others():
    _, outcomes = run(Fault(kind="blind_sector", bearing=math.radians(30.0), width=math.radians(20.0)))
    env = lidarium.parallel_env(HALL, robots=2, starts="fixed")
    angles = env.settings.lidar.angles
    is_blind = (scans(outcomes) == 0.0).all(axis=0)
    wanted = np.abs(angles - math.radians(30.0)) <= math.radians(10.0)
    assert np.array_equal(is_blind, wanted)


def test_a_blind_sector_behind_a_robot_that_sees_all_around_wraps():
    env, outcomes = run(Fault(kind="blind_sector", bearing=math.pi, width=math.radians(40.0)), lidar="lidar_360_6m")
    angles = env.settings.lidar.angles
    behind = math.pi - np.abs(angles) <= math.radians(20.0) + 1e-9
    assert np.array_equal((scans(outcomes) == 0.0).all(axis=0), behind)


@pytest.mark.parametrize(("wheel", "sign"), [("left", 1.0), ("right", -1.0)])
def test_a_stuck_wheel_lets_the_robot_turn_about_it(wheel, sign):
    env, _ = run(Fault(kind="stuck_wheel", wheel=wheel, at_s=0.0, lasts_s=2.0), steps=20)
    world, base = env.world, env.settings.robot.wheel_base
    assert sign * world.poses[0, 2] > 0.3
    radius = world.velocities[0, 0] / world.velocities[0, 1]
    assert abs(radius) == pytest.approx(base / 2.0)
    # The wheel that sticks stays where it was.
    x, y, heading = world.poses[0]
    assert x - sign * base / 2.0 * math.sin(heading) == pytest.approx(4.0)
    assert y + sign * base / 2.0 * math.cos(heading) == pytest.approx(4.0 + sign * base / 2.0)
    assert world.poses[1, 2] == 0.0


def test_a_wheel_that_gets_stuck_at_full_speed_stops_at_once():
    env, _ = run(Fault(kind="stuck_wheel", wheel="left", at_s=2.0), steps=40, action=(5.0, 0.0))
    speed, turn_rate = env.world.velocities[0]
    # The other wheel cannot turn the robot faster than it may turn.
    assert turn_rate == pytest.approx(env.settings.robot.max_turn_rate)
    assert speed == pytest.approx(turn_rate * env.settings.robot.wheel_base / 2.0)


def test_a_kidnapped_robot_is_elsewhere_and_what_it_knows_is_not_told():
    env, outcomes = run(Fault(kind="kidnapping", at_s=1.0, place=(20.0, 12.0, 1.5)), steps=20, localization="odometry")
    poses = np.array([outcome[4]["robot_0"]["truth"]["pose"] for outcome in outcomes])
    assert np.hypot(*(poses[9, :2] - [4.0, 4.0])) < 1.0
    assert np.hypot(*(poses[10, :2] - [20.0, 12.0])) < 0.1
    # Its wheels have not noticed.
    assert env.beliefs.believed[0, 0] == pytest.approx(4.0 + env.world.travelled[0], abs=0.05)
    assert env.beliefs.believed[0, 1] == pytest.approx(4.0, abs=1e-6)


def test_a_kidnapped_robot_is_never_put_into_another():
    env, outcomes = run(Fault(kind="kidnapping", robot=0, at_s=0.5, place=(4.5, 8.0, 0.0)), steps=60)
    poses = np.array([[outcome[4][agent]["truth"]["pose"] for agent in ("robot_0", "robot_1")] for outcome in outcomes])
    gaps = np.hypot(*(poses[:, 0, :2] - poses[:, 1, :2]).T)
    assert gaps.min() >= 2.0 * env.settings.robot.radius - 1e-6
    # As soon as the other has left, it is put there.
    assert abs(poses[-1, 0, 1] - 8.0) < 0.5


def test_places_of_kidnapping_are_drawn_where_robots_fit_and_can_get_to():
    env = lidarium.parallel_env(
        "apartment", robots=2, faults=FaultSettings(schedule=(Fault(kind="kidnapping", at_s=0.2),)), starts="fixed"
    )
    for seed in range(5):
        env.reset(seed=seed)
        for _ in range(4):
            env.step({agent: np.zeros(2, np.float32) for agent in env.agents})
        assert env.world.contacts.sum() == 0
        assert np.hypot(*(env.world.poses - env.world.starts)[0, :2]) > 0.0


def test_a_dead_robot_stands_and_ends_as_failed_and_the_others_go_on():
    env, outcomes = run(Fault(kind="dead_robot", at_s=1.0), steps=25)
    ended = [k for k, outcome in enumerate(outcomes) if outcome[2].get("robot_0")]
    assert ended == [10]
    assert outcomes[10][4]["robot_0"]["ended_because"] == "failed"
    assert not outcomes[10][3]["robot_0"]
    assert env.agents == ["robot_1"]
    assert env.world.poses[0, 0] < env.world.poses[1, 0]


def test_teams_finish_without_a_robot_that_died():
    fault = Fault(kind="dead_robot", robot=1, at_s=20.0)
    env = lidarium.parallel_env("apartment", robots=3, faults=FaultSettings(schedule=(fault,)), starts="fixed")
    run_episode(lidarium.policy("nearest_frontier"), env, seed=4)
    scorer = env.unwrapped.scorer
    assert scorer.ended_because["robot_1"] == "failed"
    assert scorer.coverage >= 0.95


@pytest.mark.parametrize("kind", KINDS[1:])
def test_every_kind_comes_at_its_rate_and_is_survived(kind):
    settings = FaultSettings(**{kind: 300.0}, lasts_s=2.0)
    env = lidarium.parallel_env(
        "apartment", robots=2, faults=settings, localization="odometry", radio="range", horizon_s=60.0, starts="fixed"
    )
    run_episode(lidarium.policy("nearest_frontier"), env, seed=2)
    assert set(env.unwrapped.scorer.ended_because) == {"robot_0", "robot_1"}


def test_rates_draw_as_many_faults_as_they_say():
    settings = FaultSettings(laser_dropout=6.0, stuck_wheel=3.0)
    tables = [plan_faults(settings, 4, seed, 0.1, 3600.0, PLACES).reshape(4, -1, FAULT_NUMBERS) for seed in range(40)]
    kinds = np.stack(tables)[..., 0]
    assert (kinds == KINDS.index("laser_dropout")).sum() / 160 == pytest.approx(6.0, rel=0.1)
    assert (kinds == KINDS.index("stuck_wheel")).sum() / 160 == pytest.approx(3.0, rel=0.15)
    assert kinds.shape[2] == MOST_DRAWN


def test_a_frequent_kind_of_fault_leaves_room_for_the_others():
    # The first of all kinds are kept, even where one alone would fill the table many times over.
    settings = FaultSettings(laser_dropout=300.0, stuck_wheel=300.0)
    kinds = plan_faults(settings, 40, 0, 0.1, 1800.0, PLACES).reshape(40, -1, FAULT_NUMBERS)[..., 0]
    for kind in ("laser_dropout", "stuck_wheel"):
        assert (kinds == KINDS.index(kind)).mean() == pytest.approx(0.5, abs=0.05)


def test_the_same_seed_draws_the_same_faults():
    settings = FaultSettings(laser_dropout=20.0, kidnapping=20.0)
    one, other, another = (plan_faults(settings, 2, seed, 0.1, 600.0, PLACES) for seed in (1, 1, 2))
    assert np.array_equal(one, other)
    assert not np.array_equal(one, another)


def test_who_takes_himself_to_be_beyond_his_map_fails():
    env = lidarium.parallel_env("apartment", robots=1, localization="odometry", stop_coverage=None, starts="fixed")
    env.reset(seed=1)
    env.simulation.odometry[0, :2] = 1000.0
    _, _, terminated, _, infos = env.step({"robot_0": np.zeros(2, np.float32)})
    assert terminated["robot_0"]
    assert infos["robot_0"]["ended_because"] == "failed"


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"kind": "rust"}, "kind of the fault is 'rust'; want one of laser_dropout"),
        ({"kind": "dead_robot", "robot": -1}, "robot of the fault is -1"),
        ({"kind": "dead_robot", "at_s": -2.0}, "at_s of the fault is -2.0"),
        ({"kind": "laser_dropout", "lasts_s": 0.0}, "lasts_s of the fault is 0.0"),
        ({"kind": "blind_sector", "width": 7.0}, "the blind sector is 7.0 rad wide"),
        ({"kind": "stuck_wheel", "wheel": "front"}, "wheel of the fault is 'front'; want left or right"),
        ({"kind": "kidnapping", "place": (1.0, math.nan, 0.0)}, "place of the fault is"),
    ],
)
def test_faults_that_cannot_be_are_refused(values, message):
    with pytest.raises(ValueError, match=message):
        Fault(**values)


def test_rates_below_zero_are_refused():
    with pytest.raises(ValueError, match=r"dead_robot of faults is -1.0; want a number an hour of 0 or more"):
        FaultSettings(dead_robot=-1.0)
