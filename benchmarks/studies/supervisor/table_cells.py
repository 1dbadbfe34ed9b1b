"""Cells of tables in markdown, and tables of them."""

from collections.abc import Iterable, Sequence

import numpy as np

from lidarium.benchmarks.studies.supervisor.figures import Row, time_of
from lidarium.evaluation.statistics import Interval


def shown(found: Interval | None, digits: int = 2) -> str:
    """Return an estimate with its interval.

    An end that the sample does not bound is left out.
    """
    if found is None:
        return "-"
    text = number(found.estimate, digits)
    if not np.isfinite(found.low) and not np.isfinite(found.high):
        return text
    return f"{text} ({number(found.low, digits)} to {number(found.high, digits)})"


def reached(runs: Sequence[Row]) -> str:
    """Return the share of runs that reached 99 %."""
    return f"{100.0 * np.mean([np.isfinite(time_of(row)) for row in runs]):.0f} %" if runs else "-"


def listed(values: Iterable[float], digits: int = 0) -> str:
    """Return numbers, one after the other."""
    return ", ".join(number(value, digits) for value in values)


def number(value: float, digits: int) -> str:
    """Return a number; what is not finite has never been."""
    return f"{value:.{digits}f}" if np.isfinite(value) else "never"


def table(head: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    """Return a table: two columns at the left, the others at the right."""
    rows = [head, [":---" if column < 2 else "---:" for column in range(len(head))], *lines]
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)
