"""The runs of the experiments of supervised teams.

They are the thesis's scenarios, generated and real floors, and each extension by itself.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.evaluation.suites.suite import Suite
from lidarium.evaluation.suites.trial import DEFAULT_VARIANT

POLICIES = ("supervised", "independent", "oracle_starts")
ALONE = "independent"
"""Who explores where there is one robot: of one, all policies do the same."""

SCENARIOS = ("apartment", "clinic")
"""The thesis's two scenarios. Their starts A, B and C are those of Jade, Luna and Mars."""

SEEDS = 10
RUNS_ALONE = 3
FEWEST_SEEDS = 5
"""Seeds of the extensions."""

SETTINGS: Mapping[str, Any] = {
    "realism": "lab",
    "known_starts": False,
    "reveals_starts": True,
    "resolution": 0.05,
    "stop_coverage": 0.99,
    "horizon_s": 1200.0,
}
"""Reports tell the true starts to whoever trusts in them, ``oracle_starts`` alone."""

TO_THE_END: Mapping[str, Any] = {"stop_coverage": None, "horizon_s": 900.0}
"""Settings for studying robots after all is seen.

They take the place of the usual settings where that is of interest.
"""

GENERATED: Mapping[str, float] = {
    "building:3000003": 77.0,
    "building:3000004": 86.0,
    "building:3000016": 90.0,
    "building:3000013": 99.0,
    "building:3000018": 117.0,
    "building:3000012": 160.0,
    "building:3000010": 183.0,
    "building:3000007": 219.0,
    "building:3000011": 402.0,
    "building:3000009": 422.0,
}
"""Floors of the set ``test`` by name, with what the robot sweeps of them [m2]."""

REAL: Mapping[str, float] = {
    "lifull/txt/02_58_b85499c6cb2b53ca84ae1b6e2023_0002.txt": 65.0,
    "kth/xml/A0043012__50045365.xml.gz": 127.0,
    "kth/xml/A0093003__0510030969_A-40.xml.gz": 181.0,
    "kth/xml/A0043020__0510032199_A_40_1_107.xml.gz": 232.0,
    "kth/xml/A0093002__50025630.xml.gz": 319.0,
}
"""Real floor files with the area of the robot's footprint on them [m2].

The files are below ``floorplans`` of the folder of real data; the area is what it covers of them.
"""

STAND_INS: Mapping[str, float] = {
    "office:7": 0.0,
    "office:8": 0.0,
    "office:9": 0.0,
    "corridors:7": 0.0,
    "corridors:8": 0.0,
}
"""Generated floors of other kinds in place of real ones, where there are no data."""

LARGE_M2 = 300.0
"""From this area on a floor is large."""

FIVE_FLOORS = 5
"""Number of floors on which five robots work, and on which robots fail. They are every third of the others' floors."""

EXTENDED = ("building:3000010", "building:3000009")
"""Floors on which each extension is switched on, one of them large. What helps on the one may not on the other."""

PART_HORIZON_S = 300.0
"""A part of the study cuts runs of extensions there [s]: without a radio they take five times as long."""

EXTENSIONS: Mapping[str, Mapping[str, Any]] = {
    "hungarian": {"assignment": "hungarian"},
    "utility": {"assignment": "utility"},
    "avoids rendezvous": {"avoids_rendezvous": True},
    "returns home": {"returns_home": True},
}
"""Settings of the supervisor by what they are called."""

BUDGET: Mapping[str, Any] = {"capacity_j": 1000.0}
"""A battery that is empty before the floor is explored."""

METER: Mapping[str, Any] = {"battery": "kobuki"}
"""A battery that no run empties: it only counts what robots use."""

BUMPED: Mapping[str, Any] = {"robot": "service", "pauses_when_blocked": True}
"""Robots taller than what their lasers see, which pause where they touch or meet something."""

RESUMING: Mapping[str, Mapping[str, Any]] = {"resumes": {"policy": "supervised", "resumes_paused": True}}
"""Who is ordered to go on where the cause of his pause is known."""

MARGIN = 1.5
RADIOS: Mapping[str, Mapping[str, Any]] = {
    "radio of 10 m": {"kind": "range", "reach": 10.0},
    "radio in line of sight": {"kind": "line_of_sight", "reach": 10.0},
}


def floors_of(data: Path | None) -> dict[str, tuple[str, ...]]:
    """Return the floors by kind, ``generated`` and ``real``."""
    if data is None:
        return {"generated": tuple(GENERATED), "real": tuple(STAND_INS)}
    paths = [Path(data) / "floorplans" / name for name in REAL]
    for path in paths:
        if not path.is_file():
            raise FileNotFoundError(
                f"no floor {path}; want the folder that holds floorplans/{path.relative_to(data).parts[1]}"
            )
    return {"generated": tuple(GENERATED), "real": tuple(str(path) for path in paths)}


