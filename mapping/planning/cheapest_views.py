"""The cheapest places from which clusters of frontier cells are seen, on costs that were swept."""

import numpy as np

from lidarium.mapping.grids.grid_lines import line_is_open
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.simd.costs import FAR, LANES, cheaper_cells
from lidarium.mapping.kernels.simd.words import first_bit
from lidarium.mapping.planning.search.swept_costs import SweptCosts

COST_BYTES = 4
"""Bytes of a cost."""


@kernel
def cheapest_views(
    cells: Array, starts: Array, log_odds: Array, swept: SweptCosts, spans: Array
) -> tuple[Array, Array]:
    """Return per cluster the cheapest place that sees one of its cells from near, and its cost (kernel).

    Parameters
    ----------
    cells : (N, 2) int64
        Frontier cells (row, column), cluster after cluster.
    starts : (K + 1,) int64
        Where each cluster begins.
    log_odds : (rows, columns) int8
        The belief.
    swept : SweptCosts
        Costs of the paths on it.
    spans : (2 k + 1,) int64
        The disc within which a place is near enough to a frontier cell, see ``disc_spans``.

    Returns
    -------
    places : (K, 4) int64
        Place (row, column) and frontier cell (row, column), -1 where no place sees the cluster. Of equals
        that of the first frontier cell, then of the lowest row and column.
    costs : (K,) int64
        Cost of the path there [units]; ``FAR`` where no place sees the cluster.
    """
    count = len(starts) - 1
    places, costs = np.full((count, 4), -1, np.int64), np.full(count, FAR, np.int64)
    for k in range(count):
        for i in range(starts[k], starts[k + 1]):
            costs[k] = _cheapest_view(cells[i], log_odds, swept, spans, costs[k], places[k])
    return places, costs


@kernel(nrt=False)
def _cheapest_view(
    cell: Array, log_odds: Array, swept: SweptCosts, spans: Array, lowest: int, place: Array
) -> int:
    """Look for a place near a frontier cell that costs less; return the lowest cost.

    The place and the cell are written to ``place`` (4,).
    """
    row, column = cell
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
                    place[0], place[1], place[2], place[3] = at_row, at_column, row, column
            first += LANES
    return lowest
