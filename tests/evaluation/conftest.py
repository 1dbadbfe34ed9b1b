"""A directory of episodes as `lidarium evaluate` writes it: a few short real runs, with their records."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

import lidarium
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.result import result_of
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.watching import WatchedExploration
from lidarium.evaluation.record import Recorder, write_record

POLICIES = ("nearest_frontier", "random_walk", "utility_frontier")
SEEDS = (0, 1)


def write_directory(folder, policies=POLICIES, seeds=SEEDS, floor="apartment", **options):
    chosen = {"robots": 2, "resolution": 0.05, "horizon_s": 40.0, **options}
    lines = []
    for policy in policies:
        for seed in seeds:
            recorder = Recorder(policy, seed, floor)
            env = WatchedExploration(floor, make_settings(**chosen), watchers=[recorder])
            episode = run_episode(lidarium.policy(policy), env, seed)
            name = f"records/{floor.replace(':', '-')}-{chosen['robots']}-{policy}-{seed}.npz"
            lines.append(json.dumps({**result_of(episode, policy), "record": name}) + "\n")
            write_record(folder / name, recorder.finish())
    with (folder / "episodes.jsonl").open("a") as file:
        file.writelines(lines)
    return folder


@pytest.fixture(scope="session")
def episodes_folder(tmp_path_factory) -> Path:
    """Three policies, two seeds each, two robots on the apartment, with records."""
    return write_directory(tmp_path_factory.mktemp("episodes"))


@pytest.fixture(scope="session")
def rows(episodes_folder):
    return [json.loads(line) for line in (episodes_folder / "episodes.jsonl").read_text().splitlines()]


@pytest.fixture
def row(rows):
    """Makes an episode of one robot out of a real one."""

    def make(policy="a", seed=0, floor="apartment", **changes):
        base = {
            "policy": policy,
            "seed": seed,
            "floor": floor,
            "robots": 1,
            "horizon_s": 100.0,
            "time_s": 100.0,
            "ended_because": {"robot_0": "horizon"},
        }
        return {**rows[0], **base, "path_m": [10.0 + seed], "t90_s": None, "t99_s": None, **changes}

    return make


@pytest.fixture
def directory_of(tmp_path):
    """Writes given rows as a directory."""

    def write(rows, tail=""):
        (tmp_path / "episodes.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows) + tail)
        return tmp_path

    return write


def run_recorded(policy="nearest_frontier", floor="apartment", seed=3, options=None, watchers=(), **settings):
    """Return the record of an episode and its environment."""
    name = policy if isinstance(policy, str) else type(policy).__name__
    recorder = Recorder(name, seed, floor if isinstance(floor, str) else None)
    env = WatchedExploration(floor, make_settings(**{"robots": 2, **settings}), watchers=[recorder, *watchers])
    run_episode(lidarium.policy(policy) if isinstance(policy, str) else policy, env, seed, options)
    return recorder.finish(), env


@pytest.fixture(scope="session")
def recorded() -> Callable:
    return run_recorded


@pytest.fixture(scope="session")
def apartment_record():
    """A whole episode of three robots that cover the apartment."""
    return run_recorded(robots=3)[0]
