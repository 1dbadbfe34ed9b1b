"""Teams of robots of different kinds."""

import numpy as np
import pytest

import lidarium
from lidarium.envs.settings.making import make_settings
from lidarium.envs.settings.robots import ROBOTS

MIXED = {"robots": 3, "kinds": ["kobuki", "service"], "observe": ["velocity", "bumper"], "horizon_s": 20.0}


def test_kinds_follow_each_other_and_begin_again():
    settings = make_settings(**MIXED)
    assert settings.team == [ROBOTS["kobuki"], ROBOTS["service"], ROBOTS["kobuki"]]
    assert settings.kinds == ("kobuki", "service")


def test_paths_are_planned_for_the_widest_and_the_slowest():
    robot = make_settings(**MIXED).robot
    both = ROBOTS["kobuki"], ROBOTS["service"]
    assert robot.radius == max(each.radius for each in both)
    assert robot.height == max(each.height for each in both)
    assert robot.max_speed == min(each.max_speed for each in both)
    assert robot.cruise_speed == min(each.cruise_speed for each in both)


def test_a_team_of_one_kind_is_that_of_the_robot():
    mixed, plain = (
        make_settings(robots=2, kinds=["pioneer"]),
        make_settings(robots=2, robot="pioneer"),
    )
    assert mixed.team == plain.team
    assert mixed.robot == plain.robot


@pytest.mark.parametrize(
    ("kinds", "message"),
    [
        ("kobuki", "kinds is 'kobuki'; want names of robots"),
        (["kobuky"], "kinds has an unknown robot 'kobuky'; did you mean 'kobuki'"),
        ([3], "kinds has an unknown robot 3"),
        ({"kobuki": 2, "service": 1}, "kinds is {'kobuki': 2, 'service': 1}; want names of robots"),
    ],
)
def test_bad_kinds_are_refused(kinds, message):
    with pytest.raises(ValueError, match=message):
        make_settings(kinds=kinds)


def test_each_robot_drives_within_limits_of_its_own():
    env = lidarium.parallel_env("scene_room", **MIXED, starts="fixed")
    env.reset(seed=3)
    fastest = np.zeros(3)
    for _ in range(15):
        env.step({agent: np.array([1.0, 0.0], np.float32) for agent in env.agents})
        fastest = np.maximum(fastest, env.world.velocities[:, 0])
    limits = np.array([robot.max_speed for robot in env.settings.team])
    assert (fastest <= limits + 1e-9).all()
    assert fastest[1] > ROBOTS["kobuki"].max_speed
    assert env.observation_space("robot_0")["velocity"].high[0] == np.float32(limits.max())


def test_bodies_that_touch_have_radii_of_their_own():
    env = lidarium.parallel_env("scene_room", **{**MIXED, "robots": 2}, starts="fixed")
    x, y = 15.0, 20.0
    starts = np.array([(x, y, 0.0), (x + 1.0, y, 0.0)])
    env.reset(seed=0, options={"starts": starts})
    for _ in range(60):
        env.step({"robot_0": [1.0, 0.0], "robot_1": [0.0, 0.0]})
    gap = np.hypot(*(env.world.poses[1] - env.world.poses[0])[:2])
    touching = ROBOTS["kobuki"].radius + ROBOTS["service"].radius
    assert gap == pytest.approx(touching, abs=0.02)


@pytest.mark.parametrize("camera", [{"height": 1.0}, {"height": 0.5, "forward": 0.28}])
def test_a_camera_is_on_each_robot_of_a_team(camera):
    make_settings(robots=2, robot="service", camera=camera)
    with pytest.raises(ValueError, match=r"beyond the robot's radius of 0.18 m|above the robot's height of 0.52 m"):
        make_settings(robots=2, kinds=["kobuki", "service"], camera=camera)
