"""The options of robots on one map, the tours past all of them, and the first leg of each."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.onboard.navigation import ROW_LOW, NavigationMap
from lidarium.mapping.geometry.bounds import above, check_settings, share, within
from lidarium.mapping.kernels.views import table_of
from lidarium.mapping.kernels.work_queue import new_work
from lidarium.mapping.planning.clearance import limit_of
from lidarium.mapping.planning.frontiers.frontier_map import Clusters
from lidarium.mapping.planning.frontiers.views import ViewRules, frame_of, gain_at
from lidarium.mapping.planning.grid_planning import Cell
from lidarium.mapping.planning.touring.map_tours import (
    NO_PATH,
    PlanRules,
    Plans,
    Robots,
    TourMemory,
    plan_parallel,
    plan_serial,
)
from lidarium.mapping.planning.touring.tours import TourWeights

Length = Annotated[float, within(0.0, 1000.0)]


@dataclass(frozen=True, slots=True, kw_only=True)
class TourSettings:
    """How tours past frontiers are planned.

    Attributes
    ----------
    minimum_size : float, default 0.3
        Shorter frontiers are visited only when no others are left [m].
    least_gain : float, default 0.4
        So are those that show less than this [m2].
    most : int, default 30
        Maximum number of frontiers on tours: each robot in turn takes its nearest.
    kept_share : float, default 0.15
        A robot goes on to a frontier until less than this share of the area that it would show is left.
    kept : float, default 1.0
        A robot's goal is left only for tours that are shorter by this [m].
    turn_length : float, default 0.25
        Length of path that a radian of turning costs at the start [m/rad].
    total, waiting : float, default 0.1, 0.05
        Weight of the sum of all tours against the longest one, and of how long a square metre waits to be
        seen [1, 1/m2].
    around, spacing : float, default 1.0, 0.3
        Views lie within the first of their frontiers, and the second apart [m].
    reach, depth : float, default 3.0, 1.5
        Unknown space counts up to the first from a view, and up to the second behind known space [m].
    view_share : float, default 0.7
        The view with the shortest path is taken among those that show this share of the best.
    """

    minimum_size: Length = 0.3
    least_gain: Annotated[float, within(0.0, 1e6)] = 0.4
    most: Annotated[int, within(1, 200)] = 30
    kept_share: Annotated[float, share()] = 0.15
    kept: Length = 1.0
    turn_length: Length = 0.25
    total: Annotated[float, within(0.0, 1e3)] = 0.1
    waiting: Annotated[float, within(0.0, 1e3)] = 0.05
    around: Annotated[float, above(0.0, 10.0)] = 1.0
    spacing: Annotated[float, above(0.0, 10.0)] = 0.3
    reach: Annotated[float, above(0.0, 30.0)] = 3.0
    depth: Annotated[float, above(0.0, 30.0)] = 1.5
    view_share: Annotated[float, share()] = 0.7

    def __post_init__(self) -> None:
        check_settings(self, "tours")

    def rules(self, range_max: float) -> ViewRules:
        """Return how views are measured by a laser that sees so far [m]."""
        return ViewRules(self.around, self.spacing, min(self.reach, range_max), self.depth, self.view_share)

    @property
    def weights(self) -> TourWeights:
        """Weights of the tours of a team."""
        return TourWeights(1.0, self.total, self.waiting)


SIDE = 0.1
"""Side of a coarse cell [m], rounded to whole cells of the map. As bodies keep their radius from both sides of a wall,
coarse cells of less than half a body's width never join the two sides of a wall."""

NEAR_START = 0.2
"""Bodies start from the nearest cells in which they fit, up to this distance [m]."""


@dataclass(frozen=True, slots=True)
class Tourist:
    """A robot that tours are planned for.

    Attributes
    ----------
    pose : (3,) float64
        x, y from the corner of the map's first cell, and heading [m, rad].
    kept_cell : (row, column) or None
        The frontier cell that it drives to.
    kept : float
        How much shorter another tour has to be [m].
    """

    pose: NDArray[np.float64]
    kept_cell: Cell | None = None
    kept: float = 0.0


@dataclass(frozen=True, slots=True)
class Leg:
    """The first leg of a tour.

    Attributes
    ----------
    cell : (row, column)
        Its end.
    frontier_cell : (row, column)
        The nearest cell of the frontier that is observed from there.
    cells : (n, 2) int64
        All cells of that frontier.
    gain : float
        Unknown area in view [m2].
    direction : float
        Mean direction to it [rad].
    """

    cell: Cell
    frontier_cell: Cell
    cells: NDArray[np.int64]
    gain: float
    direction: float


