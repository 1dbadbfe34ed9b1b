"""`lidarium benchmark`: compare policies with the reference policies in the tasks of a benchmark."""

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from tyro.conf import Positional

from lidarium.scripts.commands.evaluate import shard_of
from lidarium.scripts.common import DEFECT, DONE, INTERRUPTED, Answer, Command, compile_first, counted, notify, table
from lidarium.scripts.options import options_by_policy

if TYPE_CHECKING:
    from lidarium.evaluation.benchmark.results import BenchmarkResults
    from lidarium.evaluation.benchmark.tasks import BenchmarkTask, Size

RUNS = Path("runs")


@dataclass(frozen=True, kw_only=True)
class _Benchmark(Command):
    """Run policies in the tasks of a benchmark, and compare them with the reference policies, whose rows come along.

    Writes table.md, card.md, results.json and a report to --out. Finished episodes are kept: the same command goes on
    after the last one.
    """

    compiles: ClassVar[bool] = True

    name: Positional[str] = "lidarium-1"
    """benchmark"""
    policies: tuple[str, ...] = ()
    """policies that run: module:Class for your own; none to see the reference policies"""
    reference: bool = False
    """run the reference policies again instead of taking their rows"""
    policy_set: tuple[str, ...] = ()
    """settings of policies as POLICY.KEY=VALUE, such as learned.weights=FILE"""
    tasks: tuple[str, ...] = ()
    """tasks by name or id; all by default"""
    quick: bool = False
    """take the easy size, 6 to 8 floors a task, in place of the full one"""
    workers: int = 0
    """processes that run episodes; 0 for as many as there are cores"""
    ray: str | None = None
    """Ray cluster that runs episodes in place of --workers: auto, or HOST:PORT (extra `ray`)"""
    shard: str | None = None
    """part of the episodes that runs, as K/N: the K-th of N, for machines that share --out one after the other"""
    records: bool = False
    """keep a record of every episode, for replays"""


def execute(command: _Benchmark) -> Answer:
    """Run what is missing of the tasks, and compare."""
    from lidarium.agents.catalogue import source_of
    from lidarium.evaluation.benchmark.results import collect
    from lidarium.evaluation.benchmark.tasks import benchmark
    from lidarium.mapping.files.output import check_writable

    if command.workers < 0:
        raise ValueError(f"--workers is {command.workers}; want 0 for as many as there are cores, or more")
    found = benchmark(command.name)
    asked = dict.fromkeys(found.task(name).name for name in command.tasks)
    tasks = [found.tasks[name] for name in asked] or list(found.tasks.values())
    known = {name for task in tasks for name in task.policies} if command.reference else set()
    settings = options_by_policy(command.policy_set, tuple({*command.policies, *known}))
    for name in sorted({name for task in tasks for name in task.policies} & set(settings)):
        raise ValueError(
            f"--policy-set sets options of {name}, whose rows are those of its defaults; want another name: "
            f"--policies mine --policy-set mine.policy={name} mine.KEY=VALUE"
        )
    for name in command.policies:  # a name that does not exist is refused before anything runs
        source_of(str(settings.get(name, {}).get("policy", name)))
    folder = command.out or RUNS / command.name
    check_writable(folder)
    shard_of(command.shard)
    size: Size = "easy" if command.quick else "full"
    if command.policies or command.reference:
        compile_first()
    failures: dict[tuple[str, str], str] = {}
    absent: dict[tuple[str, str], str] = {}
    is_interrupted = False
    for task in tasks:
        policies = tuple(dict.fromkeys([*command.policies, *(task.policies if command.reference else ())]))
        if policies and not is_interrupted:
            is_interrupted = _run(command, task, policies, settings, folder / task.name, failures, absent)
    results = collect(found, tasks, size, folder, absent | failures)
    code = INTERRUPTED if is_interrupted else DEFECT if failures else DONE
    return Answer({"folder": str(folder), "interrupted": is_interrupted}, _text(results, folder), code)


def _run(
    command: _Benchmark,
    task: "BenchmarkTask",
    policies: tuple[str, ...],
    settings: Mapping[str, Mapping[str, Any]],
    folder: Path,
    failures: dict[tuple[str, str], str],
    absent: dict[tuple[str, str], str],
) -> bool:
    """Run what is missing of a task, keep what failed, and return whether it was interrupted.

    A policy that cannot run in the task fails there only; one that lacks the task's observations does not take part.
    """
    from lidarium.evaluation.suites.campaign import Campaign

    runnable = []
    for policy in policies:
        try:
            observes = task.suite((policy,), "easy", settings).make_policy(policy).observes
        except Exception as error:  # a policy of the user may fail in any way
            failures[task.name, policy] = f"{type(error).__name__}: {error}"
        else:
            if missing := [name for name in task.observes if name not in observes]:
                absent[task.name, policy] = f"does not take part, as it does not observe {' and '.join(missing)}"
            else:
                runnable.append(policy)
    if not runnable:
        return False
    suite = task.suite(tuple(runnable), "easy" if command.quick else "full", settings)
    trials = list(suite.trials())[shard_of(command.shard)]
    workers = command.workers or len(os.sched_getaffinity(0))
    campaign = Campaign(suite, folder, workers, command.records, trials, cluster=command.ray)
    runs = campaign.run()
    is_interrupted = False
    try:
        for _ in counted(runs, len(trials), f"episodes of {task.name}", command.json, done=lambda: campaign.done):
            pass
    except KeyboardInterrupt:
        is_interrupted = True
    finally:
        runs.close()
    for policy in runnable:
        errors = [error for trial, error in campaign.failures if trial.policy == policy]
        if errors:
            total = sum(trial.policy == policy for trial in trials)
            why = f"{type(errors[0]).__name__}: {errors[0]}"
            failures[task.name, policy] = f"{len(errors)} of {total} episodes failed, first by {why}"
            notify(f"{task.name}, {policy}: {failures[task.name, policy]}")
    return is_interrupted


def _text(results: "BenchmarkResults", folder: Path) -> str:
    """Return the table for the console."""
    rows = [
        (
            each.task,
            each.policy if each.is_reference else f"* {each.policy}",
            each.runs,
            f"{100.0 * each.success.estimate:.0f} %",
            "never" if math.isinf(each.time_s.estimate) else f"{each.time_s.estimate:.0f}",
            "baseline" if each.is_baseline else "-" if each.ratio is None else f"{each.ratio:.2f}",
        )
        for each in results.standings
    ]
    overall = [(policy, f"{mean:.3f}", number) for policy, (mean, number) in results.overall.items()]
    return "\n".join(
        [
            f"{results.benchmark}, size {results.size}; * ran here, rows of the others are shipped",
            table(rows, ("task", "policy", "runs", "99 %", "median [s]", "time relative to the baseline")),
            "",
            table(overall, ("policy", "time relative to the baselines", "tasks")),
            *(f"  {remark}" for remark in results.remarks),
            f"  {folder}: table.md, card.md, results.json, report/report.html",
        ]
    )
