"""Observables that are functions: those of the package and of users, alone and in batches."""

import numpy as np
import pytest
from compared_faces import compare_rows

import lidarium
from lidarium.envs.observing.observables import observable
from lidarium.envs.settings.observables import SENSED
from lidarium.envs.settings.radio import RadioSettings

SMALL = {"robots": 3, "map_cells": 32, "lidar": "lidar_360_6m"}
AHEAD = np.array([0.6, 0.2], np.float32)
NEW = ("time_left", "coverage", "teammates")


def run(env, steps, action=AHEAD):
    yield env.reset(seed=3)[0]
    for _ in range(steps):
        yield env.step(dict.fromkeys(env.agents, action))[0]


@pytest.fixture
def nearest():
    """An observable of one's own: the shortest range to the left and to the right."""

    @observable("nearest", 0.0, 6.0, (2,))
    def nearest(rows):
        """Shortest range on each side [m]."""
        scans = np.nan_to_num(rows.scan, nan=0.0, posinf=100.0)
        half = scans.shape[1] // 2
        return np.stack([scans[:, half:].min(axis=1), scans[:, :half].min(axis=1)], axis=1)

    yield nearest
    SENSED.unregister("nearest")


@pytest.mark.parametrize("name", NEW)
def test_each_observable_can_be_had_alone(name):
    env = lidarium.parallel_env("scene_room", **SMALL, observe=[name], starts="fixed")
    for observations in run(env, 3):
        for agent, observation in observations.items():
            assert set(observation) == {name}
            assert env.observation_space(agent).contains(observation)


def test_time_left_and_coverage_are_those_of_the_episode():
    env = lidarium.parallel_env("scene_room", **SMALL, observe=["time_left", "coverage"], horizon_s=2.0, starts="fixed")
    for step, observations in enumerate(run(env, 10)):
        for observation in observations.values():
            assert observation["time_left"] == np.float32(1.0 - step / 20)
            assert observation["coverage"] == np.float32(env.scorer.coverage)
    endless = lidarium.parallel_env("scene_room", **SMALL, observe=["time_left"], horizon_s=None, starts="fixed")
    assert all(each["robot_0"]["time_left"] == 1.0 for each in run(endless, 3))


def test_teammates_are_where_they_are_seen_from_each_robot():
    env = lidarium.parallel_env("apartment", **SMALL, observe=["teammates"], starts="fixed")
    for observations in run(env, 5):
        poses = env.world.poses
        for row, agent in enumerate(env.possible_agents):
            others = [k for k in range(3) if k != row]
            table = observations[agent]["teammates"]
            assert table.shape == (2, 8)
            assert np.allclose(table[:, :2], poses[others, :2] - poses[row, :2], atol=1e-4)
            assert np.allclose(table[:, 2], poses[others, 2], atol=1e-6)
            assert (table[:, 3:7] == 0.0).all()
            assert (table[:, 7] == 1.0).all()


def test_goals_of_teammates_are_what_they_drive_to():
    env = lidarium.parallel_env("apartment", level="waypoint", **SMALL, observe=["teammates"], starts="fixed")
    env.reset(seed=3)
    action = {agent: np.array([0.05 * k, -0.1], np.float32) for k, agent in enumerate(env.possible_agents, 1)}
    observations = env.step(action)[0]
    poses = env.unwrapped.perception.poses
    for row, agent in enumerate(env.possible_agents):
        here = poses.pose_in_frame(row, row)[:2]
        for entry, other in zip(observations[agent]["teammates"], [k for k in range(3) if k != row], strict=True):
            target = env.driver.target(other)
            in_frame = np.array([target.x, target.y]) + poses.offset(other) - poses.offset(row)
            assert np.allclose(entry[3:5], in_frame - here, atol=1e-4)
            assert entry[5] == 1.0


def test_teammates_that_nobody_heard_are_zeros():
    unknown = lidarium.parallel_env("apartment", **SMALL, observe=["teammates"], known_starts=False, starts="fixed")
    assert not any(each["robot_0"]["teammates"].any() for each in run(unknown, 3))
    silent = lidarium.parallel_env("apartment", **SMALL, observe=["teammates"], radio="none", starts="fixed")
    assert not any(each["robot_0"]["teammates"].any() for each in run(silent, 3))


def test_news_of_teammates_age_where_the_radio_loses_them():
    radio = RadioSettings(kind="range", reach=50.0, loss=0.7)
    env = lidarium.parallel_env("apartment", **SMALL, observe=["teammates"], radio=radio, starts="fixed")
    ages = set()
    for observations in run(env, 30):
        for agent, observation in observations.items():
            known = env.belief(agent).teammates
            for entry, other in zip(
                observation["teammates"], [a for a in env.possible_agents if a != agent], strict=True
            ):
                assert bool(entry[7]) == (other in known)
                if other in known:
                    assert entry[6] == pytest.approx(known[other].age_s)
                    ages.add(round(float(entry[6]), 1))
    assert len(ages) > 2


def test_a_team_of_one_has_no_teammates_to_observe():
    with pytest.raises(ValueError, match="observe has 'teammates', which needs two robots or more"):
        lidarium.parallel_env("apartment", robots=1, observe=["teammates"])


@pytest.mark.usefixtures("nearest")
def test_a_function_of_ones_own_is_observed_and_clipped():
    env = lidarium.parallel_env("apartment", **SMALL, observe=["pose", "nearest"], starts="fixed")
    for observations in run(env, 5):
        for agent, observation in observations.items():
            assert env.observation_space(agent).contains(observation)
            assert 0.0 < observation["nearest"].min() <= observation["nearest"].max() <= 6.0


@pytest.mark.usefixtures("nearest")
@pytest.mark.parametrize("level", ["velocity", "frontier"])
def test_rows_of_a_batch_observe_the_same_to_the_bit(level):
    observe = ["pose", "nearest", *NEW]
    radio = RadioSettings(kind="range", reach=6.0, loss=0.3, latency_s=0.2)
    compare_rows(level, 2, 12, ["apartment", "clinic"], observe=observe, seed=4)
    compare_rows(level, 1, 12, ["apartment", "clinic"], observe=observe, radio=radio, robots=3, seed=5)


def test_a_function_of_another_shape_is_refused_by_name():
    observable("odd", 0.0, 1.0, (2,))(lambda rows: np.zeros(3))
    try:
        env = lidarium.parallel_env("scene_room", **SMALL, observe=["odd"], starts="fixed")
        with pytest.raises(ValueError, match=r"observable 'odd' has shape \(3,\); want \(3, 2\)"):
            env.reset(seed=0)
    finally:
        SENSED.unregister("odd")


def test_unknown_observables_are_refused_with_the_nearest():
    with pytest.raises(ValueError, match="unknown name 'teammate'; did you mean 'teammates'"):
        lidarium.parallel_env("apartment", observe=["teammate"])
