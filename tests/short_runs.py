"""Runs of a moment, for what is written of them."""

import lidarium
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.watching import WatchedExploration


def short_run(policy="nearest_frontier", watchers=(), **options):
    """Return an episode on the apartment of two seconds."""
    settings = make_settings(**{"robots": 2, "resolution": 0.05, "horizon_s": 2.0, **options})
    env = WatchedExploration("apartment", settings, watchers=list(watchers))
    return run_episode(lidarium.policy(policy), env, 0)
