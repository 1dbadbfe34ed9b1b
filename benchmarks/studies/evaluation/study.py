"""What an evaluation costs, what two workers gain, and what survives kills."""

import statistics
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from lidarium.benchmarks.speed.harness.report import about, heading
from lidarium.benchmarks.studies.evaluation.costs import TEAM, cost_of, cost_suite
from lidarium.benchmarks.studies.evaluation.programs import gain_of_workers, kills
from lidarium.benchmarks.studies.shared.kept import Progress, do_missing, kept_lines
from lidarium.benchmarks.studies.shared.study import Study
from lidarium.evaluation.suites.suite import Suite
from lidarium.evaluation.suites.trial import Trial

ROUNDS = 3
"""Repeats of every measurement of cost."""

SEEDS, WORKER_ROUNDS = 20, 1
"""Seeds of the suite on which workers are compared, and how often they are."""

KILLS = 50
COSTS_FILE, WORKERS_FILE, KILLS_FILE = "costs.jsonl", "workers.jsonl", "kills.jsonl"


@dataclass(frozen=True, slots=True)
class Comparison:
    """One round in which two workers are compared with one."""

    seeds: int
    turn: int

    @property
    def key(self) -> str:
        """Name that no other one of its file has."""
        return f"{self.seeds} seeds | round {self.turn}"


@dataclass(frozen=True, slots=True)
class Kills:
    """An evaluation that is killed a number of times."""

    count: int

    @property
    def key(self) -> str:
        """Name that no other one of its file has."""
        return f"{self.count} kills"


def work(folder: Path, _data: Path | None, every: int, _workers: int) -> Progress:
    """Measure costs of every N-th trial, compare workers and kill an evaluation.

    Workers are compared with every N-th seed, and one N-th of the kills is made. All is done in this process
    or in programs of its own, one after the other.
    """
    plan = cost_suite()
    trials = list(plan.trials())[::every]
    yield from do_missing(folder / COSTS_FILE, "costs of trials", trials, partial(_cost, plan), 1)
    seeds, count = (len(range(0, whole, every)) for whole in (SEEDS, KILLS))
    rounds = [Comparison(seeds, turn) for turn in range(WORKER_ROUNDS)]
    yield from do_missing(folder / WORKERS_FILE, "comparisons of workers", rounds, _compare, 1)
    yield from do_missing(folder / KILLS_FILE, "killed evaluations", [Kills(count)], _kill, 1)


def _cost(plan: Suite, trial: Trial) -> dict[str, Any]:
    return cost_of(plan, trial, ROUNDS)


def _compare(comparison: Comparison) -> dict[str, Any]:
    gain, episodes = gain_of_workers(comparison.seeds)
    return {"gain": gain, "episodes": episodes}


def _kill(task: Kills) -> dict[str, Any]:
    killed, kept = kills(task.count)
    return {"killed": killed, "kept": kept}


def _row(line: Mapping[str, Any]) -> str:
    """Return a line of the table of costs."""
    cells = [f"{value:+.1f} %" for value in line["beside_percent"]] + [f"{line['own_percent']:.2f} %"]
    return f"| {line['floor']}, {line['policy']} | {line['bare_ms']:.0f} | {' | '.join(cells)} |"


def page(folder: Path, command: str) -> str:
    """Return the results as markdown."""
    compared = kept_lines(folder / WORKERS_FILE)
    gains, episodes = [line["gain"] for line in compared], compared[-1]["episodes"]
    [survived] = kept_lines(folder / KILLS_FILE)
    gain = statistics.median(gains)
    lines = [
        *heading("Evaluation", about(command)),
        "",
        "## What is spent beside the episodes",
        "",
        "| floor, policy | episode, bare [ms] | metrics | record | all | of which the runner's own |",
        "|---|---:|---:|---:|---:|---:|",
        *(_row(line) for line in kept_lines(folder / COSTS_FILE)),
        "",
        f"CPU time of one process, {TEAM} robots, maps of 2.5 cm, medians over {ROUNDS} rounds of ratios to "
        "the bare episode "
        "(environment and policy alone). *Metrics*: the history that watches, and all figures of the line. "
        "*Record*: recording, without "
        "writing. *All*: the whole trial of a campaign, with its record written. *The runner's own* is what "
        "of the whole trial is neither "
        "environment nor episode, figures or record: settings, starts, the line on the disk; to reach: 3 %.",
        "",
        "## Workers",
        "",
        f"Two workers are {gain:.2f} x as fast as one ({min(gains):.2f} to {max(gains):.2f}; to reach: 1.9 "
        f"x) on {episodes} episodes, "
        "programs of their own with all that they load: " + ("reached." if gain >= 1.9 else "not reached."),
        "",
        "## Killed",
        "",
        f"An evaluation with two workers was killed (SIGKILL) {survived['killed']} times, 1 to 6 s after its "
        "start, and gone on with each "
        f"time: {survived['kept']} episodes in the end, none lost, none doubled, none changed.",
        "",
    ]
    return "\n".join(lines)


STUDY = Study(page, work=work)