class CoarseFrame(NamedTuple):
    """The coarse cells around all that is free.

    Attributes
    ----------
    row, column : int
        The map's cell at which coarse cell (0, 0) begins.
    shape : (rows, columns)
        Number of coarse cells.
    factor : int
        Side of a coarse cell [cells of the map].
    side : float
        The same [m].
    """

    row: int
    column: int
    shape: tuple[int, int]
    factor: int
    side: float


@dataclass(frozen=True, slots=True)
class TourOptions:
    """The options of robots on one map: n views of its frontiers, and the costs of getting there.

    Attributes
    ----------
    robots : sequence of Tourist
        Who visits them.
    clusters : Clusters
        The frontiers that may be visited.
    grid : CoarseFrame
        The coarse cells on which paths are measured.
    places, cells : (n, 2) int64
        Coarse cells (row, column) of the views, the nearest to any robot first, and the map's cell with maximum
        clearance in each.
    numbers : (n,) int64
        Numbers of their clusters.
    gains : (n,) float64
        Unknown area in view [m2].
    lengths : (robots, n) float64
        Lengths of the paths; ``NO_PATH`` if there is none [m].
    turns : (robots, n) float64
        By how much each robot turns to set out [rad].
    is_kept : (robots, n) bool
        The present goal of each robot.
    first : (robots, n) float64
        Cost of setting out, including turns and the bonus of kept goals [m].
    between : (n, n) float64
        Lengths of the paths from view to view [m].
    sequence : (n + robots - 1,) int64
        The tours, as ``team_tours`` returns them.
    """

    robots: Sequence[Tourist]
    clusters: Clusters
    grid: CoarseFrame
    places: NDArray[np.int64]
    cells: NDArray[np.int64]
    numbers: NDArray[np.int64]
    gains: NDArray[np.float64]
    lengths: NDArray[np.float64]
    turns: NDArray[np.float64]
    is_kept: NDArray[np.bool_]
    first: NDArray[np.float64]
    between: NDArray[np.float64]
    sequence: NDArray[np.int64]

    def cells_of(self, option: int) -> NDArray[np.int64]:
        """Return the cells (row, column) of the frontier that an option shows, (m, 2) int64."""
        return self.clusters.of(int(self.numbers[option]))

    @property
    def is_reached(self) -> NDArray[np.bool_]:
        """Whether each robot has a path to each option, (robots, n) bool."""
        return self.lengths < NO_PATH


@dataclass(frozen=True, slots=True)
class TourRequest:
    """A map on which tours are to be planned.

    Attributes
    ----------
    navigation : NavigationMap
        The map.
    clusters : Clusters
        Its frontiers that may be visited.
    robots : sequence of Tourist
        Who visits them.
    memory : TourMemory
        The memory of the map, see `memory_of`.
    """

    navigation: NavigationMap
    clusters: Clusters
    robots: Sequence[Tourist]
    memory: TourMemory


def memory_of(navigation: NavigationMap, settings: TourSettings) -> TourMemory:
    """Return the memory of a map on which no tours have been planned yet."""
    return TourMemory(navigation.log_odds.shape, _factor_of(navigation.resolution))


def _factor_of(resolution: float) -> int:
    return max(round(SIDE / resolution), 1)


def tour_options(
    requests: Sequence[TourRequest], radius: float, settings: TourSettings, rules: ViewRules, threads: int = 1
) -> list[TourOptions | None]:
    """Return the options of the robots on each of some maps of one resolution, None if nothing is left for any.

    Parameters
    ----------
    requests : sequence of TourRequest
        The maps, each of them once.
    radius : float
        Radius of the robots' bodies [m].
    settings : TourSettings
        How tours are planned.
    rules : ViewRules
        How views are measured.
    threads : int, optional
        Number of threads, see ``use_threads``; the result does not depend on it. 1 by default.
    """
    due = [each for each in requests if len(each.clusters)]
    if not due:
        return [None] * len(requests)
    robots = _robots_of(due)
    (maps, width), most = robots.kept.shape, settings.most
    plans = Plans(
        counts=np.zeros(maps, np.int64),
        frames=np.zeros((maps, 4), np.int64),
        places=np.zeros((maps, most, 2), np.int64),
        cells=np.zeros((maps, most, 2), np.int64),
        numbers=np.zeros((maps, most), np.int64),
        gains=np.zeros((maps, most)),
        lengths=np.zeros((maps, width, most)),
        turns=np.zeros((maps, width, most)),
        first=np.zeros((maps, width, most)),
        is_kept=np.zeros((maps, width, most), np.bool_),
        between=np.zeros((maps, most, most)),
        sequences=np.zeros((maps, most + width - 1), np.int64),
    )
    resolution, clearance = due[0].navigation.resolution, due[0].navigation.clearance
    factor = _factor_of(resolution)
    plan_rules = PlanRules(
        resolution,
        factor * resolution,
        factor,
        clearance.limit - limit_of(radius, resolution),
        math.ceil(NEAR_START / resolution),
        settings.least_gain,
        settings.turn_length,
        *settings.weights,
    )
    plan = plan_parallel if threads > 1 and maps > 1 else plan_serial
    plan(
        np.stack([_table_of(each) for each in due]),
        robots,
        plan_rules,
        frame_of(rules, resolution, factor * resolution),
        plans,
        new_work(np.arange(maps), min(threads, maps)),
    )
    found = iter([_options_of(each, k, plans, plan_rules) for k, each in enumerate(due)])
    return [next(found) if len(each.clusters) else None for each in requests]


