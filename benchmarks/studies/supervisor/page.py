"""The page of the study of the supervisor, and what the logs of its runs say."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from lidarium.agents.supervisor.settings import SupervisorSettings
from lidarium.benchmarks.results_page import in_file
from lidarium.benchmarks.studies.supervisor import tables
from lidarium.benchmarks.studies.supervisor.figures import (
    Row,
    chosen,
    floor_of,
    has_wrong_merge,
    median,
    time_ratios,
    time_shares,
)
from lidarium.benchmarks.studies.supervisor.goals import BUMPER, SUPERVISED, TOLD, goals_of, is_covered
from lidarium.benchmarks.studies.supervisor.runs import FAILING, LOGS_FILE, asked_runs, read_json
from lidarium.benchmarks.studies.supervisor.suites import (
    BUMPED,
    FEWEST_SEEDS,
    MARGIN,
    SETTINGS,
    area_m2,
    floors_of,
    suites,
)
from lidarium.benchmarks.studies.supervisor.tables import (
    bumper_table,
    extension_table,
    failing_table,
    left_table,
    wrong_table,
)
from lidarium.evaluation.suites.episodes_file import KEY

LINES_SHOWN = 12
"""Lines of a log that are published."""


def logs_section(logs: Mapping[str, Any]) -> list[str]:
    """Return the logs of typical runs if something was missed."""
    if not logs:
        return []
    rows = ["| missed | run | station and orders |", "|---|---|---|"]
    for name, log in logs.items():
        lines = [line for entry in log["lines"] if (line := _line_of(json.loads(entry)))]
        left_out = len(lines) - LINES_SHOWN
        if left_out > 0:
            lines = [*lines[: LINES_SHOWN // 2], f"... {left_out} more", *lines[-LINES_SHOWN // 2 :]]
        rows += [f"| {name} | {_cell(_short(log[KEY]))} | {_cell(line.strip())} |" for line in lines]
    words = (
        "Log lines of the station and its orders, if a figure was missed: of the run with the median share of one "
        "robot's time for a size of teams, and of the middle one of the runs that missed a count."
    )
    return ["### Typical runs\n\n" + words + "\n\n" + in_file("\n".join(rows))]


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def _line_of(entry: Mapping[str, Any]) -> str:
    """Return what happened at the station, or an order, in a line. Nothing of decisions to go on."""
    if entry["event"] != "decision":
        return f"{entry['time_s']:6.1f} s  {entry['event']} {' + '.join(entry['agents'])}: {entry['words']}"
    if entry["order"] is None:
        return ""
    inputs = entry["inputs"]
    return (
        f"{entry['time_s']:6.1f} s  rule {entry['rule']}, {entry['agent']} {entry['order']}: {entry['why']} "
        f"(d_rest {inputs['remaining_m'] or 0.0:.2f} m, map_kno {inputs['map_known']:.2f}, d_trav "
        f"{inputs['travelled_m']:.1f} m)"
    )


def _short(key: str) -> str:
    parts = key.split(" | ")
    return " | ".join([Path(parts[1]).name, *parts[2:]])


EXTENSION_SUITES = ("extensions", "radio", "energy", "together")
SECONDS_PER_HOUR = 3600.0


def page(folder: Path) -> str:
    """Return the results as markdown."""
    rows = {name: asked_runs(folder, name) for name in suites(None)}
    failing = asked_runs(folder, FAILING)
    goals = goals_of(rows, failing)
    every = [*(row for group in rows.values() for row in group), *failing]
    hours = sum(float(row["wall_s"]) for row in every) / SECONDS_PER_HOUR
    alone = rows["one"]
    parts = [
        "# Supervised teams",
        f"{len(every)} runs, {hours:.2f} hours of one core. " + _about(alone),
        "## What was to be reached\n\n" + tables.goals_table(goals),
        _notes(),
        *_wrong_section(every),
        *logs_section(read_json(folder / LOGS_FILE)),
        "## Beside the thesis\n\n" + _beside_thesis(rows["teams"], alone),
        "## Test 1: each robot alone\n\n" + tables.alone_table(rows["alone"]),
        *(
            f"## Test 2: pairs, {floor}\n\nJade with Luna (starts A and B), and with Mars (A and C). "
            + _team_section([row for row in rows["pairs"] if floor_of(row) == floor], rows["alone"])
            for floor in dict.fromkeys(floor_of(row) for row in rows["pairs"])
        ),
        "## Test 3: three robots, apartment\n\n" + _team_section(rows["three"], rows["alone"]),
        "## One robot on each floor\n\n" + in_file(tables.one_table(alone)),
    ]
    generated = [row for row in rows["teams"] if _is_generated(row)]
    real = [row for row in rows["teams"] if not _is_generated(row)]
    for title, some in (
        ("All floors", rows["teams"]),
        ("Generated floors", generated),
        ("Real floors, or what stands in for them", real),
    ):
        if some:
            parts.append(f"## {title}\n\n" + in_file(tables.team_table(some, alone)))
    parts += [
        "## Five robots\n\n" + _times_text(rows["five"], alone) + ".\n\n" + tables.five_table(rows["five"], alone),
        "## A robot fails\n\n" + _about_failing() + "\n\n" + failing_table(failing),
        *_left_section(failing),
        *_bumper_section(rows[BUMPER]),
        "## Extensions\n\n" + _about_extensions(),
        *(in_file(extension_table(rows[name])) for name in EXTENSION_SUITES if rows[name]),
    ]
    return "\n\n".join(parts) + "\n"


def _team_section(rows: Sequence[Row], alone: Sequence[Row]) -> str:
    """Return the times of supervised teams in a sentence, and the table of all policies."""
    ratio = tables.shown(median(time_ratios(chosen(rows, SUPERVISED), chosen(rows, TOLD))))
    return f"{_times_text(rows, alone)} and {ratio} of that of `{TOLD}`.\n\n{tables.team_table(rows, alone)}"


def _times_text(rows: Sequence[Row], alone: Sequence[Row]) -> str:
    share = tables.shown(median(time_shares(chosen(rows, SUPERVISED), alone)))
    return f"Supervised teams take {share} of one robot's time"


def _beside_thesis(teams: Sequence[Row], alone: Sequence[Row]) -> str:
    shares = {robots: median(time_shares(chosen(teams, SUPERVISED, robots), alone)) for robots in (2, 3)}
    ours = " and ".join(
        f"{100.0 * (1.0 - found.estimate):.0f} % less with {robots} robots"
        for robots, found in shares.items()
        if found is not None
    )
    settings = SupervisorSettings()
    return (
        "The thesis says that two and more robots need close to a third less time than one, and prints no times for "
        f"it. Here supervised teams need {ours or 'too few runs to say'} (medians over all floors). The thesis also "
        "claims less energy; ours is in tests 1 to 3, until 99 % is seen, by a battery that only counts. Its station "
        f"merges maps every second, ours every {settings.merge_period_s:g} s; both look at the decision tree every "
        f"{settings.period_s:g} s. `map_kno` is the share that a robot's own map knows of the area that the merged map "
        "knows or has around its frontiers. The thesis says that 1 is a complete map, but not of which area it is a "
        "share."
    )


def _wrong_section(rows: Sequence[Row]) -> list[str]:
    """Return the runs that used a wrong merge, with what the robots' own maps err by."""
    wrong = [row for row in rows if has_wrong_merge(row)]
    if not wrong:
        return []
    words = (
        "Runs with a wrong merge: its error where the maps meet and by the starts, and the error of each robot's "
        "trajectory."
    )
    return ["### Wrong merges\n\n" + words + "\n\n" + wrong_table(wrong)]


