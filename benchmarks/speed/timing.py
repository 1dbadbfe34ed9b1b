"""Interleaved timing: in every round each contender runs for a moment, so that what disturbs the machine disturbs all."""

import os
import statistics
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

Contender = Callable[[float], float]
"""Runs for about so many seconds and returns the seconds that one unit of work took."""


@dataclass(frozen=True, slots=True)
class Effort:
    """How long to measure.

    Attributes
    ----------
    rounds : int
        Rounds in which each contender runs once.
    block_s : float
        How long a contender runs in a round [s].
    """

    rounds: int = 9
    block_s: float = 0.4


QUICK = Effort(rounds=3, block_s=0.1)


@dataclass(frozen=True, slots=True)
class Comparison:
    """Ratios of two contenders' speeds over the rounds: median, least and greatest."""

    median: float
    least: float
    greatest: float


def pin() -> None:
    """Keep this process, and those that it starts, on one core (where the system allows it)."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def repeated(function: Callable[[], object], units: int = 1, before: Callable[[], object] | None = None) -> Contender:
    """Make a contender of a function that does ``units`` of work a call; ``before`` runs ahead of each block, untimed."""

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
    """Return the seconds per unit of each contender in each round, after a round to warm up."""
    for contender in contenders.values():
        contender(0.25 * effort.block_s)
    seconds: dict[str, list[float]] = {name: [] for name in contenders}
    for _ in range(effort.rounds):
        for name, contender in contenders.items():
            seconds[name].append(contender(effort.block_s))
    return seconds


def compared(ours: list[float], others: list[float]) -> Comparison:
    """Return how many times faster ours is, round by round."""
    ratios = [other / own for own, other in zip(ours, others, strict=True)]
    return Comparison(statistics.median(ratios), min(ratios), max(ratios))


def rate(seconds: list[float]) -> float:
    """Return units per second, from the median."""
    return 1.0 / statistics.median(seconds)
