"""A replay is sampled as the episode runs."""

import numpy as np
import pytest

import lidarium
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.watching import WatchedExploration
from lidarium.evaluation.report.page.map_layers import coarse
from lidarium.evaluation.report.page.replay_sampler import MOST_BEAMS, ReplaySampler
from lidarium.evaluation.truth.beliefs import maps_on_floor


def sampled(duration_s=5.0, **options):
    sampler = ReplaySampler(duration_s)
    settings = make_settings(**{"robots": 2, "resolution": 0.05, "horizon_s": 5.0, **options})
    env = WatchedExploration("apartment", settings, watchers=[sampler])
    run_episode(lidarium.policy("nearest_frontier"), env, 0)
    return sampler.finish(env), sampler, env


def test_maps_are_sampled_each_second_and_at_the_end_and_scans_more_often():
    samples, _, env = sampled()
    assert samples.map_times == pytest.approx([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 5.0])
    assert samples.scan_times == pytest.approx(np.arange(0.0, 5.0, 0.4).tolist())
    assert env.scorer.time == pytest.approx(5.0)
    together = maps_on_floor(env).sum(axis=0, dtype=np.int16)[samples.grid.window]
    assert np.array_equal(samples.team.levels, coarse(together > 0, together < 0, samples.grid.block))
    assert len(samples.own) == 2


def test_samples_of_a_long_episode_are_further_apart():
    samples, _, _ = sampled(duration_s=1200.0)
    assert samples.map_times == pytest.approx([0.0, 2.0, 4.0, 5.0])
    assert samples.scan_times[1] == pytest.approx(0.8)


def test_a_lone_robot_has_no_map_beside_the_teams_and_true_poses_are_not_believed():
    samples, sampler, env = sampled(robots=1)
    assert samples.own == []
    assert samples.believed == []
    angles = sampler.beam_angles(env)
    assert len(angles) == samples.scans[0].shape[1] <= MOST_BEAMS
    assert angles[0] == pytest.approx(env.settings.lidar.angles[0], abs=1e-5)
