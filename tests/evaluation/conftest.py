"""A directory of episodes as `lidarium evaluate` writes it: a few short real runs, with records in a form
of their own."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import lidarium
from lidarium.envs.exploration import ExplorationEnv
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.result import result_of
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.watching import WatchedExploration
from lidarium.evaluation.record import Recorder
from lidarium.evaluation.truth.beliefs import team_log_odds

POLICIES = ("nearest_frontier", "random_walk", "utility_frontier")
SEEDS = (0, 1)


@dataclass(frozen=True)
class Display:
    """What the display track of a record is asked for."""

    times: np.ndarray
    poses: np.ndarray
    coverage: np.ndarray
    origin: tuple
    resolution: float
    levels: np.ndarray

    def map_at(self, time_s):
        assert time_s == self.times[-1]
        return self.levels


def save_display(path, episode, policy):
    env, scorer = episode.env, episode.env.scorer
    log_odds, origin = team_log_odds(env)
    header = {
        "version": lidarium.__version__,
        "floor": env.floor.name,
        "floor_sha256": env.floor.sha256,
        "policy": policy,
        "seed": episode.seed,
        "robots": env.settings.robots,
    }
    path.parent.mkdir(exist_ok=True, parents=True)
    np.savez_compressed(
        path,
        header=json.dumps(header),
        times=np.array([time for time, _ in scorer.track] + [scorer.time]),
        poses=np.stack([poses for _, poses in scorer.track] + [env.world.poses]),
        coverage=np.array(scorer.curve),
        origin=np.array(origin),
        resolution=env.settings.occupancy.resolution,
        levels=np.where(log_odds > 0, 0, np.where(log_odds < 0, 255, 127)).astype(np.uint8),
    )


def read_display(path):
    try:
        with np.load(path) as file:
            display = Display(
                file["times"],
                file["poses"],
                file["coverage"],
                tuple(file["origin"]),
                float(file["resolution"]),
                file["levels"],
            )
            return SimpleNamespace(header=json.loads(str(file["header"])), display=display)
    except (ValueError, EOFError) as error:
        raise ValueError(f"{path} is not a whole episode record: {error}") from error


def write_directory(folder, policies=POLICIES, seeds=SEEDS, floor="apartment", **options):
    chosen = {"robots": 2, "resolution": 0.05, "horizon_s": 40.0, **options}
    lines = []
    for policy in policies:
        for seed in seeds:
            episode = run_episode(
                lidarium.policy(policy), ExplorationEnv(floor, make_settings(**chosen)), seed
            )
            name = f"records/{floor.replace(':', '-')}-{chosen['robots']}-{policy}-{seed}.npz"
            lines.append(json.dumps({**result_of(episode, policy), "record": name}) + "\n")
            save_display(folder / name, episode, policy)
    with (folder / "episodes.jsonl").open("a") as file:
        file.writelines(lines)
    return folder


@pytest.fixture(scope="session")
def episodes_folder(tmp_path_factory) -> Path:
    """Three policies, two seeds each, two robots on the apartment, with records."""
    return write_directory(tmp_path_factory.mktemp("episodes"))


@pytest.fixture
def readable_records(monkeypatch):
    """Records are read in the form above."""
    monkeypatch.setattr("lidarium.evaluation.analysis.records.read_record", read_display)


@pytest.fixture(scope="session")
def rows(episodes_folder):
    return [json.loads(line) for line in (episodes_folder / "episodes.jsonl").read_text().splitlines()]


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
