"""Those who watch see every step of the world, and change nothing."""

import numpy as np

import lidarium
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.watching import WatchedExploration, Watcher

SETTINGS = make_settings(robots=2, horizon_s=12.0)


class Log(Watcher):
    """Notes what it is shown."""

    def __init__(self):
        self.seen = []

    def begin(self, env):
        self.seen.append(("begin", env.scorer.time))

    def step(self, env, commands):
        assert commands.shape == (2, 2)
        self.seen.append(("step", env.scorer.time))

    def outcome(self, env):
        self.seen.append(("outcome", len(env.agents)))


def test_every_step_is_shown_whatever_the_level_of_the_policy():
    log = Log()
    run_episode(lidarium.policy("nearest_frontier"), WatchedExploration("apartment", SETTINGS, watchers=[log]), seed=3)
    assert log.seen[0] == ("begin", 0.0)
    assert np.allclose([time for kind, time in log.seen if kind == "step"], 0.1 * np.arange(1, 121))
    assert log.seen[-1] == ("outcome", 0)


def test_a_watched_episode_is_the_same_to_the_bit():
    watched, unwatched = (
        WatchedExploration("apartment", SETTINGS, watchers=[Log()]),
        ExplorationEnv("apartment", SETTINGS),
    )
    for env in (watched, unwatched):
        run_episode(lidarium.policy("nearest_frontier"), env, seed=3)
    np.testing.assert_array_equal(watched.world.poses, unwatched.world.poses)
    np.testing.assert_array_equal(watched.simulation.beliefs.log_odds, unwatched.simulation.beliefs.log_odds)
