"""Episodes that were recorded, for the tests of records."""

from collections.abc import Callable

import pytest

import lidarium
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.watching import WatchedExploration
from lidarium.evaluation.record import Recorder


def run_recorded(policy="nearest_frontier", floor="apartment", seed=3, options=None, watchers=(), **settings):
    """Return the record of an episode and its environment."""
    name = policy if isinstance(policy, str) else type(policy).__name__
    recorder = Recorder(name, seed, floor if isinstance(floor, str) else None)
    env = WatchedExploration(
        floor, make_settings(**{"robots": 2, **settings}), watchers=[recorder, *watchers]
    )
    run_episode(lidarium.policy(policy) if isinstance(policy, str) else policy, env, seed, options)
    return recorder.finish(), env


@pytest.fixture(scope="session")
def recorded() -> Callable:
    return run_recorded


@pytest.fixture(scope="session")
def apartment_record():
    """A whole episode of three robots that cover the apartment."""
    return run_recorded(robots=3)[0]
