"""Evaluations as programs of their own: with one worker and two, and killed."""

import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from lidarium.benchmarks.studies.evaluation.costs import FLOORS, POLICIES, SETTINGS, TEAM
from lidarium.evaluation.suites.campaign import EPISODES_FILE, Campaign
from lidarium.evaluation.suites.episodes_file import read_episodes
from lidarium.evaluation.suites.suite import Suite

PROGRAM = "from lidarium.scripts.main import main; import sys; sys.exit(main())"
OPTIONS = (
    *("evaluate", "--policies", "random_walk", "nearest_frontier", "--floors", "apartment"),
    *("--robots", "1", "2", "--seeds", "800", "--horizon-s", "20", "--map-resolution", "0.05"),
    *("--workers", "2"),
)
"""The evaluation that is killed."""


def worker_suite(seeds: int, floors: tuple[str, ...]) -> Suite:
    """Return the suite on which workers are compared."""
    return Suite(
        policies=POLICIES,
        floors=floors,
        robots=(TEAM,),
        seeds=tuple(range(seeds)),
        variants={"default": SETTINGS},
    )


def run_suite(seeds: int, floors: tuple[str, ...], folder: str, workers: int) -> None:
    """Run the suite into a folder; what a program of its own does."""
    for _ in Campaign(worker_suite(seeds, floors), Path(folder), workers).run():
        pass


def gain_of_workers(seeds: int, floors: tuple[str, ...] = FLOORS) -> tuple[float, int]:
    """Return how much faster two workers are than one, and how many episodes are run.

    Each is a program of its own, which has to start and to load its kernels, as an evaluation from the
    command line has.
    """
    finished, seconds = 0, []
    for workers in (1, 2):
        with tempfile.TemporaryDirectory() as name:
            code = f"from {__name__} import run_suite; run_suite({seeds}, {floors!r}, {name!r}, {workers})"
            began = time.perf_counter()
            subprocess.run([sys.executable, "-c", code], check=True)
            seconds.append(time.perf_counter() - began)
            finished = len(read_episodes(Path(name) / EPISODES_FILE))
    return seconds[0] / seconds[1], finished


def kills(count: int) -> tuple[int, int]:
    """Kill an evaluation at random moments until it is through.

    Returns how often it was killed, and its episodes.

    Raises
    ------
    RuntimeError
        Where an episode was lost, doubled or changed.
    """
    generator = np.random.default_rng(0)
    # Workers outlive a killed program for a moment, and may write into the folder while it is removed.
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
        folder = Path(name)
        command = [sys.executable, "-c", PROGRAM, *OPTIONS, "--out", str(folder)]
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
        return count, len(before)
