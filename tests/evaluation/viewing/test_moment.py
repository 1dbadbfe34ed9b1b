"""A moment is the truth and the beliefs of that time, in the floor's frame."""

import math

import numpy as np
import pytest

import lidarium
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.watching import WatchedExploration, Watcher
from lidarium.evaluation.viewing.moment import body_rotation, moment_of


class Moments(Watcher):
    def __init__(self):
        self.kept = []

    def step(self, env, commands):
        self.kept.append(moment_of(env))


@pytest.fixture(scope="module", params=[True, False], ids=["known starts", "unknown starts"])
def run(request):
    settings = make_settings(robots=2, horizon_s=10.0, resolution=0.05, known_starts=request.param)
    moments = Moments()
    env = WatchedExploration("apartment", settings, watchers=[moments])
    run_episode(lidarium.policy("nearest_frontier_own_map"), env, 1)
    return env, moments.kept


def test_beams_that_met_something_end_at_walls(run):
    env, moments = run
    raster = env.world.floors[0].laser
    solid = np.argwhere(raster.solid != 0)[:, ::-1] * raster.resolution + raster.origin
    for robot in moments[40].robots:
        hits = robot.ends[robot.is_hit]
        assert len(hits) > 30
        assert np.allclose(hits[:, 2], env.settings.lidar.height)
        near = [np.hypot(*(solid - hit).T).min() for hit in hits[::10, :2]]
        others = moments[40].robots
        beside = [min(np.hypot(*(hit - each.pose[:2])) for each in others) for hit in hits[::10, :2]]
        assert all(d < 0.06 or b < 0.25 for d, b in zip(near, beside, strict=True))


def test_true_poses_are_believed_where_they_are(run):
    _, moments = run
    for moment in moments:
        for robot in moment.robots:
            off = robot.believed - robot.pose
            assert np.allclose(off[:2], 0.0, atol=1e-9)
            assert math.cos(off[2]) == pytest.approx(1.0)


def test_plans_lead_from_the_robot_to_its_goal(run):
    _, moments = run
    planned = [robot for moment in moments for robot in moment.robots if len(robot.plan) > 1]
    assert len(planned) > 50
    for robot in planned:
        assert np.allclose(robot.plan[0], robot.believed[:2])
        assert np.hypot(*(robot.plan[-1] - robot.goal)) < 0.5


def test_a_trail_ends_where_the_robot_is(run):
    _, moments = run
    for robot in moments[-1].robots:
        assert np.array_equal(robot.trail[-1], robot.pose[:2])
        assert len(robot.trail) > 10


def test_who_has_ended_plans_nothing(run):
    env, _ = run
    assert not env.agents
    assert all(robot.goal is None and robot.has_ended for robot in moment_of(env).robots)


def test_a_body_is_turned_by_roll_then_pitch_then_yaw():
    turned = body_rotation(np.array([0.0, 0.0, math.pi / 2]), np.array([0.0, math.pi / 2, 0.0]))
    assert np.allclose(turned.apply((0.0, 1.0, 0.0)), (0.0, 0.0, 1.0))
    assert np.allclose(turned.apply((1.0, 0.0, 0.0)), (0.0, 1.0, 0.0))
