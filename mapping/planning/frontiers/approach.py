"""Frontiers that a body can approach, and the cheapest cells to do so.

A frontier cell is often if the body does not fit, next to a wall or the edge of the known area. It is
enough to stand within reach of it and to see it: a frontier behind an occupied cell is not approached,
however near it is.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.grids.grid_lines import line_is_open
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.simd.costs import FAR, LANES, cheaper_cells
from lidarium.mapping.kernels.simd.words import first_bit
from lidarium.mapping.planning.clearance import ClearanceField
from lidarium.mapping.planning.footprint import Footprint
from lidarium.mapping.planning.frontiers.frontier_map import FRONTIER, Clusters, FrontierMap
from lidarium.mapping.planning.grid_planning import Cell, Disc, Until, search
from lidarium.mapping.planning.search.path_search import Search, SearchSpace
from lidarium.mapping.planning.search.search_state import LEAVING, NO_ENTRY, disc_spans
from lidarium.mapping.planning.search.swept_costs import SweptCosts


@dataclass(frozen=True, slots=True)
class _Approaches:
    """Nearest approach of a body to each of K clusters.

    Attributes
    ----------
    cells : (K, 2) int64
        Cells to stand in (row, column); -1 if the cluster cannot be reached.
    costs : (K,) float64
        Cost of the path there [m]; ``inf`` if there is none.
    frontier_cells : (K, 2) int64
        A cell of the cluster within reach from there; -1 if there is none.
    in_sight : (K,) bool
        Whether that cell is visible from there; if not, no cell of the cluster is visible from within reach.
    reasons : tuple of str
        "" for clusters in reach and sight, "hidden" (within reach, behind an occupied cell), "narrow" (a
        thinner body would come near) or "blocked" (none would, or none was asked).
    """

    cells: NDArray[np.int64]
    costs: NDArray[np.float64]
    frontier_cells: NDArray[np.int64]
    in_sight: NDArray[np.bool_]
    reasons: tuple[str, ...]

    @property
    def reachable(self) -> NDArray[np.bool_]:
        """Whether each cluster is in reach and sight, (K,) bool."""
        return self.in_sight


@dataclass(frozen=True, slots=True)
class _NearestFrontier:
    """The frontier that is cheapest to approach.

    Attributes
    ----------
    cell : (row, column)
        The cell to stand in.
    frontier_cell : (row, column)
        The nearest frontier cell in reach and sight from there.
    cost : float
        Cost of the path [m].
    path : (N, 2) int64
        Cells from the start to ``cell``.
    """

    cell: Cell
    frontier_cell: Cell
    cost: float
    path: NDArray[np.int64]


def default_reach(footprint: Footprint, resolution: float) -> float:
    """Return the default distance of an approach [m]: the body's radius and two cells."""
    return footprint.radius + 2.0 * resolution


def approach(
    clusters: Clusters,
    found: Search,
    log_odds: NDArray[np.int8],
    reach: float,
    thin: NDArray[np.bool_] | None = None,
) -> _Approaches:
    """Return the cheapest approach of a searched body to each cluster.

    It is the cheapest cell from which a frontier cell is in reach and sight, or the cheapest in reach if there is
    none; ties go to the first frontier cell of the cluster, then to the lower row and column. Raises ValueError if
    ``thin`` is not one value per cluster, or another search has used the space since.

    Parameters
    ----------
    log_odds : (rows, columns) int8
        The belief that was searched.
    reach : float
        Maximum distance of an approach [m], between centres of cells.
    thin : (K,) bool, optional
        Whether a thinner body reaches the cluster (``approach(...).reachable`` of a search with a smaller
        radius in another space), to distinguish narrow from blocked paths.
    """
    if thin is not None and len(thin) != len(clusters):
        raise ValueError(f"thin has {len(thin)} values; want one for each of the {len(clusters)} clusters")
    found.cost(found.start)
    space = found.space
    places, left, in_sight = _approach_places(
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
    return _Approaches(places[:, :2].copy(), costs, places[:, 2:].copy(), in_sight, tuple(names))


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
) -> _NearestFrontier | None:
    """Search outwards for a cell with a frontier cell in reach and sight; None if no frontier can be reached.

    Parameters
    ----------
    reach : float, optional
        Maximum distance [m]; by default the radius and two cells.
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
    return _NearestFrontier(
        (row, column), (int(seen_row), int(seen_column)), found.cost((row, column)), found.path((row, column))
    )


@kernel
def _approach_places(
    cells: NDArray[np.int64],
    starts: NDArray[np.int64],
    log_odds: NDArray[np.int8],
    remaining: NDArray[np.int32],
    parent: NDArray[np.uint8],
    minimum: int,
    spans: NDArray[np.int64],
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
    """Return the cell, its frontier cell, budget and visibility per cluster (kernel).

    The budget is the remaining one at the cell; visibility is whether the frontier cell is visible from there.
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
                    if left == 0 or left == NO_ENTRY or left < minimum or (in_sight[k] and left <= best[k]):
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
    """Return the nearest visible frontier cell of a cell; ties go to the lowest row and column."""
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