def _bumper_section(rows: Sequence[Row]) -> list[str]:
    """Return the thesis's experiment with the bumper (4.2.3), if it was run."""
    words = (
        f"Robots of kind `{BUMPED['robot']}`, taller than their lasers see, pause if they touch something or are "
        "blocked for a second. By the thesis's rule a paused robot gets no order (`supervised`); `resumes` orders it "
        "to go on after it has backed out, if the cause is known. Counts are of all runs."
    )
    return ["## Bumpers\n\n" + words + "\n\n" + in_file(bumper_table(rows))] if rows else []


def _left_section(failing: Sequence[Row]) -> list[str]:
    """Return the runs in which the others left a dead robot's area uncovered.

    They did not cover what the robot leaves; the other policies' runs stand besides them.
    """
    words = (
        "Runs in which a supervised team covered less than 99 % of that, and the share that the other policies covered "
        "at the same death."
    )
    is_left = not all(is_covered(row) for row in chosen(failing, SUPERVISED))
    return ["### Runs that left more\n\n" + words + "\n\n" + left_table(failing)] if is_left else []


def _is_generated(row: Row) -> bool:
    return floor_of(row) in floors_of(None)["generated"]


def _about(alone: Sequence[Row]) -> str:
    floors = list(dict.fromkeys(floor_of(row) for row in alone))
    large = [floor for floor in floors if area_m2(floor) >= 300.0]
    is_real = any("/" in floor for floor in floors)
    stand_ins = (
        "" if is_real else " No folder of real floors was given: generated offices and corridors stand in for them."
    )
    return (
        "Kobuki robots with the URG-04LX laser (noise of its data sheet), typical odometry, SLAM, unknown starts, maps "
        f"of 5 cm, cut at {SETTINGS['horizon_s']:.0f} s. Scenario 1 is `apartment`, scenario 2 `clinic`; Jade, Luna "
        f"and Mars start at A, B and C. The others are {len(floors)} floors, {len(large)} of them over 300 m2, with "
        f"starts drawn by the seed, the same for every policy; one robot starts as the first of a team.{stand_ins} "
        "`independent` merges nothing, `oracle_starts` knows the starts ([supervisor](../reference/supervisor.md)). "
        "Entries are medians over runs, ratios and differences those of paired runs, with 95 % intervals. Runs that "
        "miss 99 % count as never, and as done at the horizon if they are the denominator of a ratio. In the "
        "scenarios, one robot's figure is the mean over the starts of the team."
    )


def _notes() -> str:
    return (
        "A merge is wrong if its transform is off by more than 0.3 m or 3 degrees at the centroid of the area that "
        "both maps know, from the true relation of the maps there; drift of SLAM elsewhere does not count. Errors by "
        "the starts of all joined robots, drift included, are counted beside it, within the same bounds and within "
        "those of `result.json`, 2 cells and 0.01 rad. A tick is a look at the tree every 10 s, with its merge and "
        "orders, on one core of a shared machine."
    )


def _about_failing() -> str:
    return (
        "`robot_0` dies at half the time in which the whole supervised team of that floor and seed saw 99 %. Its body "
        "stays, and its map is not used any more: counted is the area that the others have seen, of what the body "
        "leaves in reach."
    )


def _about_extensions() -> str:
    return (
        f"Three robots, {FEWEST_SEEDS} seeds on each of two floors; runs do not end at 99 %. `energy budget` turns "
        f"back at {MARGIN:g} times the energy of the way home. `all together` combines all of them, with `utility`."
    )
