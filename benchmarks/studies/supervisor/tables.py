"""The tables of the page on supervised teams, as markdown."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lidarium.benchmarks.studies.supervisor.figures import (
    Row,
    chosen,
    energy_of,
    energy_shares,
    floor_of,
    has_energy,
    has_false_merge,
    has_wrong_merge,
    median,
    overlap_points,
    path_of,
    path_shares,
    time_of,
    time_ratios,
    time_shares,
)
from lidarium.benchmarks.studies.supervisor.goals import Goal
from lidarium.benchmarks.studies.supervisor.suites import ALONE, POLICIES
from lidarium.benchmarks.studies.supervisor.table_cells import listed, reached, shown, table

TOLD = "oracle_starts"


def goals_table(goals: Sequence[Goal]) -> str:
    """Return what was to be reached, and whether it was."""
    return table(
        ("figure (`supervised`)", "found", "to reach", "runs", ""),
        [
            (
                goal.title,
                shown(goal.found, goal.digits),
                goal.wanted,
                str(goal.found.size) if goal.found else "0",
                _verdict(goal),
            )
            for goal in goals
        ],
    )


def alone_table(rows: Sequence[Row], names: Sequence[str] = ("A", "B", "C")) -> str:
    """Return the runs of one robot from each start of the scenarios."""
    lines = []
    for floor in sorted({floor_of(row) for row in rows}):
        starts = list(
            dict.fromkeys(
                str(row["starts"])
                for row in sorted(rows, key=lambda row: str(row["key"]))
                if floor_of(row) == floor
            )
        )
        for name, start in zip(names, starts, strict=False):
            runs = [row for row in rows if floor_of(row) == floor and str(row["starts"]) == start]
            times, ways = [time_of(row) for row in runs], [path_of(row) for row in runs]
            complete = f"{sum(np.isfinite(times))} of {len(runs)}"
            energy = [listed(map(energy_of, runs), 2)] if has_energy(rows) else []
            lines.append((floor, name, complete, listed(times), listed(ways), *energy))
    head = ("floor", "start", "maps of 99 %", "times to 99 % [s]", "ways [m]")
    return table((*head, *(["energy [kJ]"] if has_energy(rows) else [])), lines)


def team_table(rows: Sequence[Row], alone: Sequence[Row]) -> str:
    """Return the teams of each size, policy by policy.

    They stand beside one robot and the team that knows its starts.
    """
    lines = []
    for robots in sorted({int(row["robots"]) for row in rows}):
        for policy in POLICIES:
            runs = chosen(rows, policy, robots)
            told = chosen(rows, TOLD, robots)
            if runs:
                line = _team_line(policy, robots, runs, alone, told)
                lines.append((*line, *(_energy_cells(runs, alone) if has_energy(rows) else ())))
    head = (
        "robots",
        "policy",
        "runs",
        "reached 99 %",
        "time to 99 % [s]",
        "/ one robot's",
        f"/ `{TOLD}`",
        "way / one robot's",
        "overlap [%]",
        f"less `{TOLD}` [points]",
        "wrong merges",
        "not correct",
        *(("energy of all [kJ]", "energy / one robot's") if has_energy(rows) else ()),
    )
    return table(head, lines)


def one_table(rows: Sequence[Row]) -> str:
    """Return the runs of one robot by floor."""
    lines = []
    for floor in dict.fromkeys(floor_of(row) for row in rows):
        runs = chosen(rows, ALONE, is_floor=floor.__eq__)
        times = [time_of(row) for row in runs]
        ways = [path_of(row) for row in runs]
        lines.append(
            (
                f"`{Path(floor).name}`",
                str(len(runs)),
                reached(runs),
                shown(median(times), 0),
                shown(median(ways), 0),
            )
        )
    return table(("floor", "runs", "reached 99 %", "time to 99 % [s]", "way [m]"), lines)


def five_table(rows: Sequence[Row], alone: Sequence[Row]) -> str:
    """Return teams of five, with what the supervisor's ticks take."""
    lines = []
    for policy in POLICIES:
        runs = chosen(rows, policy)
        ticks = [row["tick_ms"] for row in runs if row["tick_ms"] is not None]
        found = [_of_ticks(ticks, name) for name in ("p50", "p95", "merge_p50", "merge_p95")]
        lines.append(
            (
                f"`{policy}`",
                str(len(runs)),
                reached(runs),
                shown(median([time_of(row) for row in runs]), 0),
                shown(median(time_shares(runs, alone))),
                *found,
            )
        )
    head = (
        "policy",
        "runs",
        "reached 99 %",
        "time to 99 % [s]",
        "/ one robot's",
        "tick p50 [ms]",
        "p95",
        "merges between, p50 [ms]",
        "p95",
    )
    return table(head, lines)


def _team_line(
    policy: str, robots: int, runs: Sequence[Row], alone: Sequence[Row], told: Sequence[Row]
) -> tuple[str, ...]:
    is_bound = policy == TOLD
    return (
        str(robots),
        f"`{policy}`",
        str(len(runs)),
        reached(runs),
        shown(median([time_of(row) for row in runs]), 0),
        shown(median(time_shares(runs, alone))),
        "1" if is_bound else shown(median(time_ratios(runs, told))),
        shown(median(path_shares(runs, alone))),
        shown(median([100.0 * row["overlap"] for row in runs]), 0),
        "0" if is_bound else shown(median(overlap_points(runs, told)), 1),
        *(
            "-" if policy == ALONE else str(sum(map(holds, runs)))
            for holds in (has_wrong_merge, has_false_merge)
        ),
    )


def _energy_cells(runs: Sequence[Row], alone: Sequence[Row]) -> tuple[str, str]:
    shares = energy_shares(runs, alone) if has_energy(alone) else []
    return shown(median([energy_of(row) for row in runs])), shown(median(shares))


def _of_ticks(ticks: Iterable[Mapping[str, Any]], name: str) -> str:
    return shown(median([float(one[name]) for one in ticks if one[name] is not None]), 0)


def _verdict(goal: Goal) -> str:
    if goal.found is None:
        return "not run"
    if goal.wanted == "-":
        return ""
    return "reached" if goal.is_reached else "**missed**"
