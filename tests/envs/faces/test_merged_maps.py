import math

import numpy as np
import pytest

import lidarium
from lidarium.envs.faces.merged_maps import MergedMaps, MergeEvent, MergingSettings
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.result import result_of
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.metrics.merges import merge_figures
from lidarium.mapping.geometry.rigid import Transform

STARTS = [(2.4, 4.0, 0.0), (3.3, 4.5, 1.2)]
APART = np.eye(2, dtype=bool)


def team(known_starts=False, **options):
    chosen = {
        "robots": 2,
        "resolution": 0.05,
        "horizon_s": 6.0,
        "map_cells": 64,
        "observe": ["pose", "map"],
        **options,
    }
    return ExplorationEnv("apartment", make_settings(known_starts=known_starts, **chosen))


def driven(env, steps=20):
    env.reset(seed=3, options={"starts": STARTS})
    for _ in range(steps):
        outcome = env.step({agent: np.array([0.3, 0.8], np.float32) for agent in env.agents})
    return outcome


def test_told_frames_give_the_teammates_true_poses_and_the_union_of_maps():
    env = MergedMaps(team(), MergingSettings(known_starts=True))
    observations, *_, infos = driven(env)
    frames = [Transform(*start) for start in env.unwrapped.world.starts.tolist()]
    poses = [Transform(*pose) for pose in env.unwrapped.world.poses.tolist()]
    x, y, theta, age, known = observations["robot_0"]["teammates"][0]
    true = frames[0].inverse() @ poses[1]
    assert (x, y) == pytest.approx((true.x, true.y), abs=1e-5)
    assert math.remainder(theta - true.theta, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-5)
    assert (age, known) == (0.0, 1.0)
    own, of_team = observations["robot_0"]["map"], observations["robot_0"]["team_map"]
    assert np.count_nonzero(of_team != 127) > np.count_nonzero(own != 127)
    assert infos["robot_0"]["truth"]["merges"] == []
    assert env.events[0].found == env.events[0].true


def test_robots_that_cannot_talk_know_nothing_of_each_other():
    for can_talk in (APART, lambda time_s, poses: APART):
        observations = driven(MergedMaps(team(), MergingSettings(known_starts=True), can_talk))[0]
        for observation in observations.values():
            assert not observation["teammates"].any()
            np.testing.assert_array_equal(observation["team_map"], observation["map"])


def test_news_grow_old_when_the_link_is_lost():
    def early(time_s, poses):
        return np.ones((2, 2), bool) if time_s < 0.5 else APART

    observations = driven(MergedMaps(team(), MergingSettings(period_s=0.2, known_starts=True), early), 15)[0]
    age, known = observations["robot_1"]["teammates"][0, 3:]
    assert known == 1.0
    assert age == pytest.approx(1.1, abs=1e-5)


def test_news_are_passed_on():
    links = np.array([[1, 1, 0], [0, 1, 1], [0, 0, 1]], bool)
    env = MergedMaps(team(robots=3), MergingSettings(known_starts=True), links)
    observations, infos = env.reset(seed=1)
    assert (observations["robot_0"]["teammates"][:, 4] == 1.0).all()
    assert infos["robot_0"]["merges"] == ["robot_1", "robot_2"]


def test_maps_are_exchanged_at_the_period_alone():
    env = MergedMaps(team(), MergingSettings(period_s=0.5, known_starts=True))
    env.reset(seed=3, options={"starts": STARTS})
    ages = [
        env.step({agent: np.zeros(2, np.float32) for agent in env.agents})[0]["robot_0"]["teammates"][0, 3]
        for _ in range(7)
    ]
    np.testing.assert_allclose(ages, [0.1, 0.2, 0.3, 0.4, 0.0, 0.1, 0.2], atol=1e-5)


def test_known_starts_of_the_environment_are_understood_too():
    env = MergedMaps(team(known_starts=True), MergingSettings(known_starts=True))
    observations = driven(env)[0]
    belief = env.unwrapped.belief("robot_0").teammates["robot_1"].pose
    np.testing.assert_allclose(observations["robot_0"]["teammates"][0, :3], belief, atol=1e-5)


@pytest.mark.parametrize(("confirms", "horizon_s"), [(False, 8.0), (True, 30.0)])
def test_robots_that_start_in_one_room_find_each_other(confirms, horizon_s):
    env = team(horizon_s=horizon_s, noise="datasheet", resolution=0.025, map_cells=256, observe=["pose"])
    starts = {"starts": STARTS}
    merging = MergingSettings(confirms=confirms)
    episode = run_episode(lidarium.policy("nearest_frontier"), env, 2, starts, merging=merging)
    figures = result_of(episode)["merges"]
    assert figures["false"] == 0
    assert figures["accepted"] == figures["correct"] >= 1
    assert figures["first_correct_s"] == episode.merges[0].time_s


def test_figures_tell_right_merges_from_wrong_ones():
    pose = (1.0, 2.0, 0.5)
    events = [
        MergeEvent(3.0, "a", "b", pose, pose, (0.0, 0.0)),
        MergeEvent(1.0, "a", "c", (1.2, 2.0, 0.5), pose, (0.0, 0.0)),
        MergeEvent(2.0, "b", "c", pose, pose, (0.0, 0.0)),
    ]
    figures = merge_figures(events, 0.05)
    assert figures == {
        "accepted": 3,
        "correct": 2,
        "false": 1,
        "off": 0,
        "worst_m": 0.2,
        "worst_rad": 0.0,
        "wrong": 0,
        "worst_here_m": 0.2,
        "worst_here_rad": 0.0,
        "first_correct_s": 2.0,
    }
    assert merge_figures([], 0.05)["worst_m"] is None
    far = MergeEvent(1.0, "a", "c", (1.31, 2.0, 0.5), pose, (0.0, 0.0))
    turned = MergeEvent(1.0, "a", "c", (1.0, 2.0, 0.56), pose, (0.0, 0.0))
    assert merge_figures([*events, far, turned], 0.05)["wrong"] == 2


def test_bad_wrappings_are_refused():
    with pytest.raises(ValueError, match="two or more"):
        MergedMaps(team(robots=1))
    with pytest.raises(ValueError, match="can_talk has shape"):
        MergedMaps(team(), can_talk=np.ones((3, 3), bool))
    with pytest.raises(ValueError, match="period_s"):
        MergingSettings(period_s=0.0)


@pytest.mark.parametrize("form", [{"observation": "flat"}, {"infos": "none"}, {"ended_agents": "zeros"}])
def test_forms_that_it_cannot_add_to_are_refused_at_once(form):
    (name,) = form
    with pytest.raises(ValueError, match=f"{name} is .*; MergedMaps wants"):
        MergedMaps(lidarium.parallel_env("apartment", robots=2, **form))
