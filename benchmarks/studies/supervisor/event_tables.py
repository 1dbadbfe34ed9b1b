"""Tables of what happened to teams: robots that failed, extensions, wrong merges."""

import math
from collections.abc import Sequence
from pathlib import Path

from lidarium.benchmarks.studies.supervisor.figures import (
    Row,
    chosen,
    floor_of,
    median,
    partners,
    path_of,
    time_of,
    time_ratios,
)
from lidarium.benchmarks.studies.supervisor.goals import SUPERVISED, covered_by_others, is_covered
from lidarium.benchmarks.studies.supervisor.suites import POLICIES
from lidarium.benchmarks.studies.supervisor.table_cells import reached, shown, table


def failing_table(rows: Sequence[Row]) -> str:
    """Return runs in which a robot fails at half time."""
    lines = []
    for robots in sorted({int(row["robots"]) for row in rows}):
        for policy in POLICIES:
            runs = chosen(rows, policy, robots)
            if runs:
                covered = [
                    100.0 * float(row["c_others_final"]) for row in runs if row["c_others_final"] is not None
                ]
                count = sum(map(is_covered, runs))
                ends = shown(median([float(row["time_s"]) for row in runs]), 0)
                least = f"{min(covered):.1f}" if covered else "-"
                lines.append(
                    (
                        str(robots),
                        f"`{policy}`",
                        f"{count} of {len(runs)}",
                        shown(median(covered), 1),
                        least,
                        ends,
                    )
                )
    return table(
        ("robots", "policy", "runs with 99 %", "covered by the others [%]", "least", "end [s]"), lines
    )


def left_table(rows: Sequence[Row]) -> str:
    """Return the runs in which a supervised team left a dead robot's area uncovered.

    The other policies' runs of the same death stand beside them.
    """
    lines = []
    for row in chosen(rows, SUPERVISED):
        if not is_covered(row):
            same = [one for policy in POLICIES for _, one in partners([row], chosen(rows, policy))]
            covered = {one["policy"]: f"{100.0 * covered_by_others(one):.2f}" for one in same}
            ends = ", ".join(
                sorted({str(why) for robot, why in row["ended_because"].items() if robot != "robot_0"})
            )
            case = f"`{Path(floor_of(row)).name}`", str(row["robots"]), str(row["seed"])
            lines.append(
                (*case, *(covered.get(policy, "-") for policy in POLICIES), ends, f"{row['time_s']:.0f}")
            )
    head = (
        "floor",
        "robots",
        "seed",
        *(f"`{policy}` [%]" for policy in POLICIES),
        "others ended because",
        "end [s]",
    )
    return table(head, lines)


def extension_table(rows: Sequence[Row]) -> str:
    """Return runs with extensions switched on, beside `supervised`.

    The floors and seeds are the same.
    """
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
