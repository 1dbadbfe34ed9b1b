"""Bounds: the fastest exploration by a team that has the floor plan.

The plan is feasible, so its time is an upper bound on the optimum; it is driven with the limits of the
robots.
"""

import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.policy import Action, Policy, Stop, Team
from lidarium.envs.faces.parallel import ExplorationEnv, Observation
from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.envs.floors.catalogue.store import floor_store, hash_of_code
from lidarium.envs.floors.floor import Floor
from lidarium.envs.onboard.radio.messages import MOST_POINTS, DriveState, Route
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.simulation.kernels.floor_cache import floor_tables
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
from lidarium.evaluation.episodes.runner import run_episode

PATIENCE, LEAST_PATIENCE_S = 4.0, 60.0
"""Maximum duration of a drive as a multiple of its time at cruising speed, and additional time [s].

Without a limit, robots that block each other would never finish.
"""

Looks = Mapping[tuple[int, int], float]
"""Headings to turn to, by the robot and the number of the place on its walk [rad]."""


@dataclass(frozen=True, slots=True)
class Walk:
    """A path that one robot drives.

    Attributes
    ----------
    points : (P, 2) float64
        x, y in the floor's frame, from the start on [m].
    room : (P,) float64
        Room around the body on the piece that leads to each [m].
    headings : (P,) float64
        Heading to turn to there [rad]; nan for none.
    """

    points: NDArray[np.float64]
    room: NDArray[np.float64]
    headings: NDArray[np.float64]


def walks_of(graph: ViewGraph, plan: TourPlan, looks: Looks) -> list[Walk]:
    """Return the paths of a plan with places at which robots turn to something."""
    walks = []
    for robot, walk in enumerate(plan.walks):
        points, room = graph.places[walk], graph.room[walk]
        # A piece has no more room than either of its ends.
        least = np.maximum(np.minimum(room, np.concatenate([[room[0]], room[:-1]])), 0.0)
        headings = np.array([looks.get((robot, at), math.nan) for at in range(len(walk))])
        walks.append(Walk(points, least, headings))
    return walks


class _WalkPolicy(Policy):
    """Robots that follow walks, one piece after the other; a robot that has arrived stays.

    Parameters
    ----------
    offsets : (robots, 2) float64
        Offset from the robots' map frames to the floor's frame [m].
    """

    level = "waypoint"

    def __init__(self, walks: Sequence[Walk], offsets: NDArray[np.float64]) -> None:
        self._walks, self._offsets = walks, offsets

    def reset(self, team: Team, seed: int = 0) -> None:
        """Start an episode."""
        self._team = team
        self._left = {
            agent: _pieces(walk, offset)
            for agent, walk, offset in zip(team.agents, self._walks, self._offsets, strict=True)
        }
        self._at: dict[str, Route | None] = dict.fromkeys(team.agents)

    def act(self, observations: Mapping[str, Observation]) -> dict[str, Action]:
        """Let each robot follow its walk; all stop together at the ends."""
        for agent in observations:
            state = self._team.drive_state(agent)
            if self._at[agent] is None or state in (DriveState.ARRIVED, DriveState.NO_PATH):
                self._at[agent] = self._left[agent].pop(0) if self._left[agent] else None
        if all(self._at[agent] is None for agent in observations):
            return {agent: Stop("stopped") for agent in observations}
        return {agent: self._at[agent] for agent in observations}


def _pieces(walk: Walk, offset: NDArray[np.float64]) -> list[Route]:
    """Return a walk as routes.

    They end at the turns of the robot, and have no more points than routes may.
    """
    pieces, start, last = [], 0, len(walk.points) - 1
    for at in range(last + 1):
        heading = float(walk.headings[at])
        if math.isnan(heading) and at < last and at - start < MOST_POINTS - 1:
            continue
        part = np.s_[start : at + 1]
        pieces.append(Route(walk.points[part] - offset, walk.room[part], None if math.isnan(heading) else heading))
        start = at
    return pieces