COST_BYTES = 4
"""Bytes of a cost."""


@kernel
def cheapest_views(
    cells: Array, starts: Array, log_odds: Array, swept: SweptCosts, spans: Array
) -> tuple[Array, Array]:
    """Return the cheapest cell that sees each cluster from near, and its cost, by swept costs (kernel).

    Parameters
    ----------
    cells : (N, 2) int64
        Frontier cells (row, column), cluster after cluster.
    starts : (K + 1,) int64
        Start of each cluster.
    log_odds : (rows, columns) int8
        The belief.
    spans : (2 k + 1,) int64
        The disc of cells near a frontier cell, see ``disc_spans``.

    Returns
    -------
    places : (K, 4) int64
        Cell (row, column) and frontier cell (row, column), -1 if no cell sees the cluster. Ties go to the
        first frontier cell, then to the lowest row and column.
    costs : (K,) int64
        Cost of the path there [units]; ``FAR`` if no cell sees the cluster.
    """
    count = len(starts) - 1
    places, costs = np.full((count, 4), -1, np.int64), np.full(count, FAR, np.int64)
    for k in range(count):
        for i in range(starts[k], starts[k + 1]):
            costs[k] = _cheapest_view(cells, i, log_odds, swept, spans, costs[k], places, k)
    return places, costs


@kernel(nrt=False)
def _cheapest_view(
    cells: Array, i: int, log_odds: Array, swept: SweptCosts, spans: Array, lowest: int, places: Array, k: int
) -> int:
    """Search a cheaper cell near frontier cell ``i``; return the lowest cost.

    The cell and the frontier cell are written to row ``k`` of ``places``.
    """
    row, column = cells[i, 0], cells[i, 1]
    reach, width = len(spans) // 2, swept.costs.shape[1]
    row_low, column_low = swept.row_low, swept.column_low
    row_end, column_end = row_low + swept.costs.shape[0] - 2, column_low + width - 2 * LANES
    origin = swept.costs.ctypes.data + COST_BYTES * (LANES - column_low - (row_low - 1) * width)
    for at_row in range(max(row - reach, row_low), min(row + reach + 1, row_end)):
        span = spans[at_row - row + reach]
        first, end = max(column - span, column_low), min(column + span + 1, column_end)
        while first < end:
            cheaper = cheaper_cells(origin + COST_BYTES * (at_row * width + first), lowest)
            if end - first < LANES:
                cheaper &= (1 << (end - first)) - 1
            while cheaper != 0:
                at_column = first + first_bit(np.uint64(cheaper))
                cheaper &= cheaper - 1
                cost = swept.costs[at_row - row_low + 1, at_column - column_low + LANES]
                if cost < lowest and line_is_open(log_odds, at_row, at_column, row, column):
                    lowest = cost
                    places[k, 0], places[k, 1], places[k, 2], places[k, 3] = at_row, at_column, row, column
            first += LANES
    return lowest
