"""Work that is kept: a line of JSON for each task of a study.

A second call does what is missing.
"""

import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Protocol, TypeVar

import lidarium
from lidarium.evaluation.processes import shared_out
from lidarium.evaluation.suites.episodes_file import KEY, EpisodesFile, read_episodes
from lidarium.mapping.files.output import write_json

VERSION = "version"
"""Entry of a line: the version of lidarium that did the task."""

Progress = Iterator[tuple[str, int, int]]
"""What is being done, how much of it is, and of how much."""


class Task(Protocol):
    """A part of a study that is done by itself."""

    @property
    def key(self) -> str:
        """Name that no other one of its file has."""
        ...


T = TypeVar("T", bound=Task)


def do_missing(
    path: Path, what: str, tasks: Sequence[T], measure: Callable[[T], dict[str, Any]], workers: int
) -> Progress:
    """Do the tasks that a file lacks, and keep a line for each.

    A file beside it says which tasks were asked for, since the file may hold others of an earlier call.

    Parameters
    ----------
    path : Path
        The file, one JSON object a line.
    what : str
        What the tasks are, for those who wait.
    tasks : sequence of Task
        All that are asked for.
    measure : callable
        Does a task, and returns its figures; a function of a module where there are several workers.
    workers : int
        Number of processes; one for work that is timed, which this process does itself.

    Raises
    ------
    ValueError
        Where the file is of another version.
    """
    with EpisodesFile(path) as file:
        if any(line[VERSION] != lidarium.__version__ for line in file.episodes):
            raise ValueError(
                f"{path} is of another version than {lidarium.__version__}; choose another folder with --runs"
            )
        write_json(_asked_file(path), {"keys": [task.key for task in tasks]})
        finished = {line[KEY] for line in file.episodes}
        missing = [task for task in tasks if task.key not in finished]
        for done, (task, line) in enumerate(
            shared_out(measure, missing, workers), len(tasks) - len(missing) + 1
        ):
            if isinstance(line, Exception):
                raise line
            file.append({KEY: task.key, **line, VERSION: lidarium.__version__})
            yield what, done, len(tasks)


def kept_lines(path: Path) -> list[dict[str, Any]]:
    """Return the lines of the tasks that were asked for last, in their order."""
    asked = json.loads(_asked_file(path).read_text(encoding="utf-8"))["keys"]
    lines = {line[KEY]: line for line in read_episodes(path)}
    return [lines[key] for key in asked if key in lines]


def _asked_file(path: Path) -> Path:
    return path.with_name(f"{path.stem}_asked.json")
