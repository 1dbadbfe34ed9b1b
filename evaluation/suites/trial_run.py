"""Runs one trial of a suite, and keeps its record."""

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lidarium.agents.policy import settings_for
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.evaluation.suites.episodes_file import KEY
from lidarium.evaluation.suites.starts import drawn_starts
from lidarium.evaluation.suites.suite import Suite
from lidarium.evaluation.suites.trial import Trial
from lidarium.mapping.files.output import whole_file

if TYPE_CHECKING:
    from lidarium.evaluation.record import EpisodeRecord


BOUND_COVERAGE = 0.99
"""Share of the floor that bounds are computed for."""


def beside_bound(
    trial: Trial, settings: ExplorationSettings, result: dict[str, Any], image_resolution: float | None
) -> dict[str, Any]:
    """Return how soon a team that knew the floor could have seen 99 %, and the episode's time over that."""
    from lidarium.envs.floors.catalogue.names import load_floor
    from lidarium.evaluation.bounds.bound import known_floor_bound

    starts = result["starts"]
    wanted = replace(settings, stop_coverage=BOUND_COVERAGE)
    bound = known_floor_bound(load_floor(trial.floor, image_resolution), wanted, starts).time_s
    reached = result["t99_s"]
    return {
        "bound_s": round(bound, 6) if math.isfinite(bound) else None,
        "t99_over_bound": round(reached / bound, 6) if reached is not None and math.isfinite(bound) else None,
    }


RECORDS_FOLDER = "records"


class RecordNotWrittenError(OSError):
    """Raised if a record cannot be written; the next ones could not be either."""


def run_trial(suite: Suite, trial: Trial, records: Path | None = None) -> dict[str, Any]:
    """Run one episode and return its line.

    Its record is written before, if a folder is given and the level is not ``graph``.
    """
    from lidarium.evaluation.episodes.history import History
    from lidarium.evaluation.episodes.result import result_of
    from lidarium.evaluation.episodes.runner import run_episode
    from lidarium.evaluation.episodes.stop_rules import STOP_REASON, Stopper, stop_rule_of
    from lidarium.evaluation.episodes.watching import WatchedExploration
    from lidarium.evaluation.record import Recorder

    began = time.perf_counter()
    policy = suite.make_policy(trial.policy)
    if (suite.run_options(trial.variant).get("level") or policy.level) == "graph":
        records = None  # a record runs again by speeds, which moves along edges do not have
    settings = settings_for(policy, suite.settings(trial.variant, trial.robots))
    history = History()
    image_resolution = suite.pixel_side(trial.floor)
    recorder = Recorder(trial.policy, trial.seed, trial.floor, image_resolution)
    env = WatchedExploration(
        trial.floor, settings, image_resolution, [history] if records is None else [history, recorder]
    )
    rule = stop_rule_of(suite.stop, trial.robots)
    starts = suite.starts_of(trial) or (
        drawn_starts(trial.floor, settings, trial.seed, image_resolution) if suite.draws_starts else None
    )
    options = None if starts is None else {"starts": starts}
    episode = run_episode(
        policy,
        env,
        trial.seed,
        options,
        None if rule is None else Stopper(rule, history),
        **suite.run_options(trial.variant),
    )
    result = result_of(episode, trial.policy, history)
    if rule is not None and rule.figure is not None:
        result["success"] = rule.is_reached(env, history)
    if records is not None:
        _keep_record(records / f"{trial.file_name}.npz", recorder.finish())
    where = [[round(float(number), 6) for number in start] for start in env.world.starts]
    record = None if records is None else f"{RECORDS_FOLDER}/{trial.file_name}.npz"
    setup = suite.setup_sha256(trial.policy, trial.variant)
    about = {KEY: trial.key, "variant": trial.variant, "starts": where, "record": record, "setup_sha256": setup}
    if suite.bounds:
        try:
            result |= beside_bound(trial, settings, {**about, **result}, image_resolution)
        except Exception as error:  # the episode is not lost
            result |= {"bound_s": None, "t99_over_bound": None}
            result.setdefault("failed_metrics", {})["bound_s"] = f"{type(error).__name__}: {error}"
    return {
        **about,
        **result,
        # The last call only carries out what a stop rule has ordered.
        "decisions": len(episode.decision_seconds) - (STOP_REASON in result["ended_because"].values()),
        "wall_s": round(time.perf_counter() - began, 4),
    }


def write_record_bytes(path: Path, content: bytes) -> None:
    """Write a record that another machine has made, whole or not at all."""
    with _kept(path), whole_file(path) as beside:
        beside.write_bytes(content)


def _keep_record(path: Path, record: "EpisodeRecord") -> None:
    from lidarium.evaluation.record import write_record

    with _kept(path):
        write_record(path, record)


@contextmanager
def _kept(path: Path) -> Iterator[None]:
    """Name the episodes that are kept if a record cannot be written."""
    try:
        yield
    except OSError as error:
        raise RecordNotWrittenError(
            error.errno,
            f"{error.strerror or error}; the episodes before are kept, the same command goes on from there",
            str(path),
        ) from error
