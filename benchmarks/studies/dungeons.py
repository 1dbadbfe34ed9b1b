"""Ways on public dungeon maps, besides those of the planners of the project that they are from.

The project's code halves the pictures, so that a cell of 0.4 m is two pixels. Here floors have half of its
lengths, 0.1 m a pixel as all dungeons; ways are shown in its metres.

J. Cao et al., "DARE: diffusion policy for autonomous robot exploration", ICRA 2025; Y. Cao et al., "ARiADNE",
ICRA 2023.
"""

import csv
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from lidarium.agents.tours.planning import TourSettings
from lidarium.benchmarks.studies.shared.study import Study
from lidarium.evaluation.episodes.stop_rules import STOP_REASON
from lidarium.evaluation.statistics.estimates import paired_ratio
from lidarium.evaluation.suites.campaign import EPISODES_FILE
from lidarium.evaluation.suites.episodes_file import KEY, read_episodes
from lidarium.evaluation.suites.presets import PRESETS
from lidarium.evaluation.suites.suite import Suite
from lidarium.evaluation.suites.trial import DEFAULT_VARIANT
from lidarium.mapping.files.output import write_text

POLICIES = (
    "nearest_frontier",
    "utility_frontier",
    "explore_lite",
    "srt",
    "tour_frontier",
    "learned",
    "predicted_tours",
)
TOURS = "tour_frontier"
MAPS, WAYS, WAYS_FILE = "dungeon_test", "dungeon_test_ways.csv", "ways.csv"
ARIADNE = {"ariadne_test": "ariadne/test100", "ariadne": "synthetic_dungeon"}
"""Folders of the maps that run by ARiADNE's sensor and stop rule: its test maps, and some of three projects."""

BY_NODES = ("level", "graph")
"""Settings of the preset that are left out: robots drive here."""

BUILDINGS, BUILDING_FLOORS = "buildings", ("set:validation:24",)
"""Ordinary floors, on which tours are tried with a laser that sees 20 m."""

NORMAL_RANGE_M = 5.6
"""Range of the laser with which the settings of tours were chosen [m]."""

ARIADNE_STOP = {"figure": "remaining_cells", "at_most": 250.0}
"""ARiADNE's rule, without its maximum of decisions at nodes."""

SCALE = 2.0
"""Metres of the project in one of ours."""

SENSOR_M, CELL_M = 20.0, 0.4
"""Range of the project's sensor, and its cells [m]."""

SETTINGS: dict[str, Any] = {
    "robot": "point",
    "lidar": {
        "beams": 720,
        "field_of_view": 2.0 * np.pi,
        "range_min": 0.0,
        "range_max": SENSOR_M / SCALE,
        "noise_floor": 0.0,
        "noise_share": 0.0,
    },
    "resolution": CELL_M / SCALE,
    "stop_coverage": 0.999,
    "horizon_s": 3600.0,
}

BUILDING_SETTINGS: dict[str, Any] = {
    "lidar": {"beams": 720, "field_of_view": 2.0 * np.pi, "range_min": 0.1, "range_max": SENSOR_M},
    "resolution": 0.05,
    "stop_coverage": 0.99,
    "horizon_s": 1800.0,
}

SOONER: Mapping[str, Any] = {"waiting": 0.0, "kept_share": 0.4}
"""Tours that are short alone, and planned again when 0.6 of what a view shows is seen."""


TRUTH: dict[str, dict[str, Any]] = {"truth": {"policy": "predicted_tours", "predictor": "truth"}}
"""Predicted tours with the floor in place of a prediction."""


def scaled_tours(range_m: float) -> dict[str, float]:
    """Return settings of tours whose lengths and areas grow with the range of the laser."""
    scale, default = range_m / NORMAL_RANGE_M, TourSettings()
    lengths = ("reach", "depth", "around", "spacing", "minimum_size", "kept", "turn_length")
    return {
        **{name: getattr(default, name) * scale for name in lengths},
        "least_gain": default.least_gain * scale**2,
        "waiting": default.waiting / scale**2,
    }


