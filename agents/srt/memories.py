"""Knowledge of seen space and of clear straight paths."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.srt.tree import Node
from lidarium.envs.onboard.driving.path_planner import footprint_of
from lidarium.envs.onboard.navigation import NavigationMap
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.planning.frontiers.approach import approach, default_reach
from lidarium.mapping.planning.frontiers.frontier_map import FRONTIER
from lidarium.mapping.planning.grid_planning import centres_of, plan, search

Place = NDArray[np.float64]
Legs = list[Place]


@dataclass(frozen=True, slots=True)
class _Frontiers:
    """Frontiers that a robot can come to.

    Attributes
    ----------
    focuses : (n, 2) float64
        A point on each that is in sight from the robot's position there [m].
    cells : list of (m, 2) float64
        The cells of each [m].
    sizes : (n,) float64
        Their lengths [m].
    costs : (n,) float64
        Cost of the way to each [m], ascending.
    ahead : (n, 2) float64
        A place at the beginning of the way to each [m].
    between : callable
        Takes the numbers of some, shape (m,), and returns what the ways from place to place cost, shape (m,
        m) [m].
    legs : callable
        Takes the number of one, and returns the ends of the straight legs of the way to it.
    """

    focuses: NDArray[np.float64]
    cells: list[NDArray[np.float64]]
    sizes: NDArray[np.float64]
    costs: NDArray[np.float64]
    ahead: NDArray[np.float64]
    between: Callable[[NDArray[np.int64]], NDArray[np.float64]]
    legs: Callable[[int], Legs]


class Memory(Protocol):
    """The memory of a robot.

    Places (..., 2) are in the frame of the map's first cell [m].
    """

    def is_seen(self, points: NDArray[np.float64], of: Node) -> NDArray[np.bool_]:
        """Whether points (n, 2) beyond the border of a node were seen, shape (n,).

        The border is that of the region seen from the node.
        """
        ...

    def is_clear(self, start: Place, end: Place) -> bool:
        """Whether the robot is known to get through on a straight way."""
        ...

    def way(self, start: Place, end: Place) -> Legs | None:
        """Return the ends of the straight legs of a path across seen space.

        The last end is ``end``; None if there is no path.
        """
        ...

    def frontiers(self, start: Place, least: float, most: int) -> _Frontiers | None:
        """Return at most a number of the nearest frontiers of at least a length [m].

        None if there is none.
        """
        ...

    def is_frontier(self, focus: Place) -> bool:
        """Whether the space behind a visited frontier is still unseen."""
        ...

    def give_up(self, focus: Place) -> None:
        """Ask no more for a frontier that was observed and cannot be seen through."""
        ...


CLEAR_MARGIN = 0.02
"""Straight ways across the map keep the body this far from what is occupied [m]."""

WALL = 0.08
"""Unknown cells this near to occupied ones may well be their inside [m]."""

AHEAD = 0.5
"""The direction of a path is that of the place this far along it [m]."""


class MapMemory:
    """A memory that relies on the map.

    Known space is seen, and a path is clear if all of it is free with room for the robot.

    Parameters
    ----------
    navigation : NavigationMap
        The map.
    radius : float
        Radius of the robot [m].
    """

    def __init__(self, navigation: NavigationMap, radius: float) -> None:
        self._map, self._radius, self._body = navigation, radius, radius + CLEAR_MARGIN

    def is_seen(self, points: NDArray[np.float64], of: Node) -> NDArray[np.bool_]:
        """Whether points (n, 2) lie in known cells.

        Points outside of the map count, too, and those so near to occupied cells that they may lie
        in it.
        """
        rows, columns, is_inside = self._cells(points)
        is_beside_wall = self._clearance(rows, columns) < WALL
        return np.asarray(~is_inside | (self._map.log_odds[rows, columns] != 0) | is_beside_wall)

    def is_clear(self, start: Place, end: Place) -> bool:
        """Whether all cells on a way are free, with room for the robot."""
        field, resolution = self._map.clearance, self._map.resolution
        count = max(math.ceil(math.dist(start, end) / (0.5 * resolution)), 1)
        distance = (field.closeness, field.limit, field.resolution)
        return bool(_is_clear(self._map.log_odds, distance, resolution, start, end, count, self._body))

    def way(self, start: Place, end: Place) -> Legs | None:
        """Return the path that the onboard planning finds across the map.

        Its legs are as long as they are clear.
        """
        rows, columns, is_inside = self._cells(np.stack([start, end]))
        if not is_inside.all() or self._map.log_odds[rows[1], columns[1]] >= 0:
            return None
        cells = [(int(row), int(column)) for row, column in zip(rows, columns, strict=True)]
        found = plan(
            self._map.space,
            self._map.log_odds,
            self._map.clearance,
            cells[0],
            cells[1],
            footprint_of(self._radius),
        )
        return None if found is None else self._legs(start, [*self._centres(found[1])[1:-1], end])

    def frontiers(self, start: Place, least: float, most: int) -> _Frontiers | None:
        """Return the cheapest frontiers to reach, and the paths between them.

        The paths join the robot's positions at them.
        """
        rows, columns, is_inside = self._cells(start[None])
        at_least = max(math.ceil(least / self._map.resolution - 1e-9), 1)
        clusters = self._map.frontiers.clusters(minimum_cells=at_least)
        if not (is_inside.all() and len(clusters)):
            return None
        footprint = footprint_of(self._body)
        found = search(
            self._map.space,
            self._map.log_odds,
            self._map.clearance,
            (int(rows[0]), int(columns[0])),
            footprint,
        )
        near = approach(clusters, found, self._map.log_odds, default_reach(footprint, self._map.resolution))
        reached = np.flatnonzero(near.reachable)
        if not len(reached):
            return None
        chosen = reached[np.argsort(near.costs[reached], kind="stable")][:most]
        stands = [(int(row), int(column)) for row, column in near.cells[chosen]]
        ways = [self._centres(found.path(stand)) for stand in stands]
        ahead = round(AHEAD / self._map.resolution)
        costs = near.costs[chosen]
        return _Frontiers(
            focuses=np.array(self._centres(near.frontier_cells[chosen])),
            cells=[np.array(self._centres(clusters.of(int(k)))) for k in chosen],
            sizes=clusters.sizes[chosen],
            costs=costs,
            ahead=np.array([way[min(ahead, len(way) - 1)] for way in ways]),
            # There is always the way past where the robot is.
            between=lambda numbers: self._map.path_costs(footprint).between(
                [stands[k] for k in numbers], costs[numbers]
            ),
            legs=lambda k: self._legs(start, ways[k][1:] or ways[k]),
        )

    def is_frontier(self, focus: Place) -> bool:
        """Whether the cell is a frontier of the map."""
        return bool(self._map.frontiers.flags[self._cell(focus)] == FRONTIER)

    def give_up(self, focus: Place) -> None:
        """Ignore the frontier around the cell, as frontier explorers do."""
        self._map.frontiers.ignore_near(
            self._cell(focus), default_reach(footprint_of(self._radius), self._map.resolution)
        )

    def _legs(self, start: Place, places: Legs) -> Legs:
        """Return a way with places left out wherever the straight way past them is clear."""
        legs: Legs = []
        at = start
        while places:
            clear = next((k for k in range(len(places) - 1, 0, -1) if self.is_clear(at, places[k])), 0)
            at, places = places[clear], places[clear + 1 :]
            legs.append(at)
        return legs

    def _centres(self, path: NDArray[np.int64]) -> Legs:
        return list(centres_of(path, (0.0, 0.0), self._map.resolution))

    def _cell(self, place: Place) -> tuple[int, int]:
        rows, columns, _ = self._cells(place[None])
        return int(rows[0]), int(columns[0])

    def _clearance(self, rows: NDArray[np.int64], columns: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the distance of cells from occupied ones [m]."""
        field = self._map.clearance
        return np.sqrt(field.limit - field.closeness[rows, columns].astype(np.float64)) * 0.5 * field.resolution

    def _cells(self, points: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
        """Return rows and columns of points, and which of them lie on the map.

        The others get the nearest cell.
        """
        cells = np.floor(points / self._map.resolution).astype(np.int64)
        rows, columns = self._map.log_odds.shape
        row, column = np.clip(cells[..., 1], 0, rows - 1), np.clip(cells[..., 0], 0, columns - 1)
        return row, column, (row == cells[..., 1]) & (column == cells[..., 0])


@kernel(nrt=False)
def _is_clear(
    log_odds: Array,
    distance: tuple[Array, int, float],
    resolution: float,
    start: Array,
    end: Array,
    count: int,
    body: float,
) -> bool:
    """Whether all cells are free at points of a way that divide it into ``count`` parts (kernel).

    A body has room at each, but for those nearer to the start than its radius: where a robot starts it may be
    nearer to a wall than it would go.
    """
    closeness, limit, side = distance
    rows, columns = log_odds.shape
    for k in range(count + 1):
        share = k * (1.0 / count) if k < count else 1.0
        column = math.floor((start[0] + (end[0] - start[0]) * share) / resolution)
        row = math.floor((start[1] + (end[1] - start[1]) * share) / resolution)
        if not (0 <= row < rows and 0 <= column < columns) or log_odds[row, column] >= 0:
            return False
        clearance = math.sqrt(limit - float(closeness[row, column])) * 0.5 * side
        if clearance < body and k * 0.5 * resolution >= body:
            return False
    return True


class RegionMemory:
    """Memory of nodes: space in another node's safe region is seen.

    A way is clear within one node's safe region.
    """

    def __init__(self, nodes: Iterable[Node]) -> None:
        self._nodes = list(nodes)

    def is_seen(self, points: NDArray[np.float64], of: Node) -> NDArray[np.bool_]:
        """Whether points (n, 2) lie in the safe region of another node."""
        seen = np.zeros(len(points), np.bool_)
        for node in self._nodes:
            # A node made again at the same place sees what it saw before: its openings stay.
            if node is not of and not np.array_equal(node.place, of.place):
                seen |= node.safe.contains(points)
        return seen

    def is_clear(self, start: Place, end: Place) -> bool:
        """Whether a way begins at a node and ends within its safe region."""
        return any(math.dist(node.place, start) <= 0.05 and bool(node.safe.contains(end)) for node in self._nodes)

    def way(self, start: Place, end: Place) -> Legs | None:
        """Return None: regions know no way but the tree's."""
        return None

    def frontiers(self, start: Place, least: float, most: int) -> _Frontiers | None:
        """Return None: regions have openings alone."""
        return None

    def is_frontier(self, focus: Place) -> bool:
        """Return False: there are no frontiers."""
        return False

    def give_up(self, focus: Place) -> None:
        """Do nothing."""
