"""A group of joined robots on their merged map.

It holds the goals on offer, the cost of each robot's path there, and the answers to the tree's questions.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.supervisor.settings import SupervisorSettings
from lidarium.envs.onboard.navigation import NavigationMap
from lidarium.envs.onboard.station.reports import Report
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.grid_lines import visible
from lidarium.mapping.grids.occupancy import FREE, OCCUPIED
from lidarium.mapping.merging.fusion import FusedMap
from lidarium.mapping.planning.footprint import Footprint
from lidarium.mapping.planning.frontiers.approach import approach, default_reach
from lidarium.mapping.planning.grid_planning import Cell, Until, cells_of, centres_of, search

NONE = -1
"""Instead of the number of a goal, or of a cell: there is none."""


@dataclass(frozen=True, slots=True)
class _Goals:
    """The frontier clusters of a merged map as goals; K of them for R robots.

    Attributes
    ----------
    cells, starts : (N, 2) int64, (K + 1,) int64
        Cells (row, column) of all clusters, and the index of each one's first.
    seen_from : (K, 2) int64
        The cell of each that is nearest to its middle.
    sizes : (K,) float64
        Lengths [m].
    areas : (K,) float64
        Unknown area around each, within the range of the laser [m2].
    costs : (R, K) float64
        Cost of each robot's way to its view of the frontier [m], inf if there is none.
    stands, observed : (R, K, 2) int64
        Its cell there, and the frontier cell that it observes.
    """

    cells: NDArray[np.int64]
    starts: NDArray[np.int64]
    seen_from: NDArray[np.int64]
    sizes: NDArray[np.float64]
    areas: NDArray[np.float64]
    costs: NDArray[np.float64]
    stands: NDArray[np.int64]
    observed: NDArray[np.int64]


def _find_goals(
    navigation: NavigationMap,
    origin: tuple[float, float],
    cells: Sequence[Cell],
    footprint: Footprint,
    reach: float,
    range_m: float,
) -> _Goals:
    """Find the goals on a map, and the cost of the way to each.

    Parameters
    ----------
    navigation : NavigationMap
        The merged map.
    origin : (x, y)
        Its lower left corner [m].
    cells : sequence of (row, column)
        Cells of the robots.
    footprint : Footprint
        How they pass over the map.
    reach : float
        From how far a robot may observe a frontier [m].
    range_m : float
        Of the laser [m].
    """
    clusters = navigation.frontiers.clusters(origin)
    count, robots = len(clusters), len(cells)
    costs = np.full((robots, count), math.inf)
    stands, observed = (
        np.full((robots, count, 2), NONE, np.int64),
        np.full((robots, count, 2), NONE, np.int64),
    )
    for row, cell in enumerate(cells):
        if not count:
            break
        found = search(
            navigation.space,
            navigation.log_odds,
            navigation.clearance,
            cell,
            footprint,
        )
        near = approach(clusters, found, navigation.log_odds, reach)
        costs[row] = np.where(near.reachable, near.costs, math.inf)
        stands[row], observed[row] = near.cells, near.frontier_cells
    areas = _unknown_around(navigation.log_odds, clusters.representatives, range_m / 2.0, navigation.resolution)
    return _Goals(
        clusters.cells,
        clusters.starts,
        clusters.representatives,
        clusters.sizes,
        areas,
        costs,
        stands,
        observed,
    )


def _unknown_around(
    log_odds: NDArray[np.int8], cells: NDArray[np.int64], half_side_m: float, resolution: float
) -> NDArray[np.float64]:
    """Return the unknown area in the square around each cell [m2].

    Cells beyond the map are unknown.
    """
    half = max(round(half_side_m / resolution), 1)
    sums = np.zeros((log_odds.shape[0] + 1, log_odds.shape[1] + 1), np.int64)
    sums[1:, 1:] = (log_odds != 0).cumsum(axis=0, dtype=np.int64).cumsum(axis=1)
    low = np.maximum(cells - half, 0)
    high = np.minimum(cells + half + 1, log_odds.shape)
    known = (
        sums[high[:, 0], high[:, 1]]
        - sums[low[:, 0], high[:, 1]]
        - sums[high[:, 0], low[:, 1]]
        + sums[low[:, 0], low[:, 1]]
    )
    return np.asarray(((2 * half + 1) ** 2 - known) * resolution**2, np.float64)


_MARGIN = 1


class Survey:
    """Goals on the merged map of a group for its robots.

    All is in the frame of the map, that of the group's first robot.

    Parameters
    ----------
    fused : FusedMap
        The merged map.
    frames : mapping of str to Transform
        Of each robot's map frame in that of the map.
    reports : mapping of str to Report
        The robots' reports.
    workers : sequence of str
        The robots that can get goals; rows of the arrays of ``goals``.
    given_up : (N, 2) float64
        Positions of frontiers given up [m].
    footprint : Footprint
        How the robots pass over a map.
    settings : SupervisorSettings
        Limits of goals.
    """

    def __init__(
        self,
        fused: FusedMap,
        frames: Mapping[str, Transform],
        reports: Mapping[str, Report],
        workers: Sequence[str],
        given_up: NDArray[np.float64],
        footprint: Footprint,
        settings: SupervisorSettings,
    ) -> None:
        self.frames, self.workers, self._settings, self._footprint = (
            dict(frames),
            list(workers),
            settings,
            footprint,
        )
        levels = np.pad(fused.levels, _MARGIN, constant_values=127)
        log_odds = (levels == OCCUPIED).astype(np.int8) - (levels == FREE).astype(np.int8)
        self.resolution = fused.resolution
        self.origin = (
            fused.origin[0] - _MARGIN * fused.resolution,
            fused.origin[1] - _MARGIN * fused.resolution,
        )
        self._map = NavigationMap(log_odds, fused.resolution)
        self._map.changed((0, log_odds.shape[0], 0, log_odds.shape[1]))
        reach = default_reach(footprint, fused.resolution)
        for cell in cells_of(given_up, self.origin, fused.resolution):
            self._map.frontiers.ignore_near((int(cell[0]), int(cell[1])), reach)
        self._poses = {agent: frames[agent] @ reports[agent].pose for agent in self.workers}
        cells = [self._cell_of(agent) for agent in self.workers]
        self.goals = _find_goals(self._map, self.origin, cells, footprint, reach, settings.sensor_range_m)
        targets = {agent: reports[agent].target for agent in self.workers}
        self.places = {
            agent: None if target is None else tuple(frames[agent].apply((target.x, target.y)).tolist())
            for agent, target in targets.items()
        }
        """Where each robot goes [m], None where it goes nowhere."""
        self.going = {agent: self._goal_at(position) for agent, position in self.places.items()}
        """The goal that this is, -1 for none."""

    @cached_property
    def area_m2(self) -> float:
        """Area that the group's map knows, and what is unknown around its frontiers [m2].

        The thesis says that a complete map is known by a share of 1, but not of which area.
        """
        known = self._map.log_odds != 0
        half = max(round(self._settings.sensor_range_m / 2.0 / self.resolution), 1)
        beyond = np.zeros(np.add(known.shape, 2 * half), np.bool_)
        for row, column in self.goals.seen_from[self._is_left()]:
            beyond[row : row + 2 * half + 1, column : column + 2 * half + 1] = True
        return float(np.count_nonzero(beyond | np.pad(known, half))) * self.resolution**2

    def has_frontier(self) -> bool:
        """Whether any of the robots can reach an unexplored frontier."""
        return bool(self._is_left().any())

    def _is_left(self) -> NDArray[np.bool_]:
        """Return which goals are long enough to be work left, and in reach, (K,)."""
        is_long = self.goals.sizes >= self._settings.least_left_m
        return np.asarray(is_long & np.isfinite(self.goals.costs).any(axis=0))

    def is_goal(self) -> NDArray[np.bool_]:
        """Return which goals are long enough to be given, (K,)."""
        return self.goals.sizes >= self._settings.least_frontier_m

    def is_same_goal(self, a: str, b: str, distance_m: float) -> bool:
        """Whether two robots go to one goal: to places this near, or to one frontier."""
        first, second = self.places[a], self.places[b]
        if first is None or second is None:
            return False
        return math.dist(first, second) < distance_m or (self.going[a] != NONE and self.going[a] == self.going[b])

    def are_meeting(self, a: str, b: str) -> bool:
        """Whether two robots are about to meet.

        Their goals lie near and in sight of each other, and both robots come nearer to the other by
        going there.
        """
        first, second = self.places[a], self.places[b]
        if first is None or second is None or math.dist(first, second) >= self._settings.rendezvous_m:
            return False
        here, there = ((self._poses[agent].x, self._poses[agent].y) for agent in (a, b))
        is_sighted = visible(self._map.log_odds, self._inside(first), np.array([self._inside(second)]))
        return bool(is_sighted[0]) and math.dist(first, second) < math.dist(here, there)

    def seen(self) -> NDArray[np.float64]:
        """Return how much of each goal is seen from each other, shape (K, K).

        It is 1 less their distance over the laser's range, in line of sight.
        """
        cells = self.goals.seen_from
        seen = np.zeros((len(cells), len(cells)))
        for k, cell in enumerate(cells):
            seen[k] = self._seen_from((int(cell[0]), int(cell[1])))
            seen[k, k] = 1.0
        return seen

    def seen_at(self, place: tuple[float, float]) -> NDArray[np.float64]:
        """Return how much of each goal a robot at a place [m] sees, (K,)."""
        return self._seen_from(self._inside(place))

    def stand(self, agent: str, goal: int) -> tuple[float, float, float]:
        """Return the pose from which a robot sees a goal [m, rad].

        Both are in its own map frame.
        """
        row = self.workers.index(agent)
        position, cell = (
            centres_of(cells[row, goal], self.origin, self.resolution)
            for cells in (self.goals.stands, self.goals.observed)
        )
        own = self.frames[agent].inverse()
        x, y = own.apply(position).tolist()
        observed = own.apply(cell)
        return x, y, math.atan2(observed[1] - y, observed[0] - x)

    def observed_cell(self, agent: str, goal: int) -> tuple[float, float]:
        """Return the frontier cell of a goal that a robot observes [m].

        It is in the robot's own map frame.
        """
        row = self.workers.index(agent)
        x, y = (
            self.frames[agent]
            .inverse()
            .apply(centres_of(self.goals.observed[row, goal], self.origin, self.resolution))
            .tolist()
        )
        return x, y

    def way_home_m(self, agent: str, home: Transform) -> float:
        """Return the cost of a robot's path to a pose of its own map frame [m].

        It is inf if there is no path.
        """
        at = self.frames[agent] @ home
        found = search(
            self._map.space,
            self._map.log_odds,
            self._map.clearance,
            self._cell_of(agent),
            self._footprint,
            until=Until(goal=self._inside((at.x, at.y))),
        )
        return found.cost(self._inside((at.x, at.y)))

    def _goal_at(self, place: tuple[float, ...] | None) -> int:
        """Return the goal that a robot at a place [m] observes, -1 for none."""
        if place is None or not len(self.goals.cells):
            return NONE
        cells = centres_of(self.goals.cells, self.origin, self.resolution)
        distances = np.hypot(*(cells - np.asarray(place)).T)
        nearest = int(np.argmin(distances))
        if distances[nearest] > self._footprint.radius + self._settings.same_goal_m:
            return NONE
        return int(np.searchsorted(self.goals.starts, nearest, side="right")) - 1

    def _seen_from(self, cell: Cell) -> NDArray[np.float64]:
        cells = self.goals.seen_from
        if not len(cells):
            return np.zeros(0)
        is_seen = visible(self._map.log_odds, cell, cells, self._settings.sensor_range_m / self.resolution)
        distances = np.hypot(*(cells - np.asarray(cell)).T) * self.resolution
        return np.where(is_seen, np.clip(1.0 - distances / self._settings.sensor_range_m, 0.0, 1.0), 0.0)

    def _cell_of(self, agent: str) -> Cell:
        pose = self._poses[agent]
        return self._inside((pose.x, pose.y))

    def _inside(self, place: tuple[float, ...]) -> Cell:
        """Return the cell of a place [m].

        It is the nearest one of the map if the place lies outside.
        """
        cell = cells_of(np.asarray(place), self.origin, self.resolution)
        rows, columns = self._map.log_odds.shape
        return min(max(int(cell[0]), 0), rows - 1), min(max(int(cell[1]), 0), columns - 1)
