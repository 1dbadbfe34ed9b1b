"""Decisions by frontiers on two threads beside one, on a machine that is idle and beside a busy core.

Two batches take the same decisions, some at a time in turn. The busy core belongs to a process that counts.
"""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from lidarium.benchmarks.speed.cases.batch_step import run_in_turn
from lidarium.benchmarks.speed.cases.frontier_decision import EPISODES, Choosers
from lidarium.benchmarks.speed.harness.batches import can_use
from lidarium.benchmarks.speed.harness.lines import Line, faster, needs_threads
from lidarium.benchmarks.speed.harness.report import run_alone
from lidarium.benchmarks.speed.harness.timing import Effort

CORES = 2
ROBOTS = 1
FLOORS = "set:validation:8"
"""Few, so that all are in memory: else who comes first reads them for both."""

LEAST_GAIN, LEAST_BESIDE = 1.7, 0.95
_COUNTING = "while True: pass"

NOTES = (
    f"*Frontier decisions on two threads*: {EPISODES} episodes of one robot on `{FLOORS}`, otherwise as *frontier "
    "decision*, by the clock; *beside a busy core*: another process keeps one core busy.",
)


@contextmanager
def busy_core() -> Iterator[None]:
    """Keep a core busy."""
    with subprocess.Popen([sys.executable, "-c", _COUNTING]) as process:
        try:
            yield
        finally:
            process.kill()


def measure(effort: Effort) -> list[Line]:
    """Compare two threads with one, idle and beside a busy core."""
    title = f"frontier decisions, {EPISODES} episodes, two threads"
    if not can_use(CORES):
        return [needs_threads(title, LEAST_GAIN)]
    decide = {name: Choosers(ROBOTS, threads, FLOORS).decide for name, threads in (("two", 2), ("one", 1))}

    def line(name: str, to_reach: float) -> Line:
        taken = [run_in_turn(decide, effort.block_s) for _ in range(effort.rounds)]
        two, one = ([seconds[name] / (EPISODES * ROBOTS) for seconds in taken] for name in ("two", "one"))
        return faster(name, two, "one thread", one, to_reach, "rows/s")

    idle = line(title, LEAST_GAIN)
    with busy_core():
        return [idle, line(f"{title}, beside a busy core", LEAST_BESIDE)]


if __name__ == "__main__":
    run_alone(measure, "Decisions by frontiers on two threads.", CORES)
