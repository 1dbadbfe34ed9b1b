"""Frontiers that a body can approach, the places there, and the cheapest.

At its place the body is near to the frontier.

A frontier cell often lies where the body does not fit, beside a wall or the edge of what is known. It is
enough to stand within reach of it and to see it: what lies beyond an occupied cell is not approached, be it a
hand's breadth away.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.grids.grid_lines import line_is_open
from lidarium.mapping.kernels.compilation import kernel
from lidarium.mapping.planning.clearance import ClearanceField
from lidarium.mapping.planning.footprint import Footprint
from lidarium.mapping.planning.frontier_kernels import FRONTIER
from lidarium.mapping.planning.frontiers import Clusters, FrontierMap
from lidarium.mapping.planning.grid_planning import Cell, Disc, Until, search
from lidarium.mapping.planning.search.search_space import Search, SearchSpace
from lidarium.mapping.planning.search.search_state import LEAVING, NO_ENTRY
from lidarium.mapping.planning.search.search_targets import disc_spans


@dataclass(frozen=True, slots=True)
class Approaches:
    """How near a searched body comes to each of K clusters.

    Attributes
    ----------
    cells : (K, 2) int64
        Where to stand (row, column); -1 where the cluster cannot be reached.
    costs : (K,) float64
        Cost of the way there [m]; ``inf`` where there is none.
    frontier_cells : (K, 2) int64
        A cell of the cluster within reach from there; -1 where there is none.
    in_sight : (K,) bool
        Whether that cell is seen from there; if not, no place within reach sees any cell of the cluster.
    reasons : tuple of str
        "" for clusters in reach and sight, "hidden" (within reach, behind something occupied), "narrow" (a
        thinner body would come near) or "blocked" (none would, or none was asked).
    """

    cells: NDArray[np.int64]
    costs: NDArray[np.float64]
    frontier_cells: NDArray[np.int64]
    in_sight: NDArray[np.bool_]
    reasons: tuple[str, ...]

    @property
    def reachable(self) -> NDArray[np.bool_]:
        """Which clusters are in reach and sight, (K,) bool."""
        return self.in_sight


@dataclass(frozen=True, slots=True)
class NearestFrontier:
    """The frontier that costs least to come near.

    Attributes
    ----------
    cell : (row, column)
        Where to stand.
    frontier_cell : (row, column)
        The frontier cell in reach and sight from there, the nearest one.
    cost : float
        Cost of the way [m].
    path : (N, 2) int64
        Cells from the start to ``cell``.
    """

    cell: Cell
    frontier_cell: Cell
    cost: float
    path: NDArray[np.int64]


def default_reach(footprint: Footprint, resolution: float) -> float:
    """How near to a frontier is near enough [m]: the radius of the body and two cells."""
    return footprint.radius + 2.0 * resolution


def approach(
    clusters: Clusters,
    found: Search,
    log_odds: NDArray[np.int8],
    reach: float,
    thin: NDArray[np.bool_] | None = None,
) -> Approaches:
    """Where a searched body comes near to each cluster at the least cost.

    Parameters
    ----------
    clusters : Clusters
        What to come near to.
    found : Search
        A search over all that the body can reach.
    log_odds : (rows, columns) int8
        The belief that was searched.
    reach : float
        How near is near enough [m], between centres of cells.
    thin : (K,) bool, optional
        Which of the clusters a thinner body reaches (``approach(...).reachable`` of a search with a smaller
        radius in another space), to distinguish narrow from blocked paths.

    Returns
    -------
    Approaches
        Per cluster the cheapest cell from which a frontier cell is in reach and sight; if there is none, the
        cheapest in reach; ties go to the first frontier cell of the cluster, then to the lower row and
        column.

    Raises
    ------
    ValueError
        If ``thin`` is not one value per cluster, or another search has used the space since.
    """
    if thin is not None and len(thin) != len(clusters):
        raise ValueError(f"thin has {len(thin)} values; want one for each of the {len(clusters)} clusters")
    found.cost(found.start)
    space = found.space
    places, left, in_sight = approach_places(
        clusters.cells,
        clusters.starts,
        log_odds,
        space.remaining,
        space.parent,
        found.budget - found.settled,
        disc_spans(reach / space.resolution),
    )
    reached = left > 0
    costs = np.where(reached, (found.budget - left) * found.unit, math.inf)
    names = []
    for k in range(len(clusters)):
        unseen = "hidden" if reached[k] else "narrow" if thin is not None and thin[k] else "blocked"
        names.append("" if in_sight[k] else unseen)
    return Approaches(places[:, :2].copy(), costs, places[:, 2:].copy(), in_sight, tuple(names))


def nearest_frontier(
    frontiers: FrontierMap,
    space: SearchSpace,
    log_odds: NDArray[np.int8],
    clearance: ClearanceField,
    start: Cell,
    footprint: Footprint,
    *,
    reach: float | None = None,
    blocked: Iterable[Disc] = (),
) -> NearestFrontier | None:
    """Search outwards for a place with a frontier cell in reach and sight.

    The first such place ends the search.

    Parameters
    ----------
    frontiers : FrontierMap
        What to search.
    space, log_odds, clearance, start, footprint, blocked
        As for :func:`lidarium.mapping.planning.grid_planning.search`.
    reach : float, optional
        How near is near enough [m]; by default the radius and two cells.

    Returns
    -------
    NearestFrontier or None
        None if no frontier can be reached.
    """
    distance = default_reach(footprint, space.resolution) if reach is None else reach
    until = Until(targets=frontiers.targets(distance))
    found = search(space, log_odds, clearance, start, footprint, until=until, blocked=blocked)
    if len(found.hits) == 0:
        return None
    row, column = int(found.hits[0, 0]), int(found.hits[0, 1])
    seen_row, seen_column = _nearest_in_sight(
        log_odds, frontiers.flags, disc_spans(distance / space.resolution), row, column
    )
    return NearestFrontier(
        (row, column), (int(seen_row), int(seen_column)), found.cost((row, column)), found.path((row, column))
    )


@kernel
def approach_places(
    cells: NDArray[np.int64],
    starts: NDArray[np.int64],
    log_odds: NDArray[np.int8],
    remaining: NDArray[np.int32],
    parent: NDArray[np.uint8],
    least: int,
    spans: NDArray[np.int64],
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
    """Return per cluster the place, its frontier cell, budget and visibility (kernel).

    The budget is what remains at the place; visibility is whether the place sees the frontier cell.
    """
    rows, columns = log_odds.shape
    reach = len(spans) // 2
    count = len(starts) - 1
    places = np.full((count, 4), -1, np.int64)
    best = np.zeros(count, np.int64)
    in_sight = np.zeros(count, np.bool_)
    for k in range(count):
        for i in range(starts[k], starts[k + 1]):
            row, column = cells[i]
            for other in range(max(row - reach, 0), min(row + reach + 1, rows)):
                span = spans[other - row + reach]
                for another in range(max(column - span, 0), min(column + span + 1, columns)):
                    left = remaining[other, another]
                    if left == 0 or left == NO_ENTRY or left < least or (in_sight[k] and left <= best[k]):
                        continue
                    if parent[other, another] >= LEAVING:
                        continue
                    sees = line_is_open(log_odds, other, another, row, column)
                    if (sees and not in_sight[k]) or (sees == in_sight[k] and left > best[k]):
                        in_sight[k] = sees
                        best[k] = left
                        places[k, 0] = other
                        places[k, 1] = another
                        places[k, 2] = row
                        places[k, 3] = column
    return places, best, in_sight


@kernel
def _nearest_in_sight(
    log_odds: NDArray[np.int8], flags: NDArray[np.uint8], spans: NDArray[np.int64], row: int, column: int
) -> tuple[int, int]:
    """Return the frontier cell nearest to a cell among those in its sight.

    The lowest row and column of equals.
    """
    reach = len(spans) // 2
    rows, columns = flags.shape
    best = 2 * (reach + 1) ** 2
    found = (-1, -1)
    for other in range(max(row - reach, 0), min(row + reach + 1, rows)):
        span = spans[other - row + reach]
        for another in range(max(column - span, 0), min(column + span + 1, columns)):
            squared = (other - row) ** 2 + (another - column) ** 2
            if (
                flags[other, another] == FRONTIER
                and squared < best
                and line_is_open(log_odds, row, column, other, another)
            ):
                best = squared
                found = (other, another)
    return found
