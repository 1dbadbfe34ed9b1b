"""What is spent beside the episodes of an evaluation.

Costs are CPU time of one process, of episodes run one after the other: bare (environment and policy), with
the history for the metrics, with the record as well, and as a whole trial with its figures, its record and
its line on the disk. Ratios are taken episode by episode.
"""

import pkgutil
import statistics
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any
from unittest import mock

import lidarium
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.evaluation.episodes.history import History
from lidarium.evaluation.episodes.result import result_of
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.watching import WatchedExploration
from lidarium.evaluation.record import Recorder
from lidarium.evaluation.suites.campaign import EPISODES_FILE, run_trial
from lidarium.evaluation.suites.episodes_file import EpisodesFile
from lidarium.evaluation.suites.suite import Suite
from lidarium.evaluation.suites.trial import Trial

SETTINGS = {"resolution": 0.025, "stop_coverage": 0.99, "horizon_s": 900.0}
FLOORS = ("apartment", "building:17", "building:3000001")
POLICIES = ("nearest_frontier", "explore_lite")
TEAM = 3


def cost_suite() -> Suite:
    """Return the suite of the trials whose cost is measured."""
    return Suite(
        policies=POLICIES, floors=FLOORS, robots=(TEAM,), variants={"default": SETTINGS}, draws_starts=False
    )


def variants(plan: Suite, trial: Trial, folder: Path) -> dict[str, Callable[[], Any]]:
    """Return how a trial is run: bare, and each time with more beside the episode."""
    settings = plan.settings(trial.variant, trial.robots)

    def bare() -> None:
        run_episode(lidarium.policy(trial.policy), ExplorationEnv(trial.floor, settings), trial.seed)

    def measured() -> None:
        history = History()
        env = WatchedExploration(trial.floor, settings, watchers=[history])
        result_of(run_episode(lidarium.policy(trial.policy), env, trial.seed), trial.policy, history)

    def recorded() -> None:
        history, recorder = History(), Recorder(trial.policy, trial.seed, trial.floor)
        env = WatchedExploration(trial.floor, settings, watchers=[history, recorder])
        result_of(run_episode(lidarium.policy(trial.policy), env, trial.seed), trial.policy, history)
        recorder.finish()

    def whole_trial() -> None:
        line = run_trial(plan, trial, folder)
        with EpisodesFile(folder / EPISODES_FILE) as file:
            file.append({**line, "key": str(time.monotonic_ns())})

    return {"bare": bare, "measured": measured, "recorded": recorded, "whole trial": whole_trial}


class Parts:
    """Times environment, episode, figures and record: what is not the runner's own."""

    TIMED = (
        "lidarium.evaluation.episodes.watching.WatchedExploration",
        "lidarium.evaluation.episodes.runner.run_episode",
        "lidarium.evaluation.episodes.result.result_of",
        "lidarium.evaluation.record.write_record",
        "lidarium.evaluation.record.Recorder.finish",
    )

    def __init__(self) -> None:
        self.seconds = 0.0

    def timed(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return a function that does the same and notes how long it takes."""

        def run(*arguments: Any, **named: Any) -> Any:  # noqa: ANN401
            began = time.process_time()
            try:
                return function(*arguments, **named)
            finally:
                self.seconds += time.process_time() - began

        return run


def own_share(run: Callable[[], Any]) -> float:
    """Return the runner's own share of a whole trial [%].

    That is what is neither environment nor episode, figures or record.
    """
    parts = Parts()
    with ExitStack() as stack:
        for name in Parts.TIMED:
            stack.enter_context(mock.patch(name, parts.timed(pkgutil.resolve_name(name))))
        began = time.process_time()
        run()
        whole = time.process_time() - began
    return 100.0 * (whole - parts.seconds) / whole


def cost_of(plan: Suite, trial: Trial, rounds: int) -> dict[str, Any]:
    """Measure what a trial spends beside its episode.

    Figures are medians over rounds, shares are in percent of the bare episode.
    """
    seconds: dict[str, list[float]] = {}
    shares: list[float] = []
    with tempfile.TemporaryDirectory() as name:
        for turn in range(rounds + 1):
            folder = Path(name) / f"{trial.file_name}-{turn}"
            contenders = variants(plan, trial, folder)
            shares.append(own_share(contenders["whole trial"]))
            for variant, run in contenders.items():
                began = time.process_time()
                run()
                if turn:
                    seconds.setdefault(variant, []).append(time.process_time() - began)
    share = {
        variant: [100.0 * value / least for value, least in zip(values, seconds["bare"], strict=True)]
        for variant, values in seconds.items()
    }
    differences = (("measured", "bare"), ("recorded", "measured"), ("whole trial", "bare"))
    return {
        "floor": trial.floor,
        "policy": trial.policy,
        "bare_ms": 1e3 * statistics.median(seconds["bare"]),
        "beside_percent": [
            statistics.median([a - b for a, b in zip(share[more], share[less], strict=True)])
            for more, less in differences
        ],
        "own_percent": statistics.median(shares[1:]),
    }
