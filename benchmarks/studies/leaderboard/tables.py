"""Tables of the leaderboard, from the numbers of reports."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from lidarium.benchmarks.studies.leaderboard.worlds import WORLDS, World

HEADER = (
    "| robots | world | policy | runs | reached 99 % | time to 99 % [s] | over the bound | minus the baseline "
    "[s] | path of all [m] | overlap [%] |\n|---:|---|---|---:|---:|---:|---:|---:|---:|---:|"
)
SHORT_HEADER = (
    "| policy | reached 99 % | time to 99 % [s] | over the bound | minus the baseline [s] |\n|---|---:|---:|---:|---:|"
)

Multiples = Mapping[tuple[str, int], float]
"""Median of the multiples of the bound by policy and number of robots."""


@dataclass(frozen=True, slots=True)
class Part:
    """What is known of a kind of floor in a world.

    `world`: who explored where; `groups`: of the report, one for each number of robots; `multiples`: multiples of the
    bound.
    """

    world: World
    groups: Sequence[Mapping[str, Any]]
    multiples: Multiples


def table(parts: Sequence[Part]) -> str:
    """Return the table of a kind of floor: by team, then by world, the best first."""
    rows = [
        row
        for robots in sorted({group["robots"] for part in parts for group in part.groups})
        for part in parts
        for row in _rows(part, robots)
    ]
    return "\n".join([HEADER, *(_line(row) for row in rows)])


def short_table(parts: Iterable[Part], robots: int) -> str:
    """Return the table of the ideal world for a number of robots."""
    ideal = next(part for part in parts if part.world is WORLDS["ideal"])
    return "\n".join([SHORT_HEADER, *(_line([row[2], *row[4:8]]) for row in _rows(ideal, robots))])


def _line(cells: Iterable[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _rows(part: Part, robots: int) -> list[list[str]]:
    return [
        _row(part, policy, group)
        for group in part.groups
        if group["robots"] == robots
        for policy in sorted(group["times"]["t99_s"], key=lambda name: _order(name, group))
    ]


def _order(policy: str, group: Mapping[str, Any]) -> float:
    """Best first: by the restricted mean of the time to 99 %."""
    mean = group["times"]["t99_s"][policy]["restricted_mean"]
    return float("inf") if mean is None else float(mean["estimate"])


def _row(part: Part, policy: str, group: Mapping[str, Any]) -> list[str]:
    times, values = group["times"]["t99_s"][policy], group["values"][policy]
    multiple = part.multiples.get((policy, group["robots"]))
    return [
        str(group["robots"]),
        part.world.about,
        f"`{policy}`",
        str(times["size"]),
        f"{100.0 * times['success']['estimate']:.0f} %",
        _interval(times["median"]),
        "-" if multiple is None else "never" if math.isinf(multiple) else f"{multiple:.2f}",
        _difference(policy, group),
        _estimate(values, "path_m"),
        _estimate(values, "overlap_percent"),
    ]


def _interval(figure: Mapping[str, Any]) -> str:
    def shown(value: float | None) -> str:
        return "never" if value is None else f"{value:.0f}"

    if figure["low"] is None:
        return f"{shown(figure['estimate'])} (no interval)"
    return f"{shown(figure['estimate'])} ({shown(figure['low'])} to {shown(figure['high'])})"


def _difference(policy: str, group: Mapping[str, Any]) -> str:
    for comparison in group["comparisons"]:
        figure = comparison["difference"]
        if comparison["policy"] == policy and comparison["key"] == "t99_s" and figure is not None:
            bounds = [figure["low"], figure["high"]]
            # Of very few pairs there is an estimate alone.
            text = f"{figure['estimate']:+.0f}" + ("" if None in bounds else f" ({bounds[0]:+.0f} to {bounds[1]:+.0f})")
            return f"**{text}**" if comparison["is_beyond_chance"] else text
    return "-"


def _estimate(values: Mapping[str, Any], key: str) -> str:
    return f"{values[key]['median']['estimate']:.0f}"