def variants(range_m: float) -> dict[str, dict[str, Any]]:
    """Return settings of policies that show what tours lose by, by their names on the page."""
    scaled = {"policy": TOURS, **scaled_tours(range_m)}
    return {
        "sooner": {"policy": TOURS, **SOONER},
        "scaled": scaled,
        "scaled_sooner": {**scaled, **SOONER},
        **TRUTH,
    }


PLANNERS = {
    "nearest": "nearest frontier node",
    "utility": "nodes by utility and distance",
    "tare": "a tour planner after TARE",
    "gt0": "a tour on the known map",
}

PAGE = """# Dungeons

Ways of one robot on the test maps of [DARE](https://github.com/marmotlab/DARE) (MIT), beside those of four planners
of that project on the first {printed} maps of its listing.

As in the project, the sensor sees 20 m all around, cells have 0.4 m, and starts are the maps' marks. A robot of 1 cm
drives freely at 2 m/s and sees while it drives. The project's robot moves between nodes 4 m apart, sees at these only,
and ends when no node shows anything new, so its planners cannot be compared directly.

## The same maps

Means over {printed} maps [m]. *Over the known map's tour* are geometric means of ratios, map by map, with
their 95 % interval, of ways to 99.9 % where a policy is ours.

| planner | way to 99 % | to 99.9 %, or its end | over the known map's tour | over the tours after TARE |
|---|---:|---:|---:|---:|
{same}

## All maps

Policies on all {count} maps: ways to 99 %, and over that of `nearest_frontier`.

| policy | reached 99 % | way to 99 % [m] | over `nearest_frontier` | time over `nearest_frontier` |
|---|---:|---:|---:|---:|
{all_maps}

## What tours lose by

Tours that show much early leave small corners behind, and each may cost a way back. *Sooner*: nothing for showing
much early (`waiting` 0), and a new plan when 60 % of what a view shows is seen (`kept_share` 0.4). *Scaled*: lengths
of `TourSettings` times the range of the laser over {normal} m, areas times its square. *Truth*: `predicted_tours` with
the floor in place of a prediction. *Buildings*: the same with a laser of 20 m on {buildings}
generated floors of the set `validation`. Ratios of times to 99 % with one robot.

| tours | dungeons, over `nearest_frontier` | buildings, over `nearest_frontier` | buildings, over `tour_frontier` |
|---|---:|---:|---:|
{why}

## By ARiADNE's sensor and stop rule

[ARiADNE](https://github.com/marmotlab/ARiADNE) sees 80 pixels around and ends when 250 free ones are left
unseen; so does the preset [`ariadne`](../reference/presets.md), with pixels of 0.1 m. Robots drive here, and see while
they drive; by its other rules they run on the page of [printed tables](printed.md). *Others*: four of its larger maps,
and maps of two other projects. Ratios are path lengths over that of `nearest_frontier`.

| policy | test: ended so | way [m] | over `nearest_frontier` | others: ended so | way [m] | over `nearest_frontier` |
|---|---:|---:|---:|---:|---:|---:|
{by_ariadne}
"""


def suites(data: Path | None, every: int = 1) -> dict[str, Suite]:
    """Return the suite; none without the folder of data, or where it has no such maps."""
    maps = maps_of(data)[::every] if data is not None else []
    if not maps:
        return {}
    found = {
        "maps": _suite(maps, SETTINGS, own=variants(float(SETTINGS["lidar"]["range_max"]))),
        BUILDINGS: replace(
            _suite(BUILDING_FLOORS, BUILDING_SETTINGS, own=variants(SENSOR_M)),
            policies=(POLICIES[0], TOURS, "predicted_tours", *variants(SENSOR_M)),
            draws_starts=True,
        ),
    }
    settings = {name: value for name, value in PRESETS["ariadne"].settings.items() if name not in BY_NODES}
    for name, below in ARIADNE.items():
        paths = sorted((Path(data) / "floorplans" / below).glob("*.png"))[::every] if data else []
        if paths:
            found[name] = _suite(paths, settings, ARIADNE_STOP, own=TRUTH)
    return found


