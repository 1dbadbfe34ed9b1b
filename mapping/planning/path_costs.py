"""Costs of the cheapest paths between cells of a map that changes, kept as long as they hold.

A path stays within an ellipse around its ends: through a cell outside it the path would cost more than it does, even
on open floor. So its cost holds until something changes within the ellipse.
"""

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.planning.clearance import ClearanceField
from lidarium.mapping.planning.footprint import Footprint, passage_of
from lidarium.mapping.planning.grid_planning import Cell, Until, search
from lidarium.mapping.planning.search.path_search import SearchSpace
from lidarium.mapping.planning.search.search_state import DIAGONAL, STRAIGHT, TILE_SHIFT, Passage, Targets

_MOST_KEPT = 4096
"""Maximum number of costs that are kept, the latest ones."""

_CLOSED = 2**16 - 1
"""Kind of a cell that is not known free."""

_MISSING = -1.0
"""Mark of a cost that is not known."""


class PathCosts:
    """Costs of the cheapest paths of one body between cells of a map.

    Parameters
    ----------
    space : SearchSpace
        Scratch memory of the searches over the map.
    log_odds : (rows, columns) int8
        The map, as :func:`search` takes it; its owner may write it between calls.
    clearance : ClearanceField
        Its clearance.
    footprint : Footprint
        The body.
    """

    def __init__(
        self, space: SearchSpace, log_odds: NDArray[np.int8], clearance: ClearanceField, footprint: Footprint
    ) -> None:
        self._space, self._log_odds, self._clearance, self._footprint = space, log_odds, clearance, footprint
        self._kinds = _kinds_of(passage_of(footprint, space.resolution, clearance.limit))
        self._seen = np.full(log_odds.shape, _CLOSED, np.uint16)
        # Ends (row, column, row, column) of paths, and what these cost [m].
        self._ends, self._costs = np.empty((0, 4), np.int64), np.empty(0)

    def between(self, cells: list[Cell], bounds: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the costs of the paths between cells, symmetric, (n, n) [m].

        It forgets the last search in the space.

        Parameters
        ----------
        cells : list of (row, column)
            Cells that the body can reach, n in number.
        bounds : (n,) float64
            No cost is larger than the sum of the bounds of both cells [m].
        """
        changed = _changed(self._seen, self._log_odds, self._clearance.closeness, self._kinds)
        holds = _hold(self._ends, self._costs, changed, self._space.resolution / STRAIGHT)
        self._ends, self._costs = self._ends[holds][-_MOST_KEPT:], self._costs[holds][-_MOST_KEPT:]
        places = np.array(cells, np.int64).reshape(-1, 2)
        costs = _known_costs(places, self._ends, self._costs)
        while (missing := costs == _MISSING).any():
            k = int(missing.sum(axis=1).argmax())  # one search from here finds most of them
            others = np.flatnonzero(missing[k])
            found = self._search(cells[k], [cells[other] for other in others], bounds[k] + bounds[others].max())
            costs[k, others] = costs[others, k] = found
            is_found = np.isfinite(found)
            ends = np.hstack([np.broadcast_to(places[k], (len(others), 2)), places[others]])
            self._ends = np.concatenate([self._ends, ends[is_found]])
            self._costs = np.concatenate([self._costs, found[is_found]])
        largest = bounds[:, None] + bounds[None]
        np.fill_diagonal(largest, 0.0)
        return np.asarray(np.minimum(costs, largest))

    def _search(self, start: Cell, ends: list[Cell], maximum_cost: float) -> NDArray[np.float64]:
        """Return the costs of the paths from a cell to others [m], ``inf`` beyond a maximum."""
        targets = Targets.at(ends, self._log_odds.shape)
        until = Until(targets=targets, count=len(set(ends)), maximum_cost=maximum_cost)
        found = search(self._space, self._log_odds, self._clearance, start, self._footprint, until=until)
        return np.array([found.cost(end) for end in ends])


def _kinds_of(passage: Passage) -> NDArray[np.uint16]:
    """Return what searches tell apart about free cells, by closeness: 0 for all that are as good as open floor."""
    kinds = np.arange(passage.limit + 1, dtype=np.uint16)
    is_narrow = (passage.half_costs != passage.half_costs[:, :1]).any(axis=0) | (kinds > passage.roomy)
    kinds[: int(is_narrow.argmax()) if is_narrow.any() else len(kinds)] = 0
    return kinds


@kernel
def _changed(seen: Array, log_odds: Array, closeness: Array, kinds: Array) -> NDArray[np.int64]:
    """Write the kinds of all cells to ``seen``, and return boxes around those that changed (kernel).

    Returns
    -------
    (n, 4) int64
        Lowest and highest row and column of a box; one for each tile with a change.
    """
    rows, columns = seen.shape
    side = 1 << TILE_SHIFT
    boxes = np.empty((((rows - 1) // side + 1) * ((columns - 1) // side + 1), 4), np.int64)
    count = 0
    for top in range(0, rows, side):
        for left in range(0, columns, side):
            bottom, right = min(top + side, rows), min(left + side, columns)
            box = (rows, -1, columns, -1)
            for row in range(top, bottom):
                for column in range(left, right):
                    kind = kinds[closeness[row, column]] if log_odds[row, column] < 0 else _CLOSED
                    if kind != seen[row, column]:
                        seen[row, column] = kind
                        box = (min(box[0], row), row, min(box[2], column), max(box[3], column))
            if box[1] >= 0:
                boxes[count, 0], boxes[count, 1], boxes[count, 2], boxes[count, 3] = box
                count += 1
    return boxes[:count]


@kernel
def _hold(ends: Array, costs: Array, boxes: Array, unit: float) -> NDArray[np.bool_]:
    """Whether no box touches the ellipse of each path (kernel).

    A diagonal step depends on the cells next to it, so each box counts with its neighbours.
    """
    holds = np.ones(len(ends), np.bool_)
    for k in range(len(ends)):
        for box in boxes:
            least = 0
            for row, column in ((ends[k, 0], ends[k, 1]), (ends[k, 2], ends[k, 3])):
                rise = max(box[0] - 1 - row, row - box[1] - 1, 0)
                run = max(box[2] - 1 - column, column - box[3] - 1, 0)
                least += STRAIGHT * max(rise, run) + (DIAGONAL - STRAIGHT) * min(rise, run)
            if least * unit <= costs[k]:
                holds[k] = False
                break
    return holds


@kernel
def _known_costs(places: Array, ends: Array, costs: Array) -> NDArray[np.float64]:
    """Return the known costs between places (n, 2), shape (n, n), and ``_MISSING`` for the others (kernel)."""
    count = len(places)
    table = np.full((count, count), _MISSING)
    for i in range(count):
        for j in range(count):
            if places[i, 0] == places[j, 0] and places[i, 1] == places[j, 1]:
                table[i, j] = 0.0
    for k in range(len(ends)):
        for i in range(count):
            if places[i, 0] != ends[k, 0] or places[i, 1] != ends[k, 1]:
                continue
            for j in range(count):
                if places[j, 0] == ends[k, 2] and places[j, 1] == ends[k, 3]:
                    table[i, j] = table[j, i] = costs[k]
    return table
