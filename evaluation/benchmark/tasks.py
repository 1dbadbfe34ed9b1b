"""Tasks of a benchmark, as its file in data/ has them, and their environments."""

import difflib
import hashlib
import json
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from lidarium.envs.floors.catalogue.names import load_floor, set_floors
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.settings_identity import settings_sha256
from lidarium.evaluation.suites.starts import starts_for
from lidarium.evaluation.suites.suite import Suite

if TYPE_CHECKING:
    from lidarium.envs.faces.gymnasium_env import SoloExploration
    from lidarium.envs.faces.parallel import ExplorationEnv

DATA = Path(__file__).parent / "data"
SEED = 0
"""Seed of all episodes: tasks repeat on floors, not on seeds."""

Size = Literal["easy", "full"]


@dataclass(frozen=True, slots=True)
class TaskHashes:
    """What a task must not lose: hashes of its settings, and of each floor and the starts on it."""

    settings: str
    floors: tuple[str, ...]
    starts: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class BenchmarkTask:
    """Floors, a team and a world, in which policies are compared.

    Attributes
    ----------
    name : str
        Name, such as ``Buildings-2``.
    about : str
        Its question, in one line.
    floors : tuple of str
        Floors of the full size; the easy size has the first ones.
    robots, easy : int
        Size of the team, and number of floors of the easy size.
    settings : dict
        As the options of ``lidarium.parallel_env``.
    policies : tuple of str
        Reference policies; ``baseline``, one of them, is what ratios are of.
    observes : tuple of str
        Observations that a policy reads to take part.
    hashes : TaskHashes or None
        None before they are frozen.
    """

    name: str
    about: str
    floors: tuple[str, ...]
    robots: int
    easy: int
    settings: Mapping[str, Any]
    policies: tuple[str, ...]
    baseline: str
    observes: tuple[str, ...]
    hashes: TaskHashes | None

    @property
    def id(self) -> str:
        """Id in Gymnasium (one robot) and PettingZoo."""
        return f"lidarium/{self.name}-v1"

    def floors_of(self, size: Size) -> tuple[str, ...]:
        """Return the floors of a size."""
        return self.floors[: self.easy] if size == "easy" else self.floors

    def suite(
        self,
        policies: tuple[str, ...],
        size: Size,
        policy_settings: Mapping[str, Mapping[str, Any]] | None = None,
    ) -> Suite:
        """Return the suite of policies on the task's floors."""
        return Suite(
            policies=policies,
            floors=self.floors_of(size),
            robots=(self.robots,),
            seeds=(SEED,),
            variants={self.name: self.settings},
            policy_settings={name: given for name, given in (policy_settings or {}).items() if name in policies},
        )

    def measured_on(self, floors: tuple[str, ...]) -> TaskHashes:
        """Compute the hashes of the task, on some floors, as this installation has it."""
        settings = make_settings(robots=self.robots, **self.settings)
        starts = [starts_for(floor, settings, SEED) for floor in floors]
        return TaskHashes(
            settings_sha256(settings)[:16],
            tuple(load_floor(floor).sha256[:16] for floor in floors),
            tuple(starts_hash(each) for each in starts),
        )


@dataclass(frozen=True, slots=True)
class Benchmark:
    """A benchmark: its name, its question, and its tasks by name."""

    name: str
    about: str
    tasks: Mapping[str, BenchmarkTask]

    def task(self, name: str) -> BenchmarkTask:
        """Return a task by its name or id."""
        short = name.removeprefix("lidarium/").removesuffix("-v1")
        if short not in self.tasks:
            nearest = difflib.get_close_matches(short, self.tasks, n=1)
            guess = f", did you mean {nearest[0]!r}?" if nearest else ""
            raise ValueError(f"{self.name} has no task {name!r}{guess}; it has {', '.join(self.tasks)}")
        return self.tasks[short]


def starts_hash(starts: list[list[float]]) -> str:
    """Return the hash of starts x, y, theta of each robot, rounded as rows of episodes have them."""
    rounded = [[round(float(number), 6) for number in start] for start in starts]
    return hashlib.sha256(json.dumps(rounded).encode()).hexdigest()[:16]


def benchmark_names() -> tuple[str, ...]:
    """Return the names of all benchmarks."""
    return tuple(sorted(path.stem for path in DATA.glob("*.toml")))


@lru_cache
def benchmark(name: str) -> Benchmark:
    """Return a benchmark by its name."""
    if name not in benchmark_names():
        raise ValueError(f"no benchmark {name!r}; there are {', '.join(benchmark_names())}")
    content = tomllib.loads((DATA / f"{name}.toml").read_text(encoding="utf-8"))
    hashes = DATA / f"{name}.json"
    frozen = json.loads(hashes.read_text(encoding="utf-8")) if hashes.is_file() else {}
    common = {key: content[key] for key in ("horizon_s", "stop_coverage")}
    tasks = {}
    for task, given in content["tasks"].items():
        floors = given["floors"]
        known = frozen.get(task)
        tasks[task] = BenchmarkTask(
            name=task,
            about=given["about"],
            floors=set_floors(floors)[: given["full"]] if isinstance(floors, str) else tuple(floors[: given["full"]]),
            robots=given["robots"],
            easy=given["easy"],
            settings={**common, **_flat(given.get("settings", {}))},
            policies=(*given.get("policies", content["policies"]), *given.get("also", ())),
            baseline=given.get("baseline", content["baseline"]),
            observes=tuple(given.get("observes", ())),
            hashes=TaskHashes(known["settings"], tuple(known["floors"]), tuple(known["starts"])) if known else None,
        )
    return Benchmark(name, content["about"], tasks)


def _flat(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return settings of parts, given as tables, as the option ``assigned`` takes them; others unchanged."""
    plain = {name: value for name, value in settings.items() if not isinstance(value, Mapping)}
    parts = [
        f"{name}.{key}={value}"
        for name, table in settings.items()
        if isinstance(table, Mapping)
        for key, value in table.items()
    ]
    return {**plain, **({"assigned": parts} if parts else {})}


def make_task(task: str, **options: Any) -> "ExplorationEnv":  # noqa: ANN401
    """Make the environment of a task of lidarium-1, which draws one of its floors in each episode (PettingZoo).

    Parameters
    ----------
    task : str
        Name or id of the task.
    **options
        As for ``lidarium.parallel_env``, such as ``level`` and ``observe``; the task's own cannot be given.
    """
    from lidarium.envs.faces.makers import parallel_env

    return parallel_env(**_options(task), **options)


def make_solo_task(task: str, **options: Any) -> "SoloExploration":  # noqa: ANN401
    """Make the environment of a task for one robot (Gymnasium); options as for `make_task`."""
    from lidarium.envs.faces.gymnasium_env import SoloExploration

    found = _options(task)
    del found["robots"]
    return SoloExploration(**found, **options)


def _options(task: str) -> dict[str, Any]:
    found = benchmark("lidarium-1").task(task)
    return {"floor": list(found.floors), "robots": found.robots, **found.settings}