def area_m2(floor: str) -> float:
    """Return the area that a robot's footprint covers of a floor [m2].

    It is for floors of these experiments; 0 if that is not known.
    """
    known = {**GENERATED, **{Path(name).name: area for name, area in REAL.items()}}
    return known.get(floor, known.get(Path(floor).name, 0.0))


def suites(data: Path | None, every: int = 1) -> dict[str, Suite]:
    """Return the suites by name."""
    seeds = tuple(range(SEEDS))[::every]
    few = max(round(every / SEEDS), 1)
    by_kind = {kind: floors[::few] for kind, floors in floors_of(data).items()}
    floors = tuple(floor for group in by_kind.values() for floor in group)
    scenarios = SCENARIOS[::few]
    found = {
        "alone": Suite(
            policies=(ALONE,),
            floors=scenarios,
            seeds=tuple(range(RUNS_ALONE))[::every],
            variants=_variants(METER),
            starts=_starts(scenarios, (0,), (1,), (2,)),
        ),
        "pairs": Suite(
            policies=POLICIES,
            floors=scenarios,
            robots=(2,),
            seeds=seeds,
            variants=_variants(METER),
            starts=_starts(scenarios, (0, 1), (0, 2)),
        ),
        "three": Suite(
            policies=POLICIES,
            floors=scenarios[:1],
            robots=(3,),
            seeds=seeds,
            variants=_variants(METER),
            starts=_starts(scenarios[:1], (0, 1, 2)),
        ),
        "one": Suite(policies=(ALONE,), floors=floors, robots=(1,), seeds=seeds, variants=_variants()),
        "teams": Suite(policies=POLICIES, floors=floors, robots=(2, 3), seeds=seeds, variants=_variants()),
        "five": Suite(policies=POLICIES, floors=five_floors(floors), robots=(5,), seeds=seeds, variants=_variants()),
        "bumper": Suite(
            policies=("supervised", *RESUMING),
            floors=scenarios,
            robots=(2, 3),
            seeds=seeds,
            policy_settings=RESUMING,
            variants=_variants(BUMPED),
        ),
    }
    return {**found, **_extensions(seeds[:FEWEST_SEEDS], few)}


def five_floors(floors: tuple[str, ...]) -> tuple[str, ...]:
    """Return the floors on which five robots work, and on which robots fail."""
    return floors[:: max(len(floors) // FIVE_FLOORS, 1)][:FIVE_FLOORS]


def _extensions(seeds: tuple[int, ...], few: int) -> dict[str, Suite]:
    """Return the suites of extensions."""
    floors = EXTENDED[::few]
    cut = {"horizon_s": PART_HORIZON_S} if few > 1 else {}
    budget = {"energy budget": {"policy": "supervised", "battery_margin": MARGIN}}
    every = {"assignment": "utility", "avoids_rendezvous": True, "returns_home": True, "battery_margin": MARGIN}
    radio = {"radio": RADIOS["radio in line of sight"]}

    def suite(options: Mapping[str, Mapping[str, Any]], variants: Mapping[str, Mapping[str, Any]]) -> Suite:
        settings = {name: {"policy": "supervised", **values} for name, values in options.items()}
        return Suite(
            policies=("supervised", *settings),
            floors=floors,
            robots=(3,),
            seeds=seeds,
            policy_settings=settings,
            variants={name: {**SETTINGS, **TO_THE_END, **cut, **values} for name, values in variants.items()},
        )

    return {
        "extensions": suite(EXTENSIONS, {DEFAULT_VARIANT: {}}),
        "radio": suite({}, {name: {"radio": values} for name, values in RADIOS.items()}),
        "energy": suite(budget, {"battery": {"battery": BUDGET}}),
        "together": suite({"all together": every}, {"battery, radio in line of sight": {"battery": BUDGET, **radio}}),
    }


def _variants(more: Mapping[str, Any] | None = None) -> dict[str, Mapping[str, Any]]:
    return {DEFAULT_VARIANT: {**SETTINGS, **(more or {})}}


def _starts(
    scenarios: tuple[str, ...], *teams: tuple[int, ...]
) -> dict[str, tuple[tuple[tuple[float, float, float], ...], ...]]:
    """Return teams of the starts of scenarios, by the numbers of the starts."""
    found = {}
    for name in scenarios:
        places = [(float(x), float(y), float(theta)) for x, y, theta in load_floor(name).starts]
        found[name] = tuple(tuple(places[start] for start in team) for team in teams)
    return found
