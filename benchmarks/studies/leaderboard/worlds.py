"""Which policies run where: floors by kind, and worlds by how real they are."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lidarium.benchmarks.studies.shared.study import SETTINGS, TEAMS, compared_floors
from lidarium.envs.floors.catalogue.names import set_floors
from lidarium.evaluation.suites.suite import Suite
from lidarium.evaluation.suites.trial import DEFAULT_VARIANT

EXPLORERS = (
    "nearest_frontier",
    "utility_frontier",
    "explore_lite",
    "srt",
    "tour_frontier",
    "predicted_tours",
    "learned",
)
SUPERVISED = ("independent", "supervised", "supervised_tours", "supervised_predicted", "supervised_learned")


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
        "lab, unknown starts", SUPERVISED, {"realism": "lab", "known_starts": False}, every=4, teams=(2, 3)
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
NOT_RUN = {
    "kth": ("lab", "unknown", "camera"),
    "dungeon": ("lab", "unknown", "camera"),
    "slam": ("lab", "unknown", "camera"),
}
"""Worlds in which large floors are left out: an episode takes minutes there."""

BOUNDED = {"test": 8, "lifull": 6}
"""Kinds whose floors are bounded, and of how many one is."""


def floors_of(data: Path | None, every: int) -> dict[str, list[str]]:
    """Return the floors by kind, every that many-th; kinds of fewer are left out, but for generated ones."""
    found = {"test": list(set_floors("test")), **compared_floors(data)}
    return {kind: floors[::every] for kind, floors in found.items() if kind == "test" or len(floors) >= every}


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
    """Yield each world with the kinds of floors that run in it: kind, name of the world, world."""
    for name, world in WORLDS.items():
        for kind in KINDS:
            if name not in NOT_RUN.get(kind, ()):
                yield kind, name, world
