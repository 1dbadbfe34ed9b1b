"""The bound: how soon a team that knew the floor could have seen it.

The plan is feasible, so its time is an upper bound on the optimum; it is driven with the robots' limits.
"""

import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.envs.floors.catalogue.store import floor_store, hash_of_code
from lidarium.envs.floors.floor import Floor
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.simulation.kernels.floor_cache import floor_tables
from lidarium.evaluation.bounds.driving import Walk, drive, walks_of
from lidarium.evaluation.bounds.tours import TourPlan, plan_tours
from lidarium.evaluation.bounds.view_graph import (
    LEAST_SIDE,
    SAMPLE_M,
    ViewGraph,
    bits_of,
    count,
    numbers_of,
    seen_on_track,
    view_graph,
)

TRIALS = 3
"""So often a plan is driven, each time with more places at which robots turn to what they missed."""

MARGINS = (0.001, 0.004, 1.0)
"""Share of the floor that is planned to be seen beyond what has to be; more where a drive sees too little."""

MOST_LOOKS, LEAST_LOOK = 40, 4
"""Robots turn to something at so many places at most, where they see so many points by it at least."""

SIGHT_MARGIN = 0.1
"""What is this far within the edges of a laser's field of view is seen for certain [rad]."""

MADE_BY = (
    "envs",
    "evaluation/bounds",
    "evaluation/episodes/runner.py",
    "mapping/grids",
    "mapping/kernels",
)


@dataclass(frozen=True, slots=True)
class KnownFloorBound:
    """What a team that knows the floor needs.

    Attributes
    ----------
    time_s : float
        Time at which the driven plan has seen what has to be seen [s]; inf where no plan has.
    length_m : float
        Length of the longest planned tour [m].
    total_m : float
        Length of all tours [m].
    share : float
        What was seen at the end.
    walks : list of Walk
        The tours.
    """

    time_s: float
    length_m: float
    total_m: float
    share: float
    walks: list[Walk]


def graph_of(
    floor: Floor,
    settings: ExplorationSettings,
    starts: Sequence[Sequence[float]],
    spacing: tuple[float, float] = (LEAST_SIDE, SAMPLE_M),
) -> ViewGraph:
    """Return a floor as places, paths and views, for the robots of some settings."""
    tables = floor_tables(floor, settings.raster_resolution, settings.lidar.height, settings.robot.height)
    begin = np.asarray(starts, np.float64)
    return view_graph(
        tables.body, tables.laser, settings.robot.radius, settings.lidar.range_max, begin, spacing
    )


def known_floor_bound(
    floor: Floor | str,
    settings: ExplorationSettings,
    starts: Sequence[Sequence[float]],
    rounds: int = 300,
    seed: int = 0,
) -> KnownFloorBound:
    """Return how soon a team that knew a floor could have seen it.

    Parameters
    ----------
    floor : Floor or str
        The floor, or its name.
    settings : ExplorationSettings
        The team; ``stop_coverage`` is what has to be seen.
    starts : sequence of (x, y, theta)
        Where each robot starts in the floor's frame [m, rad].
    rounds : int
        How often the tours are changed to be shorter.
    seed : int
        Where draws come from.

    Raises
    ------
    ValueError
        Where the settings have no ``stop_coverage``, not as many starts as robots, or the extra ``bounds``
        is missing.
    """
    if settings.stop_coverage is None:
        raise ValueError("stop_coverage is None; want the share that has to be seen, such as 0.99")
    if len(starts) != settings.robots:
        raise ValueError(f"there are {len(starts)} starts; want one for each of {settings.robots} robots")
    # All of the floor has to be seen: nobody ends at its goal.
    loaded = replace(load_floor(floor) if isinstance(floor, str) else floor, goal=None)
    team = _team_of(settings)
    key = _key(loaded, team, starts, rounds, seed)
    kept = floor_store().load(key)
    if kept is not None:
        return _unpacked(kept)
    graph = graph_of(loaded, team, starts)
    best = _planned_and_driven(graph, loaded, team, starts, (rounds, seed))
    floor_store().save(key, _packed(best))
    return best


def _planned_and_driven(
    graph: ViewGraph,
    floor: Floor,
    team: ExplorationSettings,
    starts: Sequence[Sequence[float]],
    effort: tuple[int, int],
) -> KnownFloorBound:
    """Plan and drive until enough is seen; ``effort`` is rounds and seed.

    A plan takes lasers to see all around. Where a drive passed something unseen, the robot turns to it in the
    next drive. Where no drive sees enough, that which saw most is returned.
    """
    driven: list[KnownFloorBound] = []
    for margin in MARGINS:
        plan = plan_tours(graph, min((team.stop_coverage or 1.0) + margin, 1.0), *effort)
        driven += _driven(graph, plan, floor, team, starts)
        if math.isfinite(driven[-1].time_s):
            return driven[-1]
    return max(driven, key=lambda bound: bound.share)