def _suite(
    maps: Sequence[Path | str],
    settings: Mapping[str, Any],
    stop: Mapping[str, Any] | None = None,
    own: Mapping[str, Mapping[str, Any]] | None = None,
) -> Suite:
    own = own or {}
    return Suite(
        policies=(*POLICIES, *own),
        policy_settings=dict(own),
        floors=tuple(str(path) for path in maps),
        robots=(1,),
        seeds=(0,),
        draws_starts=False,
        variants={DEFAULT_VARIANT: settings},
        stop=stop,
    )


def maps_of(data: Path) -> list[Path]:
    """Return the maps in the order of the project's listing, that of their names as text."""
    return sorted((Path(data) / "floorplans" / MAPS).glob("*.png"))


def work(folder: Path, data: Path | None, _every: int, _workers: int) -> Any:  # noqa: ANN401
    """Keep the planners' ways besides the episodes."""
    if data is not None and (Path(data) / "floorplans" / WAYS).is_file():
        write_text(folder / WAYS_FILE, (Path(data) / "floorplans" / WAYS).read_text(encoding="utf-8"))
    yield "ways of planners", 1, 1


def page(folder: Path) -> str:
    """Return the results as markdown."""
    every = ways_of(read_episodes(folder / "maps" / EPISODES_FILE))
    ours = {policy: found for policy, found in every.items() if policy in POLICIES}
    in_buildings = _ways_in(folder / BUILDINGS)
    names = sorted({name for of_policy in ours.values() for name in of_policy})
    theirs = printed_ways(folder / WAYS_FILE, names)
    return PAGE.format(
        printed=len(next(iter(theirs.values()), {})),
        same=_same_maps(ours, theirs),
        count=len(names),
        all_maps=_all_maps(ours),
        normal=NORMAL_RANGE_M,
        buildings=len(in_buildings.get(TOURS, {})),
        why=_why(every, in_buildings),
        by_ariadne=_by_ariadne([_ways_in(folder / name) for name in ARIADNE]),
    )


Ways = Mapping[str, Mapping[str, Any]]
"""Episodes of a policy by the name of the map."""


def ways_of(episodes: Sequence[Mapping[str, Any]]) -> dict[str, dict[str, Mapping[str, Any]]]:
    """Return the episodes by policy and name of the map."""
    found: dict[str, dict[str, Mapping[str, Any]]] = {}
    for episode in episodes:
        name = Path(episode[KEY].split(" | ")[1]).name
        found.setdefault(episode["policy"], {})[name] = episode
    return found


def _ways_in(folder: Path) -> dict[str, dict[str, Mapping[str, Any]]]:
    path = folder / EPISODES_FILE
    return ways_of(read_episodes(path)) if path.exists() else {}


def printed_ways(path: Path, names: Sequence[str]) -> dict[str, dict[str, float]]:
    """Return the planners' ways by the names of the maps [m]; those that have not run are left out."""
    found: dict[str, dict[str, float]] = {}
    if not path.is_file():
        return found
    listing = sorted(f"{number}.png" for number in range(1, 101))
    for row in csv.DictReader(path.read_text(encoding="utf-8").splitlines()):
        name = listing[int(row["map"])]
        if name in names:
            found.setdefault(row["method"], {})[name] = float(row["way_m"])
    return found


def _same_maps(ours: Ways, theirs: Mapping[str, Mapping[str, float]]) -> str:
    names = [name for name in theirs.get("gt0", {}) if all(name in episodes for episodes in ours.values())]
    if not names:
        return "| not run | - | - | - | - |"
    rows = []
    for planner, ways in theirs.items():
        values = [ways[name] for name in names]
        cells = [_ratio(values, theirs, "gt0", names), _ratio(values, theirs, "tare", names)]
        rows.append(f"| {PLANNERS[planner]} | - | {np.mean(values):.0f} | {' | '.join(cells)} |")
    for policy, episodes in ours.items():
        to_goal, to_end = ([way(episodes[name], key) for name in names] for key in ("d99_m", "path_m"))
        cells = [_ratio(to_end, theirs, "gt0", names), _ratio(to_end, theirs, "tare", names)]
        rows.append(f"| `{policy}` | {np.mean(to_goal):.0f} | {np.mean(to_end):.0f} | {' | '.join(cells)} |")
    return "\n".join(rows)


