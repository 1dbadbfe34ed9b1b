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
    env = lidarium.parallel_env("scene_room", **MIXED)
    env.reset(seed=3)
    fastest = np.zeros(3)
    for _ in range(15):
        env.step({agent: np.array([1.0, 0.0], np.float32) for agent in env.agents})
        fastest = np.maximum(fastest, env.world.velocities[:, 0])
    limits = np.array([robot.max_speed for robot in env.settings.team])
    assert (fastest <= limits + 1e-9).all()
    assert fastest[1] > ROBOTS["kobuki"].max_speed
    assert env.observation_space("robot_0")["velocity"].high[0] == np.float32(limits.max())


@pytest.mark.parametrize("level", ["velocity", "waypoint", "frontier"])
def test_a_mixed_team_is_in_a_batch_what_it_is_alone(level):
    options = {**MIXED, "level": level}
    alone, batch = (
        lidarium.parallel_env("scene_room", **options),
        lidarium.vector_env(2, "scene_room", **options),
    )
    alone.reset(seed=8)
    batch.reset(seed=7)
    generator = np.random.default_rng(0)
    for _ in range(6):
        actions = (
            np.zeros(6, np.int64) if level == "frontier" else generator.uniform(-1.0, 1.0, (6, 2)).astype(np.float32)
        )
        rewards = alone.step({agent: actions[3 + k] for k, agent in enumerate(alone.possible_agents)})[1]
        _, wanted, *_ = batch.step(actions)
        assert list(rewards.values()) == wanted[3:].tolist()
        assert np.array_equal(alone.unwrapped.world.poses, batch.engine.world.poses[3:])
    assert np.isfinite(alone.state()).all()
    assert alone.state_space.contains(alone.state())


def test_bodies_that_touch_have_radii_of_their_own():
    env = lidarium.parallel_env("scene_room", **{**MIXED, "robots": 2})
    x, y = 15.0, 20.0
    starts = np.array([(x, y, 0.0), (x + 1.0, y, 0.0)])
    env.reset(seed=0, options={"starts": starts})
    for _ in range(60):
        env.step({"robot_0": [1.0, 0.0], "robot_1": [0.0, 0.0]})
    gap = np.hypot(*(env.world.poses[1] - env.world.poses[0])[:2])
    touching = ROBOTS["kobuki"].radius + ROBOTS["service"].radius
    assert gap == pytest.approx(touching, abs=0.02)
