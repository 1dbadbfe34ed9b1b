"""The options of robots on one map, the tours past all of them, and the first leg of each."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.onboard.navigation import NavigationMap
from lidarium.mapping.geometry.bounds import above, check_settings, share, within
from lidarium.mapping.planning.frontiers.frontier_map import Clusters
from lidarium.mapping.planning.frontiers.views import ViewRules, gain_at, views_of
from lidarium.mapping.planning.grid_planning import Cell
from lidarium.mapping.planning.touring.coarse_distances import (
    STRAIGHT,
    UNREACHED,
    CoarseGrid,
    coarse_grid,
    distances_among,
    distances_from,
    place_in,
)
from lidarium.mapping.planning.touring.tours import TourWeights, team_tours

Length = Annotated[float, within(0.0, 1000.0)]


@dataclass(frozen=True, slots=True, kw_only=True)
class TourSettings:
    """How tours past frontiers are planned.

    Attributes
    ----------
    minimum_size : float
        Shorter frontiers are visited only when no others are left [m].
    least_gain : float
        So are those that show less than this [m2].
    most : int
        Maximum number of frontiers on tours: each robot in turn takes its nearest.
    kept_share : float
        A robot goes on to a frontier until less than this share of the area that it would show is left.
    kept : float
        A robot's goal is left only for tours that are shorter by this [m].
    turn_length : float
        Length of path that a radian of turning costs at the start [m/rad].
    total, waiting : float
        Weight of the sum of all tours against the longest one, and of how long a square metre waits to be
        seen [1, 1/m2].
    around, spacing : float
        Views lie within the first of their frontiers, and the second apart [m].
    reach, depth : float
        Unknown space counts up to the first from a view, and up to the second behind known space [m].
    view_share : float
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


AHEAD = 0.5
"""The direction in which a path begins is that of a place about so far along it [m]."""

SAME = 0.5
"""Frontiers nearer than this to what a robot drives to are what it drives to [m]."""

NO_PATH = 1e4
"""Length of a path that there is none of [m]."""


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


@dataclass(frozen=True, slots=True)
class TourOptions:
    """The options of robots on one map: n views of its frontiers, and the costs of getting there.

    Attributes
    ----------
    robots : sequence of Tourist
        Who visits them.
    clusters : Clusters
        The frontiers that may be visited.
    grid : CoarseGrid
        Cells free for the bodies.
    places : (n, 2) int64
        Coarse cells (row, column) of the views, the nearest to any robot first.
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
    grid: CoarseGrid
    places: NDArray[np.int64]
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


def tour_options(
    navigation: NavigationMap,
    clusters: Clusters,
    robots: Sequence[Tourist],
    radius: float,
    settings: TourSettings,
    rules: ViewRules,
) -> TourOptions | None:
    """Return the options of robots on one map, None if nothing is left for any.

    Parameters
    ----------
    navigation : NavigationMap
        The map.
    clusters : Clusters
        Its frontiers that may be visited.
    robots : sequence of Tourist
        Who visits them.
    radius : float
        Radius of their bodies [m].
    settings : TourSettings
        How tours are planned.
    rules : ViewRules
        How views are measured.
    """
    if not len(clusters):
        return None
    resolution = navigation.resolution
    cells = np.array([_cell_at(robot.pose, resolution) for robot in robots])
    grid = coarse_grid(navigation.log_odds, navigation.clearance, radius, starts=cells)
    starts = np.array([grid.cell_of((int(row), int(column))) for row, column in cells])
    lengths = distances_from(grid, starts)
    groups = (clusters.cells, clusters.starts)
    views = views_of(navigation.log_odds, resolution, grid, lengths.min(axis=0), groups, rules)
    is_seen = views.lengths < UNREACHED
    reached = np.where(is_seen, lengths[:, views.cells[:, 0], views.cells[:, 1]], UNREACHED)
    chosen = _nearest(reached, views.gains, settings)
    if not len(chosen):
        return None
    positions = views.cells[chosen]
    paths = _metres(lengths[:, positions[:, 0], positions[:, 1]], grid)
    among, fields = distances_among(grid, positions, starts)
    between = _metres(among, grid)
    turns = np.stack(
        [_turns(robot.pose, start, fields, grid, resolution) for robot, start in zip(robots, starts, strict=True)]
    )
    is_kept = np.stack([_are_kept(robot, clusters, chosen, resolution) for robot in robots])
    kept = np.array([[robot.kept] for robot in robots])
    first = paths + settings.turn_length * turns - kept * is_kept
    gains = views.gains[chosen]
    sequence = team_tours(first, between, gains, settings.weights)
    return TourOptions(
        robots, clusters, grid, positions, chosen, gains, paths, turns, is_kept, first, between, sequence
    )


def first_options(options: TourOptions) -> list[int | None]:
    """Return the option at which each robot's tour begins, None if there is none that it reaches."""
    firsts = _first_places(options.sequence, len(options.numbers))
    return [number if number is not None and options.is_reached[k, number] else None for k, number in enumerate(firsts)]


