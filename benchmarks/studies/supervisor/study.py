"""Supervised teams: the thesis's experiments and further ones.

The further ones are the same on generated and real floors, a robot that fails, and each extension alone.
"""

import json
import platform
from collections.abc import Iterator, Mapping, Sequence
from datetime import date
from pathlib import Path
from typing import Any

import lidarium
from lidarium.benchmarks.studies.shared.study import Study
from lidarium.benchmarks.studies.supervisor import tables
from lidarium.benchmarks.studies.supervisor.figures import (
    Row,
    chosen,
    floor_of,
    has_wrong_merge,
    time_of,
    time_shares,
)
from lidarium.benchmarks.studies.supervisor.goals import SUPERVISED, Goal, goals_of, is_covered
from lidarium.benchmarks.studies.supervisor.suites import (
    FEWEST_SEEDS,
    MARGIN,
    POLICIES,
    SETTINGS,
    area_m2,
    five_floors,
    floors_of,
    suites,
)
from lidarium.envs.exploration import ExplorationEnv
from lidarium.evaluation.episodes.output import write_json
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.supervision import decision_lines
from lidarium.evaluation.suites.campaign import EPISODES_FILE, Campaign, drawn_starts
from lidarium.evaluation.suites.episodes_file import KEY, read_episodes
from lidarium.evaluation.suites.suite import Suite, Trial

__all__ = ["page", "suites", "work"]

FAILING, LOGS_FILE, ASKED_FILE = "failing", "logs.json", "asked.json"
EXTENSION_SUITES = ("extensions", "radio", "energy", "together")
LINES_SHOWN = 12
"""Lines of a log on the page."""

SECONDS_PER_HOUR = 3600.0


def work(folder: Path, data: Path | None, every: int, workers: int) -> Iterator[tuple[str, int, int]]:
    """Run what depends on the suites.

    It is teams of which a robot fails at half time, and typical runs of which the log is kept.

    Yields what is being done, how much of it is, and of how much; what the folder has is not done again.
    """
    plan = suites(data, every)
    asked = {name: {trial.key: (suite, trial) for trial in suite.trials()} for name, suite in plan.items()}
    rows = {
        name: [row for row in _read(folder / name) if row[KEY] in of_suite]
        for name, of_suite in asked.items()
    }
    failing, trials = failing_suite(rows["teams"], plan["teams"])
    if failing is not None:
        campaign = Campaign(failing, folder / FAILING, workers, records=False, trials=trials)
        for _ in campaign.run():
            yield "runs in which a robot fails", campaign.done, campaign.total
        if campaign.failures:
            trial, error = campaign.failures[0]
            raise ValueError(
                f"{len(campaign.failures)} runs came to no end, the first is {trial.key}: {error}"
            )
    asked[FAILING] = {} if failing is None else {trial.key: (failing, trial) for trial in trials}
    write_json(folder / ASKED_FILE, {name: sorted(of_suite) for name, of_suite in asked.items()})
    kept = _of_file(folder / LOGS_FILE)
    typical = typical_runs(rows, goals_of(rows, _rows(folder, FAILING)))
    logs: dict[str, Any] = {}
    for name, row in typical.items():
        before, key = kept.get(name, {}), str(row[KEY])
        if before.get(KEY) != key:
            before = {
                KEY: key,
                "lines": _log_of(*next(of_suite[key] for of_suite in asked.values() if key in of_suite)),
            }
        logs[name] = before
        yield "logs", len(logs), len(typical)
    write_json(folder / LOGS_FILE, logs)


def failing_suite(rows: Sequence[Row], teams: Suite) -> tuple[Suite | None, list[Trial]]:
    """Return a suite of teams whose first robot dies halfway, and its trials.

    It dies at half the time that the whole team took; None without any.

    Parameters
    ----------
    rows : sequence of dict
        Runs of whole teams.
    teams : Suite
        What they are of.
    """
    floors = five_floors(teams.floors)
    whole = [row for row in chosen(rows, SUPERVISED) if floor_of(row) in floors and row["t99_s"] is not None]
    if not whole:
        return None, []
    variants: dict[str, Mapping[str, Any]] = {}
    trials: list[Trial] = []
    for row in whole:
        half = round(0.5 * time_of(row), 1)
        name = f"robot_0 dies at {half} s"
        variants[name] = {
            **SETTINGS,
            "stop_coverage": None,
            "faults": {"schedule": [{"kind": "dead_robot", "robot": 0, "at_s": half}]},
        }
        trials += [Trial(name, floor_of(row), row["robots"], -1, row["seed"], policy) for policy in POLICIES]
    suite = Suite(policies=POLICIES, floors=floors, robots=teams.robots, seeds=teams.seeds, variants=variants)
    return suite, trials


