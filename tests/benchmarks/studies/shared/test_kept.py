"""Work of studies that is kept: what is there is not done again, and the page is of what was asked for."""

import json
from dataclasses import dataclass

import pytest

import lidarium
from lidarium.benchmarks.studies.shared.study import do_missing, kept_lines


@dataclass(frozen=True)
class Task:
    key: str


@pytest.fixture
def path(tmp_path):
    return tmp_path / "folder" / "tasks.jsonl"


def run(path, keys, done):
    def measure(task):
        done.append(task.key)
        return {"length": len(task.key)}

    return list(do_missing(path, "tasks", [Task(key) for key in keys], measure, 1))


def test_what_is_in_the_file_is_not_done_again(path):
    done = []
    assert run(path, ["a", "bb"], done) == [("tasks", 1, 2), ("tasks", 2, 2)]
    assert run(path, ["a", "bb", "ccc"], done) == [("tasks", 3, 3)]
    assert run(path, ["a", "bb", "ccc"], done) == []
    assert done == ["a", "bb", "ccc"]


def test_lines_are_those_that_were_asked_for_last_in_their_order(path):
    run(path, ["a", "bb", "ccc"], [])
    run(path, ["ccc", "a"], [])
    assert [line["length"] for line in kept_lines(path)] == [3, 1]


def test_what_was_done_before_a_task_failed_is_kept(path):
    def fail(task):
        if task.key == "bb":
            raise RuntimeError("no")
        return {}

    with pytest.raises(RuntimeError, match="no"):
        list(do_missing(path, "tasks", [Task("a"), Task("bb")], fail, 1))
    done = []
    run(path, ["a", "bb"], done)
    assert done == ["bb"]


def test_a_file_of_another_version_is_refused(path):
    run(path, ["a"], [])
    path.write_text(json.dumps({**json.loads(path.read_text()), "version": f"{lidarium.__version__}0"}) + "\n")
    with pytest.raises(ValueError, match="another version"):
        run(path, ["a", "b"], [])
