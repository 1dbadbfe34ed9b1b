"""What studies have in common: a study, kept lines, real floors, bounds."""

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, TypeVar

import lidarium
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.bounds.bound import known_floor_bound
from lidarium.evaluation.processes import shared_out
from lidarium.evaluation.suites.episodes_file import KEY, EpisodesFile, read_episodes
from lidarium.evaluation.suites.starts import starts_for
from lidarium.evaluation.suites.suite import Suite
from lidarium.mapping.files.output import write_json


def no_suites(_data: Path | None, _every: int) -> dict[str, Suite]:
    """Return no suites: the experiment has work of its own."""
    return {}


@dataclass(frozen=True, slots=True)
class Study:
    """What ``lidarium reproduce NAME`` makes.

    Attributes
    ----------
    page : callable
        Takes the folder that the suites have run into, a folder for each by its name, and returns title and
        sections of the page for ``docs/results``; see `results_page`.
    suites : callable
        Takes the folder of real data (or None) and the share of the floors that is run, every how many-th;
        returns suites by name.
    work : callable or None
        What is done beside suites: takes the folder, that of real data (or None), every how many-th floor and
        the number of processes, and yields what is being done, how much of it is, and of how much. What the
        folder has is not done again.
    pictures : callable or None
        Takes the folder and that of the page, and draws the page's pictures.
    quick : int
        Every how many-th part ``--quick`` runs: at most five minutes on two slow cores.
    needs : mapping of str to tuple of str
        Modules that the work needs, by the extra that has them.
    """

    page: Callable[[Path], str]
    suites: Callable[[Path | None, int], dict[str, Suite]] = no_suites
    work: Callable[[Path, Path | None, int, int], Iterator[tuple[str, int, int]]] | None = None
    pictures: Callable[[Path, Path], None] | None = None
    quick: int = 100
    needs: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


VERSION = "version"
"""Entry of a line: the version of lidarium that did the task."""

Progress = Iterator[tuple[str, int, int]]
"""What is being done, how much of it is, and of how much."""


@dataclass(frozen=True, slots=True)
class Task:
    """A part of a study that is done by itself; its words and numbers tell it from the others."""

    @property
    def key(self) -> str:
        """Name that no other one of its file has."""
        values = (getattr(self, each.name) for each in fields(self))
        return " | ".join(str(value) for value in values if isinstance(value, (str, int)))


T = TypeVar("T", bound=Task)


def do_missing(
    path: Path, what: str, tasks: Sequence[T], measure: Callable[[T], dict[str, Any]], workers: int
) -> Progress:
    """Do the tasks that a file lacks, and keep a line for each.

    A file besides it says which tasks were asked for, since the file may hold others of an earlier call.
    """
    with EpisodesFile(path) as file:
        if any(line[VERSION] != lidarium.__version__ for line in file.episodes):
            raise ValueError(
                f"{path} is of another version than {lidarium.__version__}; choose another folder with --runs"
            )
        write_json(_asked_file(path), {"keys": [task.key for task in tasks]})
        finished = {line[KEY] for line in file.episodes}
        missing = [task for task in tasks if task.key not in finished]
        for done, (task, line) in enumerate(shared_out(measure, missing, workers), len(tasks) - len(missing) + 1):
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


def real_floors(data: Path) -> dict[str, list[Path]]:
    """Return the files of real floors below a folder, by kind."""
    plans = Path(data) / "floorplans"
    meta = plans / "kth" / "meta.json"
    connected = (
        {name for name, entry in json.loads(meta.read_text()).items() if entry["conn"] >= 0.8}
        if meta.is_file()
        else set()
    )
    found = {
        "kth": [
            path
            for path in sorted((plans / "kth" / "xml").glob("*.xml.gz"))
            if path.name.removesuffix(".xml.gz") in connected
        ],
        "lifull": sorted((plans / "lifull" / "txt").glob("*.txt")),
        "slam": sorted((Path(data) / "slam_maps").glob("*.yaml")),
        "dungeon": sorted((plans / "synthetic_dungeon").glob("*.png")),
    }
    if not any(found.values()):
        raise FileNotFoundError(f"no real floors below {data}; want the folders floorplans and slam_maps there")
    return found


TEAMS, HORIZON_S = (1, 2, 3), 1800.0
SETTINGS: dict[str, Any] = {"resolution": 0.05, "stop_coverage": 0.99, "horizon_s": HORIZON_S}
"""Teams and settings of comparisons in the ideal world; an episode is the same in all studies that have it."""

COMPARED = {"kth": slice(0, None, 4), "lifull": slice(1, None, 2)}
"""Real floors on which policies are compared, by kind; settings of tours were chosen on some of the others."""


def compared_floors(data: Path | None) -> dict[str, list[str]]:
    """Return the files of the real floors below a folder on which policies are compared, by kind; none without data."""
    found = {} if data is None else real_floors(data)
    return {kind: [str(path) for path in paths[COMPARED.get(kind, slice(None))]] for kind, paths in found.items()}


@dataclass(frozen=True, slots=True)
class Bounded(Task):
    """A floor, a number of robots and their settings."""

    floor: str
    robots: int
    settings: Mapping[str, Any]


def measure_bound(team: Bounded) -> dict[str, Any]:
    """Return what a team needs that knows the floor, None if it cannot see 99 %."""
    settings = make_settings(robots=team.robots, **team.settings)
    bound = known_floor_bound(team.floor, settings, starts_for(team.floor, settings, 0))
    known = bound.time_s if math.isfinite(bound.time_s) else None
    return {"floor": team.floor, "robots": team.robots, "known_s": known}
