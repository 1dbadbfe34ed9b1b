"""Tables of the study of the supervisor: results, events and logs."""

import math
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
    partners,
    path_of,
    path_shares,
    time_of,
    time_ratios,
    time_shares,
)
from lidarium.benchmarks.studies.supervisor.goals import SUPERVISED, Goal, covered_by_others, is_covered
from lidarium.benchmarks.studies.supervisor.suites import ALONE, POLICIES
from lidarium.evaluation.statistics import Interval


def shown(found: Interval | None, digits: int = 2) -> str:
    """Return an estimate with its interval, if it has one."""
    if found is None:
        return "-"
    text = number(found.estimate, digits)
    if not found.is_known:
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
                str(row["starts"]) for row in sorted(rows, key=lambda row: str(row["key"])) if floor_of(row) == floor
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
            (f"`{Path(floor).name}`", str(len(runs)), reached(runs), shown(median(times), 0), shown(median(ways), 0))
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
        *("-" if policy == ALONE else str(sum(map(holds, runs))) for holds in (has_wrong_merge, has_false_merge)),
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


def failing_table(rows: Sequence[Row]) -> str:
    """Return runs in which a robot fails at half time."""
    lines = []
    for robots in sorted({int(row["robots"]) for row in rows}):
        for policy in POLICIES:
            runs = chosen(rows, policy, robots)
            if runs:
                covered = [100.0 * float(row["c_others_final"]) for row in runs if row["c_others_final"] is not None]
                count = sum(map(is_covered, runs))
                ends = shown(median([float(row["time_s"]) for row in runs]), 0)
                least = f"{min(covered):.1f}" if covered else "-"
                lines.append(
                    (str(robots), f"`{policy}`", f"{count} of {len(runs)}", shown(median(covered), 1), least, ends)
                )
    return table(("robots", "policy", "runs with 99 %", "covered by the others [%]", "least", "end [s]"), lines)


def left_table(rows: Sequence[Row]) -> str:
    """Return the runs in which a supervised team left a dead robot's area uncovered.

    The other policies' runs of the same death stand besides them.
    """
    lines = []
    for row in chosen(rows, SUPERVISED):
        if not is_covered(row):
            same = [one for policy in POLICIES for _, one in partners([row], chosen(rows, policy))]
            covered = {one["policy"]: f"{100.0 * covered_by_others(one):.2f}" for one in same}
            ends = ", ".join(sorted({str(why) for robot, why in row["ended_because"].items() if robot != "robot_0"}))
            case = f"`{Path(floor_of(row)).name}`", str(row["robots"]), str(row["seed"])
            lines.append((*case, *(covered.get(policy, "-") for policy in POLICIES), ends, f"{row['time_s']:.0f}"))
    head = ("floor", "robots", "seed", *(f"`{policy}` [%]" for policy in POLICIES), "others ended because", "end [s]")
    return table(head, lines)


def extension_table(rows: Sequence[Row]) -> str:
    """Return runs with extensions switched on, beside `supervised`. The floors and seeds are the same."""
    lines = []
    for variant, policy in dict.fromkeys((str(row["variant"]), str(row["policy"])) for row in rows):
        runs = chosen(rows, policy, variant=variant)
        plain = chosen(rows, "supervised", variant=variant)
        ends = [reason for row in runs for reason in row["ended_because"].values()]
        home = "-" if not ends else f"{100.0 * ends.count('returned') / len(ends):.0f}"
        empty = "-" if not ends else f"{100.0 * ends.count('battery') / len(ends):.0f}"
        lines.append(
            (
                variant,
                f"`{policy}`",
                str(len(runs)),
                reached(runs),
                shown(median([time_of(row) for row in runs]), 0),
                shown(median(time_ratios(runs, plain))),
                shown(median([path_of(row) for row in runs]), 0),
                shown(median([100.0 * row["overlap"] for row in runs]), 0),
                shown(median([row["time_s"] for row in runs]), 0),
                home,
                empty,
            )
        )
    head = (
        "world",
        "policy",
        "runs",
        "reached 99 %",
        "time to 99 % [s]",
        "/ `supervised`",
        "way of all [m]",
        "overlap [%]",
        "end [s]",
        "robots home [%]",
        "batteries empty [%]",
    )
    return table(head, lines)


def bumper_table(rows: Sequence[Row]) -> str:
    """Return runs of robots that pause where they touch or meet something."""
    lines = []
    for floor in dict.fromkeys(floor_of(row) for row in rows):
        for robots in sorted({int(row["robots"]) for row in rows}):
            for policy in dict.fromkeys(str(row["policy"]) for row in rows):
                runs = chosen(rows, policy, robots, floor.__eq__)
                if runs:
                    lines.append((floor, f"`{policy}`", str(robots), str(len(runs)), *_bumper_cells(runs)))
    head = (
        "floor",
        "policy",
        "robots",
        "runs",
        "reached 99 %",
        "time to 99 % [s]",
        "pauses by contact",
        "by what blocks",
        "resumed",
        "robots left paused [%]",
        "IoU of occupied cells",
    )
    return table(head, lines)


def _bumper_cells(runs: Sequence[Row]) -> tuple[str, ...]:
    """Return what pauses came to in some runs; counts are of all of them."""
    states = [event for row in runs for event in row["operating"] if event["kind"] == "state"]
    causes = [event["reason"] for event in states if event["state"] == "paused"]
    robots = sum(int(row["robots"]) for row in runs)
    left = sum(len(_paused_at_end(row)) for row in runs)
    return (
        reached(runs),
        shown(median([time_of(row) for row in runs]), 0),
        str(causes.count("contact")),
        str(causes.count("blocked")),
        str(sum(event["state"] == "operating" for event in states)),
        f"{100.0 * left / robots:.0f}",
        shown(median([float(row["iou_occupied"]) for row in runs])),
    )


def _paused_at_end(row: Row) -> set[str]:
    """Return the robots that stood paused when the run ended."""
    last = {
        event["agent"]: event["state"]
        for event in row["operating"]
        if event["kind"] == "state" and event["state"] in ("paused", "operating")
    }
    return {agent for agent, state in last.items() if state == "paused"}


def wrong_table(rows: Sequence[Row]) -> str:
    """Return runs that used a wrong merge."""
    lines = [
        (
            f"`{Path(floor_of(row)).name}`",
            f"`{row['policy']}`",
            f"{row['robots']}",
            f"{row['seed']}",
            f"{row['merges']['wrong']} of {row['merges']['accepted']}",
            f"{row['merges']['worst_here_m']:.2f}",
            f"{math.degrees(row['merges']['worst_here_rad']):.1f}",
            f"{row['merges']['worst_m']:.2f}",
            ", ".join(f"{error:.2f}" for error in row["ate_m"] or ()),
        )
        for row in rows
    ]
    return table(
        (
            "floor",
            "policy",
            "robots",
            "seed",
            "merges",
            "worst [m]",
            "[deg]",
            "by the starts [m]",
            "trajectories of the robots [m]",
        ),
        lines,
    )