def _driven(
    graph: ViewGraph,
    plan: TourPlan,
    floor: Floor,
    team: ExplorationSettings,
    starts: Sequence[Sequence[float]],
) -> list[KnownFloorBound]:
    """Drive a plan until enough is seen, each time with more turns; return all."""
    looks: dict[tuple[int, int], float] = {}
    driven = []
    for _ in range(TRIALS):
        walks = walks_of(graph, plan, looks)
        time_s, share, poses = drive(floor, team, starts, walks)
        lengths = plan.lengths
        driven.append(KnownFloorBound(time_s, float(lengths.max()), float(lengths.sum()), share, walks))
        if math.isfinite(time_s):
            break
        seen = seen_on_track(graph, poses, team.lidar.range_max, team.lidar.field_of_view)
        passed = [place for walk in plan.walks for place in walk]
        looks |= _looks(graph, plan, graph.seen(passed) & ~seen, team.lidar.field_of_view)
    return driven


def _looks(
    graph: ViewGraph, plan: TourPlan, missed: NDArray[np.uint64], field_of_view: float
) -> dict[tuple[int, int], float]:
    """Return where robots turn, and to what, to see most of what they missed."""
    found: dict[tuple[int, int], float] = {}
    origin, resolution = np.asarray(graph.laser.origin), graph.laser.resolution
    left = missed.copy()
    for _ in range(MOST_LOOKS):
        counts = [count(graph.views[walk] & left) for walk in plan.walks]
        robot = int(np.argmax([each.max() for each in counts]))
        at = int(np.argmax(counts[robot]))
        if counts[robot][at] < LEAST_LOOK:
            break
        place = plan.walks[robot][at]
        numbers = numbers_of(graph.views[place] & left)
        points = (graph.points[numbers][:, ::-1] + 0.5) * resolution + origin
        gap = points - graph.places[place]
        bearings = np.arctan2(gap[:, 1], gap[:, 0])
        heading = math.atan2(float(np.sin(bearings).mean()), float(np.cos(bearings).mean()))
        is_seen = np.cos(bearings - heading) > math.cos(min(0.5 * field_of_view, math.pi) - SIGHT_MARGIN)
        left &= ~bits_of(numbers[is_seen] if is_seen.any() else numbers, len(left))
        found[robot, at] = heading
    return found


def _team_of(settings: ExplorationSettings) -> ExplorationSettings:
    """Return what of settings says how soon a floor is seen in a world without noise.

    Raises
    ------
    ValueError
        Where the robots are of different kinds.
    """
    if settings.kinds:
        raise ValueError(f"kinds is {list(settings.kinds)}; bounds are for teams of robots of one kind")
    return ExplorationSettings(
        robots=settings.robots,
        robot=settings.robot,
        lidar=replace(settings.lidar, noise_floor=0.0, noise_share=0.0),
        occupancy=settings.occupancy,
        stop_coverage=settings.stop_coverage,
        raster_resolution=settings.raster_resolution,
        time_step=settings.time_step,
        decision_period_s=settings.decision_period_s,
        horizon_s=None,
    )


def _key(
    floor: Floor, settings: ExplorationSettings, starts: Sequence[Sequence[float]], rounds: int, seed: int
) -> str:
    about = repr((settings, [[round(float(x), 9) for x in start] for start in starts], rounds, seed))
    digest = hashlib.sha256(about.encode()).hexdigest()
    return f"bound {floor.sha256} {digest} {hash_of_code(*MADE_BY)}"


def _packed(bound: KnownFloorBound) -> dict[str, NDArray[np.float64]]:
    numbers = np.array([bound.time_s, bound.length_m, bound.total_m, bound.share])
    arrays = {"numbers": numbers}
    for k, walk in enumerate(bound.walks):
        arrays[f"walk_{k}"] = np.column_stack([walk.points, walk.room, walk.headings])
    return arrays


def _unpacked(arrays: Mapping[str, NDArray[Any]]) -> KnownFloorBound:
    time_s, length_m, total_m, share = (float(number) for number in arrays["numbers"])
    tables = [arrays[f"walk_{k}"] for k in range(len(arrays) - 1)]
    walks = [Walk(table[:, :2], table[:, 2], table[:, 3]) for table in tables]
    return KnownFloorBound(time_s, length_m, total_m, share, walks)
