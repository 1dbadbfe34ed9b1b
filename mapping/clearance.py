"""How far each cell is from the nearest occupied one, exact to the cell and kept up to date window by window.

Clearance is the distance from the centre of a cell to the nearest occupied cell's square, so that a disc of radius r
centred there touches nothing exactly where the clearance is at least r. In half cells the squared distance to the cell
``(i, j)`` steps away is the integer ``max(2|i| - 1, 0)^2 + max(2|j| - 1, 0)^2``: comparisons need no tolerance.

What is stored is *closeness*, ``limit - squared distance``, and 0 at and beyond the largest distance that matters:
memory is touched only near what is occupied, and the cell that is itself occupied is the one with closeness ``limit``.
The distance transform is separable (Felzenszwalb and Huttenlocher, Distance transforms of sampled functions, Theory
of Computing 8, 2012); with a small largest distance the plain minimum along rows beats the lower envelope.
"""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels import kernel

Window = tuple[int, int, int, int]

LARGEST_LIMIT = 32_767  # twice the limit must fit into 16 bits
STAMPS_PER_CELL = 1.0 / 150.0  # stamping one disc costs about as much as recomputing 150 cells


def limit_of(distance: float, resolution: float) -> int:
    """Least squared distance in half cells that is no less than ``distance`` [m], at ``resolution`` [m/cell]."""
    return math.ceil((2.0 * distance / resolution) ** 2 - 1e-6)


def full_window(shape: tuple[int, ...]) -> Window:
    """Return the window (row_low, row_high, column_low, column_high) of a whole grid, high ends excluded."""
    return 0, int(shape[0]), 0, int(shape[1])


def grown_window(window: Window, margin: int, shape: tuple[int, ...]) -> Window:
    """Grow a window by ``margin`` cells on each side, clipped to the grid."""
    row_low, row_high, column_low, column_high = window
    return (
        max(int(row_low) - margin, 0),
        min(int(row_high) + margin, int(shape[0])),
        max(int(column_low) - margin, 0),
        min(int(column_high) + margin, int(shape[1])),
    )


def clearance(occupied: NDArray[np.bool_], resolution: float, maximum: float = 0.6) -> NDArray[np.float32]:
    """Distance from each cell's centre to the nearest occupied cell's square, over a whole grid.

    Parameters
    ----------
    occupied : (rows, columns) bool
        Where a body must not touch.
    resolution : float
        Side of a cell [m].
    maximum : float
        Largest distance that matters [m]; what is farther reads ``maximum``.

    Returns
    -------
    (rows, columns) float32
        Clearance [m], 0 in occupied cells.

    Raises
    ------
    ValueError
        If ``occupied`` is not a grid, or ``maximum`` is below half a cell or above 90 cells.
    """
    occupied = np.asarray(occupied)
    if occupied.ndim != 2:
        raise ValueError(f"occupied has shape {occupied.shape}; want a grid (rows, columns)")
    field = ClearanceField((occupied.shape[0], occupied.shape[1]), resolution, maximum)
    field.update(np.ascontiguousarray(occupied, dtype=np.int8))
    return field.metres()


