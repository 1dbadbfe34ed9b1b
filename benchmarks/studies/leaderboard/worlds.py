"""Which policies run where: floors by kind, and worlds by how real they are."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lidarium.benchmarks.studies.shared.study import real_floors
from lidarium.envs.floors.catalogue.names import set_floors
from lidarium.evaluation.suites.suite import Suite
from lidarium.evaluation.suites.trial import DEFAULT_VARIANT

HORIZON_S = 1800.0
SETTINGS: dict[str, Any] = {"resolution": 0.05, "stop_coverage": 0.99, "horizon_s": HORIZON_S}

EXPLORERS = ("nearest_frontier", "utility_frontier", "explore_lite", "srt", "tour_frontier", "learned")
SUPERVISED = ("independent", "supervised", "supervised_tours", "supervised_learned")
TEAMS = (1, 2, 3)


@dataclass(frozen=True, slots=True)
class World:
    """How real a world is, who explores it, and on which share of the floors.

    `about`: what is different in it, for the table; `policies`: who explores; the first is the baseline; `settings`:
    what differs from `SETTINGS`; `every`: of the floors that run, every that many-th runs in this world; `teams`:
    numbers of robots.
    """

    about: str
    policies: tuple[str, ...]
    settings: dict[str, Any]
    every: int = 1
    teams: tuple[int, ...] = TEAMS


WORLDS = {
    "ideal": World("ideal", (*EXPLORERS, "nearest_frontier_own_map", "random_walk"), {}),
    "lab": World("lab", EXPLORERS, {"realism": "lab"}, every=4),
    "unknown": World(
        "lab, unknown starts", SUPERVISED, {"realism": "lab", "known_starts": False}, every=2, teams=(2, 3)
    ),
    "camera": World("ideal, by camera", ("sparse_frontier",), {"camera": "xtion_tilted"}, every=8),
}
"""By the name of the folder of their episodes, behind the kind of floor."""

KINDS = {
    "test": "generated floors of the set `test`",
    "lifull": "LIFULL apartments",
    "kth": "KTH campus floors, of which at least 80 % are connected",
    "dungeon": "dungeons, 0.1 m a pixel",
    "slam": "maps that robots made of real buildings",
}
EVERY = {"lifull": 3, "kth": 3, "slam": 3}
"""Of a kind every so many-th floor is taken, beside what is asked for: one for kinds that are not named."""

NOT_RUN = {"kth": ("unknown", "camera"), "dungeon": ("lab", "unknown", "camera"), "slam": ("lab", "unknown", "camera")}
"""Worlds in which large floors are left out: an episode takes minutes there."""

BOUNDED = {"test": 2, "lifull": 1}
"""Kinds whose floors are bounded, and of how many one is."""


def floors_of(data: Path | None, every: int) -> dict[str, list[str]]:
    """Return the floors by kind, every that many-th; kinds of fewer are left out, but for generated ones."""
    found = {"test": list(set_floors("test"))}
    if data is not None:
        found |= {kind: [str(path) for path in paths] for kind, paths in real_floors(data).items()}
    return {
        kind: floors[:: every * EVERY.get(kind, 1)]
        for kind, floors in found.items()
        if kind == "test" or len(floors) >= every
    }


def suites(data: Path | None, every: int = 1) -> dict[str, Suite]:
    """Return the suites by kind of floor and world."""
    floors = floors_of(data, every)
    return {
        f"{kind}_{name}": Suite(
            policies=world.policies,
            floors=tuple(floors[kind][:: world.every]),
            robots=world.teams,
            seeds=(0,),
            variants={DEFAULT_VARIANT: {**SETTINGS, **world.settings}},
        )
        for kind, name, world in parts()
        if kind in floors
    }


def parts() -> Iterator[tuple[str, str, World]]:
    """Yield each kind of floor with the worlds in which its floors run, and their names."""
    for kind in KINDS:
        for name, world in WORLDS.items():
            if name not in NOT_RUN.get(kind, ()):
                yield kind, name, world
