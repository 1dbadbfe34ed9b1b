"""The rows of reference policies that ship are those that this lidarium makes."""

import pytest

from lidarium.evaluation.benchmark.results import NOT_SHIPPED, reference_rows
from lidarium.evaluation.benchmark.tasks import benchmark, starts_hash
from lidarium.evaluation.suites.episodes_file import KEY
from lidarium.evaluation.suites.trial_run import run_trial

NAME = "lidarium-1"
ROWS = reference_rows(NAME)
TASKS = benchmark(NAME).tasks
SAME_ON_ALL_MACHINES = tuple(name for name in TASKS if name != "Bullet-2")
"""Tasks that run without PyBullet, which gives the same bits only on one machine."""


def test_all_tasks_have_rows():
    assert set(ROWS) == set(TASKS)


@pytest.mark.parametrize("task", [TASKS[name] for name in ROWS], ids=list(ROWS))
def test_rows_are_of_every_policy_on_every_frozen_floor(task):
    rows = ROWS[task.name]
    floors = dict(zip(task.floors, zip(task.hashes.floors, task.hashes.starts, strict=True), strict=True))
    assert {row["policy"] for row in rows} == set(task.policies)
    for policy in task.policies:
        assert sorted(row[KEY].split(" | ")[1] for row in rows if row["policy"] == policy) == sorted(floors)
    for row in rows:
        floor, starts = floors[row[KEY].split(" | ")[1]]
        assert row["settings_sha256"].startswith(task.hashes.settings)
        assert row["floor_sha256"].startswith(floor)
        assert starts_hash(row["starts"]) == starts


@pytest.mark.parametrize("name", SAME_ON_ALL_MACHINES)
def test_an_episode_gives_the_shipped_row_to_the_bit(name):
    task = TASKS[name]
    suite = task.suite((task.baseline,), "easy")
    trial = next(suite.trials())
    (shipped,) = [row for row in ROWS[name] if row[KEY] == trial.key]
    found = run_trial(suite, trial)
    # Metrics that came later are in no row that was shipped before.
    assert {key: found[key] for key in shipped} == shipped
    assert not set(NOT_SHIPPED) & set(shipped)