def _first_places(sequence: NDArray[np.int64], count: int) -> list[int | None]:
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


def _cell_at(pose: NDArray[np.float64], resolution: float) -> Cell:
    return math.floor(pose[1] / resolution), math.floor(pose[0] / resolution)


def _nearest(lengths: NDArray[np.int32], gains: NDArray[np.float64], settings: TourSettings) -> NDArray[np.int64]:
    """Return the numbers of the frontiers to visit, the nearest to any robot first.

    Each robot in turn takes its nearest: a team that is spread out has something to visit everywhere.
    ``lengths`` (robots, frontiers) are those of the paths there.
    """
    is_wanted = (lengths < UNREACHED) & (gains >= settings.least_gain)
    robots = len(lengths)
    ranks = np.where(is_wanted, lengths, UNREACHED).argsort(axis=1, kind="stable").argsort(axis=1)
    turns = np.where(is_wanted, ranks * robots + np.arange(robots)[:, None], UNREACHED).min(axis=0)
    chosen = turns.argsort(kind="stable")[: settings.most]
    chosen = np.sort(chosen[turns[chosen] < UNREACHED])
    nearest = lengths[:, chosen].min(axis=0)
    return np.asarray(chosen[np.argsort(nearest, kind="stable")])


def _metres(lengths: NDArray[np.int32], grid: CoarseGrid) -> NDArray[np.float64]:
    return np.where(lengths == UNREACHED, NO_PATH, lengths * (grid.side / STRAIGHT))


def _turns(
    pose: NDArray[np.float64],
    start: NDArray[np.int64],
    fields: NDArray[np.int32],
    grid: CoarseGrid,
    resolution: float,
) -> NDArray[np.float64]:
    """Return by how much a robot turns to set out to each of n places, (n,) [rad].

    ``fields`` (n, rows, columns) are lengths of paths from each place.
    """
    reach = max(round(AHEAD / grid.side), 1)
    low = np.maximum(start - reach, 0)
    part = fields[:, low[0] : start[0] + reach + 1, low[1] : start[1] + reach + 1]
    nearest = part.reshape(len(fields), -1).argmin(axis=1)
    rows, columns = np.unravel_index(nearest, part.shape[1:])
    x = (grid.column + (low[1] + columns + 0.5) * grid.factor) * resolution - pose[0]
    y = (grid.row + (low[0] + rows + 0.5) * grid.factor) * resolution - pose[1]
    turns = np.abs((np.arctan2(y, x) - pose[2] + math.pi) % (2.0 * math.pi) - math.pi)
    return np.where(np.hypot(x, y) > grid.side, turns, 0.0)


def _are_kept(robot: Tourist, clusters: Clusters, chosen: NDArray[np.int64], resolution: float) -> NDArray[np.bool_]:
    """Return which of the chosen frontiers a robot drives to already."""
    if robot.kept_cell is None:
        return np.zeros(len(chosen), np.bool_)
    at, reach = np.asarray(robot.kept_cell), SAME / resolution
    return np.array([np.abs(clusters.of(int(k)) - at).max(axis=1).min() < reach for k in chosen])


def leg_to(option: int, options: TourOptions, navigation: NavigationMap, rules: ViewRules) -> Leg:
    """Return the leg that ends at an option."""
    log_odds, position = navigation.log_odds, options.places[option]
    cells = options.cells_of(option)
    cell = place_in(options.grid, log_odds, navigation.clearance, (int(position[0]), int(position[1])))
    nearest = cells[int(np.argmin(np.hypot(*(cells - np.asarray(cell)).T)))]
    gain, direction = gain_at(log_odds, navigation.resolution, cell, rules)
    return Leg(cell, (int(nearest[0]), int(nearest[1])), cells, gain, direction)
