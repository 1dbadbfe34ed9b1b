"""Metrics of episodes, with their registry.

A metric is a key of ``result.json``. It is registered once, with its unit, direction and format; results,
tables of reports, the report's page and docs/reference/metrics.md are made from the registry.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

from lidarium.registry import Registry, registry

Direction = Literal["higher", "lower"] | None
"""Which values of a metric are better; None if neither is."""


@dataclass(frozen=True, slots=True)
class Column:
    """A number per episode in tables of reports, computed from a metric's value.

    Attributes
    ----------
    key, title, unit : str
        Key in ``report.json``, heading and unit.
    direction : str or None
        Which values are better.
    digits : int
        Number of digits after the point.
    of : callable
        Maps the metric's value to the number.
    by_mean : bool
        Whether policies are summarized by their mean instead of their median.
    is_main : bool
        Whether the leaderboard has the column.
    is_compared : bool
        Whether policies are compared with the baseline in it.
    bounds : (float, float)
        Least and greatest value that there can be; by default unbounded.
    """

    key: str
    title: str
    unit: str
    direction: Direction
    digits: int = 1
    of: Callable[[Any], float] = float
    by_mean: bool = False
    is_main: bool = True
    is_compared: bool = False
    bounds: tuple[float, float] = (-math.inf, math.inf)


@dataclass(frozen=True, slots=True)
class Metric:
    """A metric of an episode.

    Attributes
    ----------
    name, title, unit : str
        Key in ``result.json``, name in tables, unit (empty if it has none).
    direction : str or None
        ``higher`` or ``lower`` if such values are better, None by default.
    summary : str
        One line of documentation.
    digits : int
        Number of digits after the point in tables.
    of : callable
        Computes the value, ready for JSON, of an ``EpisodeData``.
    columns : tuple of Column
        Its columns in tables of reports; without any, its median is listed among further figures if it is a
        number.
    """

    name: str
    title: str
    unit: str
    direction: Direction
    summary: str
    digits: int
    of: Callable[[Any], Any]
    columns: tuple[Column, ...] = ()


METRICS: Registry[Metric] = Registry("metric")
"""The metrics by name, in the order of ``result.json``. ``registry("metric")`` holds the built-in ones."""


def metric(
    name: str,
    *,
    unit: str = "",
    direction: Direction = None,
    summary: str,
    digits: int = 2,
    title: str | None = None,
) -> Callable[[Callable[[Any], Any]], Callable[[Any], Any]]:
    """Register a function of an episode as a metric.

    Its value appears in ``result.json``, in the rows of evaluations, and in the tables and on the page of
    reports. The function takes an ``EpisodeData``
    and returns a number, or None if the episode has no such
    number.

    Parameters
    ----------
    name : str
        Key in ``result.json``; no other metric has it.
    unit : str, default ""
        Unit, such as ``m``.
    direction : {"higher", "lower"} or None, default None
        Which values are better.
    summary : str
        One line that describes it.
    digits : int, default 2
        Number of digits after the point in tables.
    title : str or None, default None
        Name in tables; by default ``name`` with spaces.

    Raises
    ------
    ValueError
        If the name is taken, or the direction is neither ``higher``, ``lower`` nor None.

    Examples
    --------
    >>> import numpy as np
    >>> import lidarium
    >>> @lidarium.metric("longest_step_m", unit="m", direction="lower", summary="Longest step of a robot.")
    ... def longest_step_m(episode):
    ...     return np.linalg.norm(np.diff(episode.poses[..., :2], axis=0), axis=-1).max()
    """
    if direction not in ("higher", "lower", None):
        raise ValueError(f"direction of metric {name!r} is {direction!r}; want 'higher', 'lower' or None")
    shown = title or name.replace("_", " ")

    def register(function: Callable[[Any], Any]) -> Callable[[Any], Any]:
        column = Column(name, shown, unit, direction, digits)
        made = Metric(name, shown, unit, direction, summary, digits, function, (column,))
        registry("metric").register(name, made, summary)
        return function

    return register


def metrics_table() -> str:
    """Return the built-in and registered metrics as a Markdown table."""
    lines = [
        f"| `{each.name}` | {each.unit} | {each.direction or ''} | {each.summary} |"
        for each in registry("metric").values()
    ]
    return "\n".join(["| key | unit | better | meaning |", "|---|---|---|---|", *lines]) + "\n"