def drive(
    floor: object, settings: ExplorationSettings, starts: Sequence[Sequence[float]], walks: Sequence[Walk]
) -> tuple[float, float, NDArray[np.float64]]:
    """Drive walks with the robots' limits.

    Parameters
    ----------
    starts : sequence of (x, y, theta)
        Start poses of the robots [m, rad].

    Returns
    -------
    (float, float, (n, 3) float64)
        Time at which that share was seen [s], inf if it never was; the share that was seen; poses that the
        robots had in the floor's frame [m, rad]. A drive ends if robots block each other for long.
    """
    allowed_s = PATIENCE * max(_seconds_of(walk, settings) for walk in walks) + LEAST_PATIENCE_S
    env = ExplorationEnv(floor, replace(settings, horizon_s=allowed_s))  # type: ignore[arg-type]
    options = {"starts": [list(start) for start in starts]}
    env.reset(seed=0, options=options)
    offsets = np.array([env.perception.poses.offset(row)[:2] for row in range(settings.robots)])
    run_episode(_WalkPolicy(walks, offsets), env, 0, options)
    share = float(env.scorer.coverage)
    wanted = settings.stop_coverage
    is_reached = wanted is not None and share >= wanted
    poses = np.concatenate([at.reshape(-1, 3) for _, at in env.scorer.track])
    return (float(env.scorer.time) if is_reached else math.inf), share, poses


def _seconds_of(walk: Walk, settings: ExplorationSettings) -> float:
    """Return the time of a walk at cruising speed, with a whole turn if it has a heading [s]."""
    metres = float(np.hypot(*np.diff(walk.points, axis=0).T).sum())
    turns = int(np.isfinite(walk.headings).sum())
    return metres / settings.robot.cruise_speed + turns * 2.0 * math.pi / settings.robot.max_turn_rate


TRIALS = 3
"""Maximum number of drives of a plan, each with more places at which robots turn to missed points."""

MARGINS = (0.001, 0.004, 1.0)
"""Additional share of the floor that plans see; more if a drive sees too little."""

MOST_LOOKS, LEAST_LOOK = 40, 4
"""Maximum number of positions at which robots turn to a target, and minimum number of points seen by it."""

SIGHT_MARGIN = 0.1
"""Margin within a laser's field of view in which cells are certain to be seen [rad]."""

MADE_BY = (
    "envs",
    "evaluation/bounds",
    "evaluation/episodes/runner.py",
    "mapping/grids",
    "mapping/kernels",
)


@dataclass(frozen=True, slots=True)
class KnownFloorBound:
    """The bound of a team that has the floor plan.

    Attributes
    ----------
    time_s : float
        Time at which the driven plan has seen enough [s]; inf if no plan has.
    length_m : float
        Length of the longest planned tour [m].
    total_m : float
        Length of all tours [m].
    share : float
        Share that was seen at the end.
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
    return view_graph(tables.body, tables.laser, settings.robot.radius, settings.lidar.range_max, begin, spacing)


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
    starts : sequence of (x, y, theta)
        Start pose of each robot in the floor's frame [m, rad].
    """
    if settings.stop_coverage is None:
        raise ValueError("stop_coverage is None; want the share that has to be seen, such as 0.99")
    if len(starts) != settings.robots:
        raise ValueError(f"there are {len(starts)} starts; want one for each of {settings.robots} robots")
    # The whole floor has to be seen, so robots must not end at its goal.
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

    A plan takes lasers to see all around. If a drive passed something unseen, the robot turns to it in the next
    drive. If no drive sees enough, that which saw most is returned.
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
    """Return the positions and directions to which robots turn to see most of the missed cells."""
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
    """Return the settings that affect the time in a world without noise."""
    if settings.kinds:
        raise ValueError(f"kinds is {list(settings.kinds)}; bounds are for teams of robots of one kind")
    for name, value in (("doors", settings.doors), ("people", settings.people)):
        if value:
            raise ValueError(f"{name} is {value}; bounds are for floors without doors that move and people")
    if len(set(settings.team_lidars)) > 1:
        raise ValueError("the lidars of the robots differ; bounds are for teams whose robots have the same lidar")
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


def _key(floor: Floor, settings: ExplorationSettings, starts: Sequence[Sequence[float]], rounds: int, seed: int) -> str:
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