class ClearanceField:
    """Clearance kept beside a belief.

    Attributes
    ----------
    closeness : (rows, columns) uint16
        ``limit`` minus the squared distance in half cells to the nearest occupied square; 0 = at ``maximum`` or beyond.
    limit : int
        Squared ``maximum`` in half cells, rounded up.
    resolution, maximum : float
        Side of a cell and the largest distance that matters [m].

    Raises
    ------
    ValueError
        If ``resolution`` is not positive, or ``maximum`` is below half a cell or above 90 cells.
    """

    def __init__(self, shape: tuple[int, int], resolution: float, maximum: float = 0.6) -> None:
        if not resolution > 0.0:
            raise ValueError(f"resolution is {resolution} m; want a positive side of a cell")
        limit = limit_of(maximum, resolution) if math.isfinite(maximum) and maximum > 0.0 else 0
        if not 1 <= limit <= LARGEST_LIMIT:
            raise ValueError(f"maximum is {maximum} m; want {0.5 * resolution} to {90 * resolution} m at cells of {resolution} m")
        self.resolution = float(resolution)
        self.maximum = float(maximum)
        self.limit = limit
        self.closeness: NDArray[np.uint16] = np.zeros(shape, dtype=np.uint16)
        self._stamp = _stamp_of(limit)

    @property
    def reach(self) -> int:
        """Cells, along a row or a column, over which an occupied cell is felt."""
        return int(self._stamp.shape[0]) // 2

    def update(self, log_odds: NDArray[np.int8], window: Window | None = None) -> bool:
        """Take over what became occupied, or ceased to be, inside a window of the belief.

        Parameters
        ----------
        log_odds : (rows, columns) int8
            The belief; > 0 is occupied. C-contiguous.
        window : (row_low, row_high, column_low, column_high), optional
            Cells that may have changed since the last call, high ends excluded; all cells by default.

        Returns
        -------
        bool
            Whether any clearance changed.

        Raises
        ------
        ValueError
            If the belief's shape is not that of the field.
        """
        if log_odds.shape != self.closeness.shape:
            raise ValueError(f"log_odds has shape {log_odds.shape}; this field was made for {self.closeness.shape}")
        inside = grown_window(full_window(log_odds.shape) if window is None else window, 0, log_odds.shape)
        added, removed, *bounds = _changes(log_odds, self.closeness, self.limit, inside)
        if added + removed == 0:
            return False
        box = (bounds[0], bounds[1], bounds[2], bounds[3])
        target = grown_window(box, self.reach, log_odds.shape)
        area = (target[1] - target[0]) * (target[3] - target[2])
        if removed == 0 and added <= STAMPS_PER_CELL * area:
            _stamp_new(log_odds, self.closeness, self.limit, self._stamp, box)
        else:
            _recompute(log_odds, self.closeness, self.limit, self.reach, target, grown_window(target, self.reach, log_odds.shape))
        return True

    def metres(self, window: Window | None = None) -> NDArray[np.float32]:
        """Clearance [m] of the cells of a window (all by default), capped at ``maximum``; a new float32 array."""
        row_low, row_high, column_low, column_high = full_window(self.closeness.shape) if window is None else window
        squared = self.limit - self.closeness[row_low:row_high, column_low:column_high].astype(np.float64)
        return np.minimum(np.sqrt(squared) * (0.5 * self.resolution), self.maximum).astype(np.float32)

    def at(self, cell: tuple[int, int]) -> float:
        """Clearance [m] of one cell (row, column), capped at ``maximum``."""
        return min(math.sqrt(self.limit - int(self.closeness[cell])) * 0.5 * self.resolution, self.maximum)


@lru_cache(maxsize=16)
def _stamp_of(limit: int) -> NDArray[np.uint16]:
    """Return the closeness around one occupied cell."""
    reach = 0
    while (2 * reach + 1) ** 2 < limit:
        reach += 1
    steps = np.maximum(2 * np.abs(np.arange(-reach, reach + 1)) - 1, 0) ** 2
    stamp: NDArray[np.uint16] = np.maximum(limit - (steps[:, None] + steps[None, :]), 0).astype(np.uint16)
    stamp.flags.writeable = False
    return stamp