def way(episode: Mapping[str, Any], key: str) -> float:
    """Return a way in the project's metres; the whole one where 99 % were not reached."""
    metres = episode[key] if key == "d99_m" and episode[key] is not None else sum(episode["path_m"])
    return SCALE * float(metres)


def _ratio(
    values: Sequence[float], theirs: Mapping[str, Mapping[str, float]], planner: str, names: Sequence[str]
) -> str:
    others = [theirs[planner][name] for name in names]
    if np.array_equal(values, others):
        return "1"
    return f"{paired_ratio(values, others):.3f}"


def _all_maps(ours: Ways) -> str:
    baseline, rows = ours[POLICIES[0]], []
    for policy, episodes in ours.items():
        names = sorted(set(episodes) & set(baseline))
        if len(names) < 2:
            continue
        ways, others = ([way(found[name], "d99_m") for name in names] for found in (episodes, baseline))
        times, base = (
            [float(found[name]["t99_s"] or SETTINGS["horizon_s"]) for name in names] for found in (episodes, baseline)
        )
        reached = sum(episodes[name]["t99_s"] is not None for name in names)
        ratios = (
            ["1", "1"]
            if policy == POLICIES[0]
            else [f"{paired_ratio(ways, others):.3f}", f"{paired_ratio(times, base):.3f}"]
        )
        cells = f"{reached} of {len(names)} | {np.mean(ways):.0f} | {' | '.join(ratios)}"
        rows.append(f"| `{policy}` | {cells} |")
    return "\n".join(rows)


def _why(ours: Ways, in_buildings: Ways) -> str:
    """Return times to 99 % of tours and their variants, over those of others."""
    rows = []
    for policy in (TOURS, *variants(SENSOR_M), "predicted_tours"):
        cells = [
            _time_ratio(ours, policy, POLICIES[0], float(SETTINGS["horizon_s"])),
            *(
                _time_ratio(in_buildings, policy, other, float(BUILDING_SETTINGS["horizon_s"]))
                for other in (POLICIES[0], TOURS)
            ),
        ]
        name = policy.replace("_", ", ") if policy in variants(SENSOR_M) else f"`{policy}`"
        rows.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(rows)


def _time_ratio(ours: Ways, policy: str, other: str, horizon_s: float) -> str:
    """Return the ratio of two policies' times to 99 % on the floors of both."""
    names = sorted(set(ours.get(policy, {})) & set(ours.get(other, {})))
    if not names:
        return "-"
    if policy == other:
        return "1"
    times, base = ([float(ours[which][name]["t99_s"] or horizon_s) for name in names] for which in (policy, other))
    return f"{paired_ratio(times, base):.3f}"


def _by_ariadne(ours: Sequence[Ways]) -> str:
    """Return ways to the end by ARiADNE's stop rule, in our metres, on each set of maps."""
    if not any(ours):
        return "| not run | - | - | - | - | - | - |"
    rows = []
    for policy in (*POLICIES, *TRUTH):
        cells: list[str] = []
        for found in ours:
            episodes, baseline = found.get(policy, {}), found.get(POLICIES[0], {})
            names = [name for name in episodes if name in baseline]
            if len(names) < 2:
                cells += ["-", "-", "-"]
                continue
            ways, others = ([sum(each[name]["path_m"]) for name in names] for each in (episodes, baseline))
            ended = sum(STOP_REASON in episodes[name]["ended_because"].values() for name in names)
            ratio = "1" if policy == POLICIES[0] else f"{paired_ratio(ways, others):.3f}"
            cells += [f"{ended} of {len(names)}", f"{np.mean(ways):.1f}", ratio]
        rows.append(f"| `{policy}` | {' | '.join(cells)} |")
    return "\n".join(rows)


STUDY = Study(page, suites, work)
