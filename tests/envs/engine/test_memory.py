"""What is dropped is gone at once: of objects that hold each other, Python collects many small ones sooner
than few large maps."""

import gc
import weakref

import pytest

import lidarium
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.history import History
from lidarium.evaluation.episodes.result import result_of
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.watching import WatchedExploration


@pytest.fixture
def no_collection():
    gc.collect()
    gc.disable()
    yield
    gc.enable()


def parts_of(env):
    return [weakref.ref(part) for part in (env, env.perception, env.world)]


def run(policy, **settings):
    history = History()
    env = WatchedExploration(
        "apartment", make_settings(robots=2, resolution=0.05, horizon_s=6.0, **settings), watchers=[history]
    )
    result_of(run_episode(lidarium.policy(policy), env, 0), policy, history)
    return parts_of(env)


CASES = [
    ("nearest_frontier", {}),
    ("supervised", {"realism": "lab", "known_starts": False}),
    ("supervised", {"known_starts": False, "radio": "range", "localization": "slam"}),
    ("srt", {"localization": "splines"}),
    ("random_walk", {"radio": "line_of_sight", "battery": "kobuki"}),
]


@pytest.mark.parametrize(("policy", "settings"), CASES)
def test_an_episode_leaves_nothing_behind(no_collection, policy, settings):
    # The first run may compile, and the compiler keeps what it was called with for a while.
    run(policy, **settings)
    gc.collect()
    assert [part() for part in run(policy, **settings)] == [None, None, None]


@pytest.mark.parametrize("level", ["velocity", "waypoint", "frontier"])
def test_a_batch_leaves_nothing_behind(no_collection, level):
    def made():
        env = lidarium.vector_env(2, "apartment", level=level, robots=2, starts="fixed")
        env.reset(seed=0)
        return [weakref.ref(part) for part in (env.batch, env.engine.perception, env.engine.world)]

    made()
    gc.collect()
    assert [part() for part in made()] == [None, None, None]


def test_an_environment_that_was_only_reset_leaves_nothing_behind(no_collection):
    def made():
        env = ExplorationEnv("apartment", make_settings(robots=2, radio="range", localization="slam", resolution=0.05))
        env.reset(seed=0)
        return parts_of(env)

    made()
    gc.collect()
    assert [part() for part in made()] == [None, None, None]