def typical_runs(rows: Mapping[str, Sequence[Row]], goals: Sequence[Goal]) -> dict[str, Row]:
    """Return runs of what was missed, by what that is.

    For each size of teams that missed something, the supervised run whose share of one robot's time is the
    median; where runs are counted, the middle one of those that did not do as is wanted.
    """
    found: dict[str, Row] = {}
    for robots in sorted(
        {
            goal.robots
            for goal in goals
            if goal.robots is not None and goal.found is not None and not goal.is_reached
        }
    ):
        runs = chosen([*rows["teams"], *rows["five"]], SUPERVISED, robots)
        # Each alone, as a run without a partner has no share.
        ranked = sorted(
            (shares[0], str(row[KEY]), row) for row in runs if (shares := time_shares([row], rows["one"]))
        )
        if ranked:
            found[f"{robots} robots"] = ranked[len(ranked) // 2][2]
    return found | {
        goal.title.removesuffix(" [%]"): goal.missed_by[len(goal.missed_by) // 2]
        for goal in goals
        if goal.missed_by
    }


def page(folder: Path, command: str) -> str:
    """Return the results as markdown."""
    rows = {name: _rows(folder, name) for name in suites(None)}
    failing = _rows(folder, FAILING)
    goals = goals_of(rows, failing)
    every = [*(row for group in rows.values() for row in group), *failing]
    hours = sum(float(row["wall_s"]) for row in every) / SECONDS_PER_HOUR
    alone = rows["one"]
    parts = [
        "# Supervised teams",
        f"Made by `{command}` on {date.today().isoformat()}: lidarium {lidarium.__version__}, Python "
        f"{platform.python_version()}; "
        f"{len(every)} runs, {hours:.2f} hours of one core, {hours / 2.0:.2f} of two.",
        _about(alone),
        "## What was to be reached\n\n" + tables.goals_table(goals),
        _notes(),
        *_wrong_section(every),
        *_logs_section(_of_file(folder / LOGS_FILE)),
        "## Test 1: each robot alone\n\n" + tables.alone_table(rows["alone"]),
        *(
            f"## Test 2: pairs, {floor}\n\nJade with Luna (starts A and B), and with Mars (A and C).\n\n"
            + tables.team_table([row for row in rows["pairs"] if floor_of(row) == floor], rows["alone"])
            for floor in dict.fromkeys(floor_of(row) for row in rows["pairs"])
        ),
        "## Test 3: three robots, apartment\n\n" + tables.team_table(rows["three"], rows["alone"]),
        "## One robot on each floor\n\n" + tables.one_table(alone),
    ]
    generated = [row for row in rows["teams"] if _is_generated(row)]
    real = [row for row in rows["teams"] if not _is_generated(row)]
    for title, some in (
        ("All floors", rows["teams"]),
        ("Generated floors", generated),
        ("Real floors, or what stands in for them", real),
    ):
        if some:
            parts.append(f"## {title}\n\n" + tables.team_table(some, alone))
    parts += [
        "## Five robots\n\n" + tables.five_table(rows["five"], alone),
        "## A robot fails\n\n" + _about_failing() + "\n\n" + tables.failing_table(failing),
        *_left_section(failing),
        "## Extensions\n\n" + _about_extensions(),
        *(tables.extension_table(rows[name]) for name in EXTENSION_SUITES if rows[name]),
    ]
    return "\n\n".join(parts) + "\n"


def _read(folder: Path) -> list[Row]:
    return list(read_episodes(folder / EPISODES_FILE))


def _rows(folder: Path, name: str) -> list[Row]:
    """Return the runs of a suite that were asked for last.

    The folder may hold more, of a call for a larger share.
    """
    keys = _of_file(folder / ASKED_FILE).get(name)
    return [row for row in _read(folder / name) if keys is None or row[KEY] in keys]


def _of_file(path: Path) -> dict[str, Any]:
    return dict(json.loads(path.read_text(encoding="utf-8"))) if path.exists() else {}


def _log_of(suite: Suite, trial: Trial) -> list[str]:
    """Run a trial once more and return the lines of its log."""
    settings = suite.settings(trial.variant, trial.robots)
    starts = suite.starts_of(trial) or drawn_starts(trial.floor, settings, trial.seed)
    env = ExplorationEnv(trial.floor, settings)
    episode = run_episode(
        suite.make_policy(trial.policy), env, trial.seed, None if starts is None else {"starts": starts}
    )
    return decision_lines(episode.policy.report()).splitlines()


def _wrong_section(rows: Sequence[Row]) -> list[str]:
    """Return the runs that used a wrong merge, with what the robots' own maps err by."""
    wrong = [row for row in rows if has_wrong_merge(row)]
    if not wrong:
        return []
    words = (
        "Runs with a merge that is wrong: how far off it is where the maps meet, how far by what the starts "
        "say, and the error of each "
        "robot's own trajectory."
    )
    return ["### Wrong merges\n\n" + words + "\n\n" + tables.wrong_table(wrong)]


def _left_section(failing: Sequence[Row]) -> list[str]:
    """Return the runs in which the others left a dead robot's area uncovered.

    They did not cover what the robot leaves; the other policies' runs stand beside them.
    """
    words = (
        "Runs in which a supervised team covered less than 99 % of that, and what the others covered of it "
        "at the same death."
    )
    is_left = not all(is_covered(row) for row in chosen(failing, SUPERVISED))
    return ["### Runs that left more\n\n" + words + "\n\n" + tables.left_table(failing)] if is_left else []


def _logs_section(logs: Mapping[str, Any]) -> list[str]:
    """Return the logs of typical runs where something was missed."""
    if not logs:
        return []
    parts = [
        "### Typical runs\n\nWhere a figure was missed, what the station noted and ordered: for a size of "
        "teams in the run whose share "
        "of one robot's time is the median, where runs are counted in the middle one of those that missed it."
    ]
    for name, log in logs.items():
        told = [line for entry in log["lines"] if (line := _told(json.loads(entry)))]
        left_out = len(told) - LINES_SHOWN
        if left_out > 0:
            told = [*told[: LINES_SHOWN // 2], f"... {left_out} more", *told[-LINES_SHOWN // 2 :]]
        parts.append(f"{name}, `{_short(log[KEY])}`:\n\n```\n" + "\n".join(told) + "\n```")
    return parts


def _told(entry: Mapping[str, Any]) -> str:
    """Return what happened at the station, or an order, in a line.

    Nothing of decisions to go on.
    """
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


def _is_generated(row: Row) -> bool:
    return floor_of(row) in floors_of(None)["generated"]


def _about(alone: Sequence[Row]) -> str:
    floors = list(dict.fromkeys(floor_of(row) for row in alone))
    large = [floor for floor in floors if area_m2(floor) >= 300.0]
    is_real = any("/" in floor for floor in floors)
    stand_ins = (
        ""
        if is_real
        else " No folder of real floors was given: generated offices and corridors stand in for them."
    )
    return (
        "Kobuki robots with the URG-04LX laser, noise as of its data sheet, typical wheel odometry, SLAM, "
        "starts that nobody knows, maps "
        f"of 5 cm, cut at {SETTINGS['horizon_s']:.0f} s. Scenario 1 is `apartment`, scenario 2 `clinic`; "
        "Jade, Luna and Mars start at A, B "
        f"and C. The others are {len(floors)} floors, {len(large)} of them over 300 m2; starts are drawn by "
        "the seed, the same for every "
        f"policy, and that of one robot is that of a team's first.{stand_ins} `independent` merges nothing, "
        "`oracle_starts` is told how "
        "the robots stand to each other ([supervisor](../reference/supervisor.md)). Entries are medians over "
        "runs, ratios and differences "
        "those of paired runs, with intervals of 95 %; what was not done by the horizon counts as never, and "
        "as done then where others are "
        "divided by it. Where a team starts at starts that robots tried alone, as in the scenarios, one "
        "robot's figure is the mean of "
        "theirs."
    )


def _notes() -> str:
    return (
        "A merge is wrong where the transform that was found is off by more than 0.3 m or 3 degrees at the "
        "centroid of what both maps "
        "know, from how the maps truly lie to each other there: a robot's map lies as its pose did when it "
        "was nearest to there. Maps "
        "that SLAM draws drift, and no merger can know by how much. Where a third robot's map lies between "
        "two, its drift and the lever "
        "of small angles come to what is between them, and the merges that join them are judged themselves. "
        "So what the starts say of all "
        "joined robots is counted beside it, within the same bounds and within those of `result.json`, 2 "
        "cells and 0.01 rad. "
        "A tick is a look at the tree every 10 s, with its merge and what robots are told, on one core of a "
        "machine that others share."
    )


def _about_failing() -> str:
    return (
        "`robot_0` dies at half the time in which the whole supervised team of that floor and seed saw 99 %. "
        "Its body stands where it is. "
        "Its map is used no more, so the others cover its part, too: counted is what they have seen "
        "themselves, of what the body "
        "leaves in reach."
    )


def _about_extensions() -> str:
    return (
        f"Three robots, {FEWEST_SEEDS} seeds on each of two floors; runs are not ended at 99 %, since what "
        "robots do then counts, too. "
        f"`energy budget` turns back at {MARGIN:g} times what the way home costs. `all together` is every "
        "one at once, with `utility`."
    )


STUDY = Study(page, suites, work=work)
