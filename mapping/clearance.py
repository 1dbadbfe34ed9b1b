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

from lidarium.mapping.kernels import Array, kernel

Window = tuple[int, int, int, int]

LARGEST_LIMIT = 32_767  # twice the limit must fit into 16 bits
STAMPS_PER_CELL = 1.0 / 100.0  # stamping one disc costs about as much as recomputing 100 cells
MOST_BOXES = 16
NEAR_BOX = 6  # cells that ceased to be occupied within this many cells of each other are recomputed together


def limit_of(distance: float, resolution: float) -> int:
    """Least squared distance in half cells that is no less than ``distance`` [m], at ``resolution`` [m/cell]."""
    return math.ceil((2.0 * distance / resolution) ** 2 - 1e-6)


def full_window(shape: tuple[int, ...]) -> Window:
    """Return the window (row_low, row_high, column_low, column_high) of a whole grid, high ends excluded."""
    return 0, int(shape[0]), 0, int(shape[1])


@kernel
def grown_window(window: Window, margin: int, shape: tuple[int, int]) -> Window:
    """Grow a window by ``margin`` cells on each side, clipped to the grid (kernel)."""
    row_low, row_high, column_low, column_high = window
    return max(row_low - margin, 0), min(row_high + margin, shape[0]), max(column_low - margin, 0), min(column_high + margin, shape[1])


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

    @property
    def stamp(self) -> NDArray[np.uint16]:
        """Closeness around one occupied cell, (2 k + 1, 2 k + 1) uint16, read-only and shared."""
        return stamp_of(self.limit)

    @property
    def reach(self) -> int:
        """Cells, along a row or a column, over which an occupied cell is felt."""
        return int(self.stamp.shape[0]) // 2

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
        row_low, row_high, column_low, column_high = full_window(log_odds.shape) if window is None else window
        inside = (int(row_low), int(row_high), int(column_low), int(column_high))
        return bool(update_closeness(log_odds, self.closeness, self.limit, self.stamp, inside))

    def metres(self, window: Window | None = None) -> NDArray[np.float32]:
        """Clearance [m] of the cells of a window (all by default), capped at ``maximum``; a new float32 array."""
        row_low, row_high, column_low, column_high = full_window(self.closeness.shape) if window is None else window
        squared = self.limit - self.closeness[row_low:row_high, column_low:column_high].astype(np.float64)
        return np.minimum(np.sqrt(squared) * (0.5 * self.resolution), self.maximum).astype(np.float32)

    def at(self, cell: tuple[int, int]) -> float:
        """Clearance [m] of one cell (row, column), capped at ``maximum``."""
        return min(math.sqrt(self.limit - int(self.closeness[cell])) * 0.5 * self.resolution, self.maximum)


@lru_cache(maxsize=16)
def stamp_of(limit: int) -> NDArray[np.uint16]:
    """Return the closeness around one occupied cell."""
    reach = 0
    while (2 * reach + 1) ** 2 < limit:
        reach += 1
    steps = np.maximum(2 * np.abs(np.arange(-reach, reach + 1)) - 1, 0) ** 2
    stamp: NDArray[np.uint16] = np.maximum(limit - (steps[:, None] + steps[None, :]), 0).astype(np.uint16)
    stamp.flags.writeable = False
    return stamp


@kernel
def update_closeness(log_odds: Array, closeness: Array, limit: int, stamp: Array, window: Window) -> bool:
    """Bring closeness up to date where cells of a window became occupied or ceased to be; whether any did (kernel).

    Parameters are those of :class:`ClearanceField` and its ``update``.
    """
    reach = stamp.shape[0] // 2
    changed, added = _changed_cells(log_odds, closeness, limit, grown_window(window, 0, log_odds.shape))
    count = len(changed)
    if count == 0:
        return False
    target = grown_window(_box_of(log_odds, changed), reach, log_odds.shape)
    if added > STAMPS_PER_CELL * (target[1] - target[0]) * (target[3] - target[2]):
        _recompute(log_odds, closeness, limit, reach, target, grown_window(target, reach, log_odds.shape))
        return True
    if added < count:
        boxes = _boxes_of_freed(log_odds, changed)
        for k in range(len(boxes)):
            target = grown_window((boxes[k, 0], boxes[k, 1], boxes[k, 2], boxes[k, 3]), reach, log_odds.shape)
            _recompute(log_odds, closeness, limit, reach, target, grown_window(target, reach, log_odds.shape))
    for k in range(count):
        if log_odds[changed[k, 0], changed[k, 1]] > 0:
            _stamp_at(closeness, stamp, changed[k, 0], changed[k, 1])
    return True


@kernel
def _changed_cells(log_odds: Array, closeness: Array, limit: int, window: Window) -> tuple[Array, int]:
    """List the cells (row, column) that became occupied or free, and count those that became occupied."""
    row_low, row_high, column_low, column_high = window
    changed = np.empty((64, 2), np.int64)
    count = 0
    added = 0
    for row in range(row_low, row_high):
        beliefs = log_odds[row, column_low:column_high]
        known = closeness[row, column_low:column_high]
        differing = 0
        for i in range(beliefs.size):
            differing += (beliefs[i] > 0) != (known[i] == limit)
        if differing == 0:
            continue
        if count + differing > len(changed):
            longer = np.empty((2 * (count + differing), 2), np.int64)
            longer[:count] = changed[:count]
            changed = longer
        for i in range(beliefs.size):
            is_occupied = beliefs[i] > 0
            if is_occupied != (known[i] == limit):
                changed[count, 0], changed[count, 1] = row, column_low + i
                count += 1
                added += is_occupied
    return changed[:count], added


@kernel
def _box_of(log_odds: Array, cells: Array) -> Window:
    """Bound cells by a window."""
    row_low, row_high, column_low, column_high = log_odds.shape[0], 0, log_odds.shape[1], 0
    for k in range(len(cells)):
        row_low, row_high = min(row_low, cells[k, 0]), max(row_high, cells[k, 0] + 1)
        column_low, column_high = min(column_low, cells[k, 1]), max(column_high, cells[k, 1] + 1)
    return row_low, row_high, column_low, column_high


@kernel
def _boxes_of_freed(log_odds: Array, changed: Array) -> Array:
    """Bound the cells that ceased to be occupied by a few windows, those near each other by the same one."""
    boxes = np.empty((MOST_BOXES, 4), np.int64)
    count = 0
    for k in range(len(changed)):
        row, column = changed[k, 0], changed[k, 1]
        if log_odds[row, column] > 0:
            continue
        chosen = -1
        for box in range(count):
            is_near_row = boxes[box, 0] - NEAR_BOX <= row < boxes[box, 1] + NEAR_BOX
            if is_near_row and boxes[box, 2] - NEAR_BOX <= column < boxes[box, 3] + NEAR_BOX:
                chosen = box
                break
        if chosen < 0 and count < MOST_BOXES:
            boxes[count, 0], boxes[count, 1], boxes[count, 2], boxes[count, 3] = row, row + 1, column, column + 1
            count += 1
            continue
        chosen = max(chosen, 0)
        boxes[chosen, 0], boxes[chosen, 1] = min(boxes[chosen, 0], row), max(boxes[chosen, 1], row + 1)
        boxes[chosen, 2], boxes[chosen, 3] = min(boxes[chosen, 2], column), max(boxes[chosen, 3], column + 1)
    return boxes[:count]


@kernel
def _stamp_at(closeness: Array, stamp: Array, row: int, column: int) -> None:
    """Raise the closeness around an occupied cell."""
    rows, columns = closeness.shape
    reach = stamp.shape[0] // 2
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