def _table_of(request: TourRequest) -> NDArray[np.int64]:
    navigation, clusters = request.navigation, request.clusters
    return table_of(
        [
            *request.memory.arrays,
            navigation.log_odds,
            navigation.clearance.closeness,
            clusters.cells,
            clusters.starts,
        ]
    )


def _robots_of(requests: Sequence[TourRequest]) -> Robots:
    shape = len(requests), max(len(each.robots) for each in requests)
    robots = Robots(
        np.array([len(each.robots) for each in requests], np.int64),
        np.array([each.navigation.record[ROW_LOW:] for each in requests], np.int64),
        np.zeros((*shape, 3)),
        np.full((*shape, 2), -1, np.int64),
        np.zeros(shape),
    )
    for k, each in enumerate(requests):
        for robot, tourist in enumerate(each.robots):
            robots.poses[k, robot], robots.kept[k, robot] = tourist.pose, tourist.kept
            if tourist.kept_cell is not None:
                robots.kept_cells[k, robot] = tourist.kept_cell
    return robots


def _options_of(request: TourRequest, k: int, plans: Plans, rules: PlanRules) -> TourOptions | None:
    """Return the options on one map of several."""
    n, robots, factor = int(plans.counts[k]), len(request.robots), rules.factor
    if n == 0:
        return None
    low_row, high_row, low_column, high_column = plans.frames[k].tolist()
    return TourOptions(
        request.robots,
        request.clusters,
        CoarseFrame(
            low_row * factor, low_column * factor, (high_row - low_row, high_column - low_column), factor, rules.side
        ),
        places=plans.places[k, :n],
        cells=plans.cells[k, :n],
        numbers=plans.numbers[k, :n],
        gains=plans.gains[k, :n],
        lengths=np.ascontiguousarray(plans.lengths[k, :robots, :n]),
        turns=np.ascontiguousarray(plans.turns[k, :robots, :n]),
        is_kept=np.ascontiguousarray(plans.is_kept[k, :robots, :n]),
        first=np.ascontiguousarray(plans.first[k, :robots, :n]),
        between=np.ascontiguousarray(plans.between[k, :n, :n]),
        sequence=plans.sequences[k, : n + robots - 1],
    )


def first_options(options: TourOptions) -> list[int | None]:
    """Return the option at which each robot's tour begins, None if there is none that it reaches."""
    firsts = first_places(options.sequence, len(options.numbers))
    return [number if number is not None and options.is_reached[k, number] else None for k, number in enumerate(firsts)]


def first_places(sequence: NDArray[np.int64], count: int) -> list[int | None]:
    """Return the number of the first place of each robot's tour, None if it has none.

    Parameters
    ----------
    sequence : (count + robots - 1,) int64
        Result of ``team_tours``.
    count : int
        Number of places.
    """
    firsts: list[int | None] = [None]
    for number in sequence:
        if number >= count:
            firsts.append(None)
        elif firsts[-1] is None:
            firsts[-1] = int(number)
    return firsts


def leg_to(option: int, options: TourOptions, navigation: NavigationMap, rules: ViewRules) -> Leg:
    """Return the leg that ends at an option."""
    cells, (row, column) = options.cells_of(option), options.cells[option].tolist()
    cell = row, column
    nearest = cells[int(np.argmin(np.hypot(*(cells - np.asarray(cell)).T)))]
    gain, direction = gain_at(navigation.log_odds, navigation.resolution, cell, rules)
    return Leg(cell, (int(nearest[0]), int(nearest[1])), cells, gain, direction)
