"""Supervised teams: the thesis's experiments and further ones.

The further ones are the same on generated and real floors, a robot that fails, and each extension alone.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from lidarium.benchmarks.studies.shared.study import Study
from lidarium.benchmarks.studies.supervisor.figures import Row, chosen, floor_of, time_of, time_shares
from lidarium.benchmarks.studies.supervisor.goals import SUPERVISED, Goal, goals_of
from lidarium.benchmarks.studies.supervisor.page import page
from lidarium.benchmarks.studies.supervisor.runs import ASKED_FILE, FAILING, LOGS_FILE, asked_runs, read_json, read_runs
from lidarium.benchmarks.studies.supervisor.suites import POLICIES, SETTINGS, five_floors, suites
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.evaluation.episodes.events import decision_lines
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.suites.campaign import Campaign
from lidarium.evaluation.suites.episodes_file import KEY
from lidarium.evaluation.suites.starts import drawn_starts
from lidarium.evaluation.suites.suite import Suite
from lidarium.evaluation.suites.trial import Trial
from lidarium.mapping.files.output import write_json

__all__ = ["page", "suites", "work"]


def work(folder: Path, data: Path | None, every: int, workers: int) -> Iterator[tuple[str, int, int]]:
    """Run what depends on the suites.

    It is teams of which a robot fails at half time, and typical runs of which the log is kept.

    Yields what is being done, how much of it is, and of how much; what the folder has is not done again.
    """
    plan = suites(data, every)
    asked = {name: {trial.key: (suite, trial) for trial in suite.trials()} for name, suite in plan.items()}
    rows = {name: [row for row in read_runs(folder / name) if row[KEY] in of_suite] for name, of_suite in asked.items()}
    failing, trials = failing_suite(rows["teams"], plan["teams"])
    if failing is not None:
        campaign = Campaign(failing, folder / FAILING, workers, records=False, trials=trials)
        for _ in campaign.run():
            yield "runs in which a robot fails", campaign.done, campaign.total
        if campaign.failures:
            trial, error = campaign.failures[0]
            raise ValueError(f"{len(campaign.failures)} runs came to no end, the first is {trial.key}: {error}")
    asked[FAILING] = {} if failing is None else {trial.key: (failing, trial) for trial in trials}
    write_json(folder / ASKED_FILE, {name: sorted(of_suite) for name, of_suite in asked.items()})
    kept = read_json(folder / LOGS_FILE)
    typical = typical_runs(rows, goals_of(rows, asked_runs(folder, FAILING)))
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
        {goal.robots for goal in goals if goal.robots is not None and goal.found is not None and not goal.is_reached}
    ):
        runs = chosen([*rows["teams"], *rows["five"]], SUPERVISED, robots)
        # Each alone, as a run without a partner has no share.
        ranked = sorted((shares[0], str(row[KEY]), row) for row in runs if (shares := time_shares([row], rows["one"])))
        if ranked:
            found[f"{robots} robots"] = ranked[len(ranked) // 2][2]
    return found | {
        goal.title.removesuffix(" [%]"): goal.missed_by[len(goal.missed_by) // 2] for goal in goals if goal.missed_by
    }


def _log_of(suite: Suite, trial: Trial) -> list[str]:
    """Run a trial once more and return the lines of its log."""
    settings = suite.settings(trial.variant, trial.robots)
    starts = suite.starts_of(trial) or drawn_starts(trial.floor, settings, trial.seed)
    env = ExplorationEnv(trial.floor, settings)
    episode = run_episode(
        suite.make_policy(trial.policy), env, trial.seed, None if starts is None else {"starts": starts}
    )
    return decision_lines(episode.policy.report()).splitlines()


STUDY = Study(page, suites, work=work)
