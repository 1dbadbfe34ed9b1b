"""The costs and robustness of an evaluation.

Measured are costs beside its episodes, two workers against one, and what survives a killed program.

    python benchmarks/studies/evaluation.py                                   # prints the tables
    python benchmarks/studies/evaluation.py --out docs/results/evaluation.md  # and writes them

Costs are CPU time of one process, of episodes run in turn: bare (environment and policy), with the history
for the metrics, with the record as well, and as a whole trial with its figures, its record and its line on
the disk. Ratios are taken episode by episode.
"""

import argparse
import pkgutil
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

import lidarium
from lidarium.benchmarks.speed.harness.report import about, heading
from lidarium.envs.exploration import ExplorationEnv
from lidarium.evaluation.episodes.history import History
from lidarium.evaluation.episodes.output import check_writable, write_text
from lidarium.evaluation.episodes.result import result_of
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.watching import WatchedExploration
from lidarium.evaluation.record import Recorder
from lidarium.evaluation.suites.campaign import EPISODES_FILE, Campaign, run_trial
from lidarium.evaluation.suites.episodes_file import EpisodesFile, read_episodes
from lidarium.evaluation.suites.suite import Suite, Trial

SETTINGS = {"resolution": 0.025, "stop_coverage": 0.99, "horizon_s": 900.0}
FLOORS = ("apartment", "building:17", "building:3000001")
POLICIES = ("nearest_frontier", "explore_lite")
TEAM = 3
KILLS = 50


def suite(seeds: int, floors: tuple[str, ...] = FLOORS) -> Suite:
    """Return the suite that is measured."""
    return Suite(
        policies=POLICIES,
        floors=floors,
        robots=(TEAM,),
        seeds=tuple(range(seeds)),
        variants={"default": SETTINGS},
    )


def ways(plan: Suite, trial: Trial, folder: Path) -> dict[str, Callable[[], Any]]:
    """Return the functions that run a trial.

    Each has more beside the episode than the one before.
    """
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
    """A timer of the parts of a trial that are not the runner's own.

    The parts are environment, episode, figures and record.
    """

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
    """Return the runner's own share of a whole trial, in percent.

    It is what is neither environment nor episode, figures or record.
    """
    parts = Parts()
    with ExitStack() as stack:
        for name in Parts.TIMED:
            stack.enter_context(mock.patch(name, parts.timed(pkgutil.resolve_name(name))))
        began = time.process_time()
        run()
        whole = time.process_time() - began
    return 100.0 * (whole - parts.seconds) / whole


def costs(rounds: int) -> list[str]:
    """Measure what is spent beside the episodes; returns lines of a table."""
    plan = Suite(
        policies=POLICIES, floors=FLOORS, robots=(TEAM,), variants={"default": SETTINGS}, draws_starts=False
    )
    lines = [
        "| floor, policy | episode, bare [ms] | metrics | record | all | of which the runner's own |",
        "|---|---:|---:|---:|---:|---:|",
    ]
    with tempfile.TemporaryDirectory() as name:
        for trial in plan.trials():
            seconds: dict[str, list[float]] = {}
            shares: list[float] = []
            for turn in range(rounds + 1):
                folder = Path(name) / f"{trial.file_name}-{turn}"
                contenders = ways(plan, trial, folder)
                shares.append(own_share(contenders["whole trial"]))
                for way, run in contenders.items():
                    began = time.process_time()
                    run()
                    if turn:
                        seconds.setdefault(way, []).append(time.process_time() - began)
            share = {
                way: [100.0 * value / least for value, least in zip(values, seconds["bare"], strict=True)]
                for way, values in seconds.items()
            }
            differences = (("measured", "bare"), ("recorded", "measured"), ("whole trial", "bare"))
            cells = [
                f"{statistics.median([a - b for a, b in zip(share[more], share[less], strict=True)]):+.1f} %"
                for more, less in differences
            ]
            cells.append(f"{statistics.median(shares[1:]):.2f} %")
            lines.append(
                f"| {trial.floor}, {trial.policy} | {1e3 * statistics.median(seconds['bare']):.0f} | "
                f"{' | '.join(cells)} |"
            )
            print(lines[-1], flush=True)
    return lines


