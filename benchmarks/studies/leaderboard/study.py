"""The leaderboard: all policies on the test set and on real floors.

Teams have 1, 2 and 3 robots that know where they start.
"""

import platform
from collections.abc import Iterable, Mapping
from datetime import date
from pathlib import Path
from typing import Any

import lidarium
from lidarium.benchmarks.studies.leaderboard.worlds import KINDS, suites
from lidarium.benchmarks.studies.shared.study import Study
from lidarium.evaluation.report import write_report
from lidarium.evaluation.suites.suite import Suite
from lidarium.evaluation.suites.trial import DEFAULT_VARIANT

CHANCE = 0.05
"""Least p value that is no evidence."""

def page(folder: Path, command: str) -> str:
    """Write the report of each suite, and return the leaderboard as markdown.

    Each report goes into the folder of its suite.
    """
    parts = [
        "# Leaderboard",
        f"Made by `{command}` on {date.today().isoformat()}: lidarium {lidarium.__version__}, Python "
        f"{platform.python_version()}. "
        "Simulated time; perfect poses, no noise, the URG laser (240 deg, 5.6 m), maps of 2.5 cm, known "
        "starts, cut at 1,800 s. "
        "Starts are drawn by the seed, the same for every policy. An entry of time is the median with its 95 "
        "% interval; "
        "runs that did not get there count as never. The difference is that of the restricted means to "
        "`nearest_frontier`, pair by "
        "pair, with its 95 % interval; in bold where Wilcoxon's signed rank test says that it is beyond "
        "chance (5 %, Holm).",
    ]
    is_run = {kind: (folder / kind / "episodes.jsonl").exists() for kind in KINDS}
    if "--every" in command:
        parts.append(
            "A part of the floors of each kind, too few for firm words: the intervals say so. Without "
            "`--every` the command runs all."
        )
    if not all(is_run.values()):
        parts.append(f"Not in it: {', '.join(about for kind, about in KINDS.items() if not is_run[kind])}.")
    for kind, about in KINDS.items():
        if not is_run[kind]:
            continue
        numbers = write_report(folder / kind, folder / kind / "report", BASELINE)
        floors = sorted({floor for group in numbers["groups"] for floor in group["floors"]})
        parts += [f"## {about[0].upper()}{about[1:]} ({len(floors)})", _table(numbers["groups"])]
        if any("fewer than" in warning for warning in numbers["warnings"]):
            parts.append(
                "Fewer than 50 runs or pairs: intervals may hold the truth less often than they say ([how "
                "often](interval_coverage.md))."
            )
    return "\n\n".join(parts) + "\n"


def _table(groups: Iterable[Mapping[str, Any]]) -> str:
    by_team: dict[int, list[Mapping[str, Any]]] = {}
    for group in groups:
        by_team.setdefault(group["robots"], []).append(group)
    lines = [
        "| robots | policy | runs | reached 99 % | time to 90 % [s] | time to 99 % [s] | less the baseline "
        "[s] | path of all [m] | "
        "overlap [%] |",
        "|---:|---|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for robots, members in sorted(by_team.items()):
        for group in members:
            lines += [
                _row(robots, policy, group)
                for policy in sorted(group["times"]["t99_s"], key=lambda name: _order(name, group))
            ]
    return "\n".join(lines)


def _order(policy: str, group: Mapping[str, Any]) -> float:
    """Best first: by the restricted mean of the time to 99 %."""
    mean = group["times"]["t99_s"][policy]["restricted_mean"]
    return float("inf") if mean is None else float(mean["estimate"])


def _row(robots: int, policy: str, group: Mapping[str, Any]) -> str:
    t90, t99 = (group["times"][key][policy] for key in ("t90_s", "t99_s"))
    values = group["values"][policy]
    cells = [
        str(robots),
        f"`{policy}`",
        str(t99["size"]),
        f"{100.0 * t99['success']['estimate']:.0f} %",
        _interval(t90["median"]),
        _interval(t99["median"]),
        _difference(policy, group),
        _estimate(values, "path_m"),
        _estimate(values, "overlap_percent"),
    ]
    return f"| {' | '.join(cells)} |"


def _interval(figure: Mapping[str, Any]) -> str:
    def shown(value: float | None) -> str:
        return "never" if value is None else f"{value:.0f}"

    if figure["low"] is None:
        return f"{shown(figure['estimate'])} (too few for an interval)"
    return f"{shown(figure['estimate'])} ({shown(figure['low'])} to {shown(figure['high'])})"


def _difference(policy: str, group: Mapping[str, Any]) -> str:
    for comparison in group["comparisons"]:
        figure = comparison["difference"]
        if comparison["policy"] == policy and comparison["key"] == "t99_s" and figure is not None:
            bounds = [figure["low"], figure["high"]]
            # Of very few pairs there is an estimate alone.
            text = f"{figure['estimate']:+.0f}" + (
                "" if None in bounds else f" ({bounds[0]:+.0f} to {bounds[1]:+.0f})"
            )
            return f"**{text}**" if comparison["p_holm"] < CHANCE else text
    return "-"


def _estimate(values: Mapping[str, Any], key: str) -> str:
    return f"{values[key]['median']['estimate']:.0f}"


STUDY = Study(page, suites)