@kernel
def _changes(log_odds: NDArray[np.int8], closeness: NDArray[np.uint16], limit: int, window: Window) -> tuple[int, int, int, int, int, int]:
    """Count cells that became occupied or free, and bound them by a box."""
    row_low, row_high, column_low, column_high = window
    added = 0
    removed = 0
    first_row, last_row = row_high, row_low
    first_column, last_column = column_high, column_low
    for row in range(row_low, row_high):
        beliefs = log_odds[row, column_low:column_high]
        known = closeness[row, column_low:column_high]
        differing = 0
        for i in range(beliefs.size):
            differing += (beliefs[i] > 0) != (known[i] == limit)
        if differing == 0:
            continue
        first_row = min(first_row, row)
        last_row = row + 1
        for i in range(beliefs.size):
            is_occupied = beliefs[i] > 0
            if is_occupied != (known[i] == limit):
                added += is_occupied
                removed += not is_occupied
                first_column = min(first_column, column_low + i)
                last_column = max(last_column, column_low + i + 1)
    return added, removed, first_row, last_row, first_column, last_column


@kernel
def _stamp_new(log_odds: NDArray[np.int8], closeness: NDArray[np.uint16], limit: int, stamp: NDArray[np.uint16], box: Window) -> None:
    """Raise the closeness around each newly occupied cell of the box."""
    rows, columns = log_odds.shape
    reach = stamp.shape[0] // 2
    row_low, row_high, column_low, column_high = box
    for row in range(row_low, row_high):
        for column in range(column_low, column_high):
            if log_odds[row, column] <= 0 or closeness[row, column] == limit:
                continue
            left = max(column - reach, 0)
            right = min(column + reach + 1, columns)
            shift = left - (column - reach)
            for other in range(max(row - reach, 0), min(row + reach + 1, rows)):
                target = closeness[other, left:right]
                source = stamp[other - row + reach, shift : shift + right - left]
                for i in range(target.size):
                    target[i] = max(target[i], source[i])


@kernel
def _recompute(log_odds: NDArray[np.int8], closeness: NDArray[np.uint16], limit: int, reach: int, target: Window, source: Window) -> None:
    """Compute the closeness of the target window from all occupied cells of the source window."""
    row_low, row_high, column_low, column_high = target
    source_low, source_high, left, right = source
    width = right - left
    far = np.uint16(reach + 1)
    one = np.uint16(1)
    steps = np.full(width, far, np.uint16)  # rows up to the last occupied cell of each column, first from below, then from above
    vertical = np.empty((row_high - row_low, width), np.uint16)
    for row in range(source_low, row_high):
        beliefs = log_odds[row, left:right]
        for i in range(width):
            steps[i] = np.uint16(0) if beliefs[i] > 0 else min(np.uint16(steps[i] + one), far)
        if row >= row_low:
            vertical[row - row_low, :] = steps
    steps[:] = far
    best = np.empty(column_high - column_low, np.uint16)
    cap = np.uint16(limit)
    for row in range(source_high - 1, row_low - 1, -1):
        beliefs = log_odds[row, left:right]
        for i in range(width):
            steps[i] = np.uint16(0) if beliefs[i] > 0 else min(np.uint16(steps[i] + one), far)
        if row >= row_high:
            continue
        squares = vertical[row - row_low]
        least = cap
        for i in range(width):
            nearest = min(squares[i], steps[i])
            half_cells = np.uint16(2 * nearest - 1) if nearest > 0 else np.uint16(0)
            squares[i] = min(np.uint16(half_cells * half_cells), cap) if nearest < far else cap
            least = min(least, squares[i])
        result = closeness[row, column_low:column_high]
        if least == cap:
            result[:] = 0
            continue
        best[:] = cap
        for offset in range(-reach, reach + 1):
            half = max(2 * abs(offset) - 1, 0)
            square = np.uint16(half * half)
            if square + least >= cap:
                continue
            low = max(column_low + offset, left) - offset - column_low  # first cell whose neighbour lies inside the source
            high = max(min(column_high + offset, right) - offset - column_low, 0)
            low = min(low, high)
            nearer = squares[column_low + low + offset - left : column_low + high + offset - left]
            target_row = best[low:high]
            for i in range(target_row.size):
                target_row[i] = min(target_row[i], np.uint16(nearer[i] + square))
        for i in range(best.size):
            result[i] = np.uint16(cap - best[i])