def run_suite(seeds: int, folder: str, workers: int) -> None:
    """Run the suite into a folder; what a program of its own does."""
    for _ in Campaign(suite(seeds), Path(folder), workers).run():
        pass


def gain_of_workers(seeds: int, rounds: int) -> tuple[list[float], int]:
    """Return how much faster two workers are than one, round by round.

    The number of episodes of a round is returned, too.

    Each is a program of its own, which has to start and to load its kernels, as an evaluation from the
    command line has.
    """
    gains, finished = [], 0
    for _ in range(rounds):
        seconds = []
        for workers in (1, 2):
            with tempfile.TemporaryDirectory() as name:
                code = (
                    f"from lidarium.benchmarks.studies.evaluation import run_suite; run_suite({seeds}, "
                    f"{name!r}, {workers})"
                )
                began = time.perf_counter()
                subprocess.run([sys.executable, "-c", code], check=True)
                seconds.append(time.perf_counter() - began)
                finished = len(read_episodes(Path(name) / EPISODES_FILE))
        gains.append(seconds[0] / seconds[1])
        print(f"one worker {seconds[0]:.1f} s, two {seconds[1]:.1f} s, {finished} episodes", flush=True)
    return gains, finished


def kills(count: int) -> tuple[int, int]:
    """Kill an evaluation at random moments until it is through.

    Returns how often it was killed, and its episodes.

    Raises
    ------
    RuntimeError
        Where an episode was lost, doubled or changed.
    """
    generator = np.random.default_rng(0)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        command = [
            sys.executable,
            "-c",
            "from lidarium.scripts.main import main; import sys; sys.exit(main())",
            "evaluate",
            "--policies",
            "random_walk",
            "nearest_frontier",
            "--floors",
            "apartment",
            "--robots",
            "1",
            "2",
            "--seeds",
            "800",
            "--horizon-s",
            "20",
            "--map-resolution",
            "0.05",
            "--workers",
            "2",
            "--out",
            str(folder),
        ]
        before: list[dict[str, Any]] = []
        for kill in range(count):
            process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            time.sleep(generator.uniform(1.0, 6.0))
            process.send_signal(signal.SIGKILL)
            process.wait()
            after = read_episodes(folder / EPISODES_FILE)
            if after[: len(before)] != before:
                raise RuntimeError(f"episodes were lost or changed by kill {kill + 1}")
            if process.returncode == 0:
                raise RuntimeError(f"the evaluation was through before kill {kill + 1}; give it more seeds")
            if len({line["key"] for line in after}) != len(after):
                raise RuntimeError(f"episodes were doubled by kill {kill + 1}")
            before = after
            print(f"kill {kill + 1}: {len(after)} episodes", flush=True)
        return count, len(before)


def main() -> None:
    """Measure, print, and write where asked to."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=7, help="repeats of every measurement of cost")
    parser.add_argument(
        "--seeds", type=int, default=20, help="seeds of the suite on which workers are compared"
    )
    parser.add_argument("--kills", type=int, default=KILLS, help="how often an evaluation is killed")
    parser.add_argument("--out", type=Path, help="page to write")
    chosen = parser.parse_args()
    if chosen.out is not None:
        check_writable(chosen.out.parent)
    table = costs(chosen.rounds)
    gains, episodes = gain_of_workers(chosen.seeds, 3)
    killed, kept = kills(chosen.kills) if chosen.kills else (0, 0)
    gain = statistics.median(gains)
    page = [
        *heading("Evaluation", about(f"python benchmarks/studies/evaluation.py --out {chosen.out}")),
        "",
        "## What is spent beside the episodes",
        "",
        *table,
        "",
        f"CPU time of one process, {TEAM} robots, maps of 2.5 cm, medians over {chosen.rounds} rounds of "
        "ratios to the bare episode "
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
        f"An evaluation with two workers was killed (SIGKILL) {killed} times, 1 to 6 s after its start, and "
        "gone on with each time: "
        f"{kept} episodes in the end, none lost, none doubled, none changed.",
        "",
    ]
    print("\n".join(page))
    if chosen.out is not None:
        write_text(chosen.out, "\n".join(page))


if __name__ == "__main__":
    main()
