"""Lines of sight between cells of a belief.

A line runs between the centres of two cells and visits every cell that it crosses, in exact integer
arithmetic, so that it visits the same cells in both directions (Amanatides and Woo, A fast voxel traversal
algorithm, Eurographics 1987). If it passes exactly through a corner, it continues diagonally, and is stopped
only if both cells next to the corner are occupied.
"""

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import kernel


def visible(
    log_odds: NDArray[np.int8],
    from_cell: tuple[int, int],
    cells: NDArray[np.integer],
    maximum_range: float = np.inf,
) -> NDArray[np.bool_]:
    """Return which cells are visible from a cell; unknown cells do not block the line.

    Burgard et al., Coordinated multi-robot exploration, IEEE T-RO 2005, lower with it the utility of the frontier
    cells that a robot will see from its target. Raises ValueError if a cell lies outside the grid.

    Parameters
    ----------
    log_odds : (rows, columns) int8
        The belief; > 0 is occupied.
    from_cell : (row, column)
        The cell from which the line of sight begins.
    cells : (N, 2) int
        Cells (row, column) at the other end; their own state does not matter.

    Returns
    -------
    (N,) bool
        Whether no occupied cell lies strictly between.
    """
    ends = (
        np.ascontiguousarray(cells, dtype=np.int64).reshape(-1, 2)
        if np.size(cells) == 0
        else np.ascontiguousarray(cells, dtype=np.int64)
    )
    if ends.ndim != 2 or ends.shape[1] != 2:
        raise ValueError(f"cells has shape {ends.shape}; want (N, 2) pairs (row, column)")
    row, column = int(from_cell[0]), int(from_cell[1])
    shape = np.array(log_odds.shape)
    if not (0 <= row < shape[0] and 0 <= column < shape[1]) or (ends < 0).any() or (ends >= shape).any():
        raise ValueError(
            f"from_cell {(row, column)} or one of the cells lies outside the grid of {log_odds.shape} cells"
        )
    return np.asarray(_visible(log_odds, row, column, ends, float(maximum_range) ** 2))


@kernel
def _visible(
    log_odds: NDArray[np.int8], row: int, column: int, cells: NDArray[np.int64], squared_range: float
) -> NDArray[np.bool_]:
    seen = np.zeros(len(cells), np.bool_)
    for i in range(len(cells)):
        rise = cells[i, 0] - row
        run = cells[i, 1] - column
        seen[i] = rise * rise + run * run <= squared_range and line_is_open(
            log_odds, row, column, cells[i, 0], cells[i, 1]
        )
    return seen


@kernel(nrt=False)
def line_is_open(log_odds: NDArray[np.int8], row: int, column: int, to_row: int, to_column: int) -> bool:
    """Whether no occupied cell lies strictly between two cells (kernel)."""
    row_step = 1 if to_row > row else -1
    column_step = 1 if to_column > column else -1
    rise = abs(to_row - row)
    run = abs(to_column - column)
    balance = run - rise  # > 0: the side of the cell is crossed before its top
    while row != to_row or column != to_column:
        if balance > 0:
            column += column_step
            balance -= 2 * rise
        elif balance < 0:
            row += row_step
            balance += 2 * run
        else:
            if log_odds[row + row_step, column] > 0 and log_odds[row, column + column_step] > 0:
                return False
            row += row_step
            column += column_step
            balance += 2 * (run - rise)
        if log_odds[row, column] > 0 and (row != to_row or column != to_column):
            return False
    return True


@kernel(nrt=False)
def line_is_free(log_odds: NDArray[np.int8], row: int, column: int, to_row: int, to_column: int) -> bool:
    """Whether all cells from one to another, the last included, are known to be free (kernel)."""
    row_step = 1 if to_row > row else -1
    column_step = 1 if to_column > column else -1
    rise = abs(to_row - row)
    run = abs(to_column - column)
    balance = run - rise
    while row != to_row or column != to_column:
        if balance > 0:
            column += column_step
            balance -= 2 * rise
        elif balance < 0:
            row += row_step
            balance += 2 * run
        else:
            if log_odds[row + row_step, column] >= 0 and log_odds[row, column + column_step] >= 0:
                return False
            row += row_step
            column += column_step
            balance += 2 * (run - rise)
        if log_odds[row, column] >= 0:
            return False
    return True
