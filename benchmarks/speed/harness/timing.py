"""Interleaved timing: in every round each contender runs for a moment.

What disturbs the machine thus disturbs all of them.
"""

import math
import os
import statistics
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

Contender = Callable[[float], float]
"""A contender, which runs for about so many seconds. It returns the seconds that one unit of work took."""


@dataclass(frozen=True, slots=True)
class Effort:
    """How long to measure.

    `rounds`: rounds in which each contender runs once; `block_s`: how long a contender runs in a round [s]; `is_full`:
    whether checks that take minutes are made, too.
    """

    rounds: int = 9
    block_s: float = 0.4
    is_full: bool = False


EFFORTS = {"quick": Effort(3, 0.1), "moderate": Effort(5, 0.2), "full": Effort(is_full=True)}
"""Efforts by name.

They give coarse figures in the time that setting up takes, figures to inspect, and those that are published.
"""


@dataclass(frozen=True, slots=True)
class Comparison:
    """Ratios of two contenders' speeds over the rounds: median, least and greatest."""

    median: float
    least: float
    greatest: float


def cores() -> list[int]:
    """Return the cores that this process may use, as far as the system tells."""
    return sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else list(range(os.cpu_count() or 1))


@contextmanager
def on_cores(count: int) -> Iterator[None]:
    """Keep this process, and those that it starts, on that many cores.

    It applies where the system allows it, and is undone at the end.
    """
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    before = cores()
    _keep_threads_on(before[-count:])
    try:
        yield
    finally:
        _keep_threads_on(before)


def _keep_threads_on(chosen: list[int]) -> None:
    """Move all threads of the process. Those of a pool once started would stay where their starter was then."""
    tasks = Path("/proc/self/task")
    threads = [int(path.name) for path in tasks.iterdir()] if tasks.is_dir() else [0]
    for thread in threads:
        # A thread may have ended meanwhile.
        with suppress(ProcessLookupError):
            os.sched_setaffinity(thread, chosen)


def repeated(function: Callable[[], object], units: int = 1, before: Callable[[], object] | None = None) -> Contender:
    """Make a contender of a function that does ``units`` of work a call.

    ``before`` runs ahead of each block, untimed.
    """

    def run(seconds: float) -> float:
        if before is not None:
            before()
        calls = 0
        began = time.perf_counter()
        elapsed = 0.0
        while calls == 0 or elapsed < seconds:
            function()
            calls += 1
            elapsed = time.perf_counter() - began
        return elapsed / (calls * units)

    return run


def interleaved(contenders: Mapping[str, Contender], effort: Effort) -> dict[str, list[float]]:
    """Return the seconds per unit of each contender in each round. A round to warm up comes first."""
    for contender in contenders.values():
        contender(0.25 * effort.block_s)
    seconds: dict[str, list[float]] = {name: [] for name in contenders}
    for _ in range(effort.rounds):
        for name, contender in contenders.items():
            seconds[name].append(contender(effort.block_s))
    return seconds


def compared(ours: Sequence[float], others: Sequence[float]) -> Comparison:
    """Return how many times faster ours is, round by round."""
    ratios = [other / own for own, other in zip(ours, others, strict=True)]
    return Comparison(statistics.median(ratios), min(ratios), max(ratios))


@dataclass(frozen=True, slots=True)
class Interval:
    """A median, and between what bounds that of the whole population lies."""

    median: float
    low: float
    high: float


def median_interval(values: Sequence[float], confidence: float = 0.95) -> Interval:
    """Return the median of values and an interval for the true one.

    The interval holds the true one with at least this confidence.

    The bounds are values themselves, those of equal rank from both ends: whatever the distribution, each
    value lies below the true median with probability one half. Too few values for the confidence give the
    least and the greatest.
    """
    ordered, count = sorted(values), len(values)
    tail, rank = 0.5**count, 0
    while tail <= 0.5 * (1.0 - confidence):
        rank += 1
        tail += math.comb(count, rank) * 0.5**count
    rank = max(rank - 1, 0)
    return Interval(statistics.median(ordered), ordered[rank], ordered[count - 1 - rank])


def rate(seconds: Sequence[float]) -> float:
    """Return units per second, from the median."""
    return 1.0 / statistics.median(seconds)
