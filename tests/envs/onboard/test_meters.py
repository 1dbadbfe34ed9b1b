"""Batteries and odometers: what robots use and how far they have come, against what is reckoned by hand."""

import math

import numpy as np
import pytest

import lidarium
from lidarium.envs.floors.floor import Floor
from lidarium.envs.settings.battery import BATTERIES, Battery
from lidarium.envs.settings.faults import Fault, FaultSettings

HALL = Floor("hall", (0.0, 0.0, 20.0, 12.0))
SIMPLE = Battery(capacity_j=1000.0, idle_w=2.0, per_metre_j=5.0, per_radian_j=3.0)


def hall(robots=1, **options):
    env = lidarium.parallel_env(
        HALL, robots=robots, lidar="lidar_360_6m", **{"starts": "fixed", "stop_coverage": None, **options}
    )
    env.reset(seed=1, options={"starts": [[3.0, 3.0 + 3.0 * robot, 0.0] for robot in range(robots)]})
    return env


def drive(env, steps, action=(0.5, 0.0)):
    for _ in range(steps):
        if env.agents:
            outcome = env.step({agent: np.array(action, np.float32) for agent in env.agents})
    return outcome


def test_standing_costs_time_alone():
    env = hall(battery=SIMPLE)
    infos = drive(env, 50, (0.0, 0.0))[4]
    assert infos["robot_0"]["energy_j"] == pytest.approx(2.0 * 5.0)
    assert env.belief("robot_0").energy_left_j == pytest.approx(990.0)


def test_driving_costs_its_way_beside_the_time():
    env = hall(battery=SIMPLE)
    infos = drive(env, 40)[4]
    assert env.world.travelled[0] > 1.0
    assert infos["robot_0"]["energy_j"] == pytest.approx(2.0 * 4.0 + 5.0 * float(env.world.poses[0, 0] - 3.0))


def test_turning_costs_its_angle_also_over_the_seam():
    env = hall(battery=SIMPLE)
    drive(env, 1, (0.0, 1.0))
    turned, headings = 0.0, [0.0, env.world.poses[0, 2]]
    for _ in range(49):
        drive(env, 1, (0.0, 1.0))
        headings.append(env.world.poses[0, 2])
    turned = float(np.ptp(np.unwrap(headings)))
    assert turned > 2.0 * math.pi
    assert env.energy_j[0] == pytest.approx(2.0 * 5.0 + 3.0 * turned)


def test_an_empty_battery_ends_its_robot_and_no_other():
    env = hall(robots=2, battery=Battery(capacity_j=21.0, idle_w=10.0, per_metre_j=0.0, per_radian_j=1.0))
    for _ in range(40):
        if "robot_0" in env.agents:
            actions = {"robot_0": np.array([0.0, 0.3]), "robot_1": np.zeros(2)}
            outcome = env.step({agent: actions[agent] for agent in env.agents})
    assert outcome[2]["robot_0"]
    assert outcome[4]["robot_0"]["ended_because"] == "battery"
    assert outcome[4]["robot_0"]["state"] == "stopped"
    assert env.agents == ["robot_1"]
    assert env.scorer.time < 2.1
    used = env.energy_j[0]
    drive(env, 5, (0.0, 0.0))
    assert env.agents == []
    assert env.energy_j[0] == used
    assert env.scorer.ended_because["robot_1"] == "battery"


def test_a_decision_ends_when_a_battery_is_empty():
    env = lidarium.parallel_env(
        "apartment", level="waypoint", robots=1, battery=Battery(capacity_j=10.0, idle_w=10.0), starts="fixed"
    )
    env.reset(seed=1)
    env.step({"robot_0": None})
    assert env.agents == []
    assert env.unwrapped.scorer.time == pytest.approx(1.0)


def test_without_a_limit_nothing_is_reckoned():
    env = hall()
    infos = drive(env, 5)[4]
    assert "energy_j" not in infos["robot_0"]
    assert env.energy_j.tolist() == [0.0]
    assert env.belief("robot_0").energy_left_j is None
    assert not env.perception.meters.is_active


def test_a_battery_changes_nothing_else():
    with_battery, without = hall(battery="kobuki"), hall()
    for env in (with_battery, without):
        drive(env, 30, (0.4, 0.2))
    assert np.array_equal(with_battery.world.poses, without.world.poses)
    assert np.array_equal(with_battery.simulation.ranges, without.simulation.ranges)


def test_a_kobuki_lasts_as_long_as_its_guide_says():
    battery = BATTERIES["kobuki"]
    assert battery.capacity_j / (battery.idle_w + 0.33 * battery.per_metre_j) == pytest.approx(4.5 * 3600.0, rel=0.01)


def test_each_episode_begins_with_a_full_battery():
    env = hall(battery=SIMPLE)
    drive(env, 10)
    env.reset(seed=2)
    assert env.energy_j.tolist() == [0.0]


def test_the_odometer_tells_what_wheels_tell_not_the_truth():
    env = hall(odometry="poor", localization="odometry")
    drive(env, 60)
    by_wheels = env.perception.meters.travelled_m(0)
    assert by_wheels == pytest.approx(math.hypot(*env.simulation.odometry[0, :2]), rel=0.05)
    assert by_wheels != env.world.travelled[0]
    ideal = hall()
    drive(ideal, 60)
    assert ideal.perception.meters.travelled_m(0) == ideal.world.travelled[0]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (
            {"capacity_j": 0.0},
            "capacity_j of the battery is 0.0; want a number of joules above 0 and at most 1e\\+12, or None",
        ),
        ({"idle_w": -1.0}, "idle_w of the battery is -1.0"),
        ({"per_metre_j": math.inf}, "per_metre_j of the battery is inf"),
    ],
)
def test_batteries_that_cannot_be_are_refused(values, message):
    with pytest.raises(ValueError, match=message):
        Battery(**values)


def test_a_robot_that_is_put_elsewhere_has_not_turned():
    away = Fault(kind="kidnapping", robot=0, at_s=1.0, place=(5.0, 3.0, 3.0))
    env = hall(battery=SIMPLE, faults=FaultSettings(schedule=(away,)))
    infos = drive(env, 20, (0.0, 0.0))[4]
    assert env.world.poses[0, 2] == 3.0
    assert infos["robot_0"]["energy_j"] == pytest.approx(2.0 * 2.0)
