"""Distance of each cell from the nearest occupied one.

It is exact to the cell and updated window by window.

Clearance is the distance from the centre of a cell to the nearest occupied cell's square, so that a disc of
radius r centred there touches nothing exactly where the clearance is at least r. In half cells the squared
distance to the cell ``(i, j)`` steps away is the integer ``max(2|i| - 1, 0)^2 + max(2|j| - 1, 0)^2``:
comparisons need no tolerance.

What is stored is *closeness*, ``limit - squared distance``, and 0 at and beyond the largest distance that
matters: memory is touched only near what is occupied, and the cell that is itself occupied is the one with
closeness ``limit``.
"""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.llvm import BLOCK
from lidarium.mapping.planning.clearance_updates import Window, update_closeness

LARGEST_LIMIT = 32_767  # twice the limit must fit into 16 bits


def limit_of(distance: float, resolution: float) -> int:
    """Return the least squared distance that is no less than ``distance`` [m].

    The result is in half cells, at ``resolution`` [m/cell].
    """
    return math.ceil((2.0 * distance / resolution) ** 2 - 1e-6)


def full_window(shape: tuple[int, ...]) -> Window:
    """Return the window of a whole grid, high ends excluded.

    (row_low, row_high, column_low, column_high).
    """
    return 0, int(shape[0]), 0, int(shape[1])


def clearance(occupied: NDArray[np.bool_], resolution: float, maximum: float = 0.6) -> NDArray[np.float32]:
    """Return each cell's distance to the nearest occupied cell, over a whole grid.

    From the cell's centre to the occupied cell's square.

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
        ``limit`` minus the squared distance in half cells to the nearest occupied square; 0 = at ``maximum``
        or beyond.
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
            raise ValueError(
                f"maximum is {maximum} m; want {0.5 * resolution} to {90 * resolution} m at cells of "
                f"{resolution} m"
            )
        self.resolution = float(resolution)
        self.maximum = float(maximum)
        self.limit = limit
        self.closeness: NDArray[np.uint16] = np.zeros(shape, dtype=np.uint16)

    @property
    def stamp(self) -> NDArray[np.uint16]:
        """Closeness around one occupied cell, see ``stamp_of``; read-only and shared."""
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
            raise ValueError(
                f"log_odds has shape {log_odds.shape}; this field was made for {self.closeness.shape}"
            )
        row_low, row_high, column_low, column_high = full_window(log_odds.shape) if window is None else window
        inside = (int(row_low), int(row_high), int(column_low), int(column_high))
        return bool(update_closeness(log_odds, self.closeness, self.limit, self.stamp, inside))

    def metres(self, window: Window | None = None) -> NDArray[np.float32]:
        """Clearance [m] of the cells of a window (all by default), capped at ``maximum``.

        A new float32 array.
        """
        row_low, row_high, column_low, column_high = (
            full_window(self.closeness.shape) if window is None else window
        )
        squared = self.limit - self.closeness[row_low:row_high, column_low:column_high].astype(np.float64)
        return np.minimum(np.sqrt(squared) * (0.5 * self.resolution), self.maximum).astype(np.float32)

    def at(self, cell: tuple[int, int]) -> float:
        """Clearance [m] of one cell (row, column), capped at ``maximum``."""
        return min(math.sqrt(self.limit - int(self.closeness[cell])) * 0.5 * self.resolution, self.maximum)


@lru_cache(maxsize=16)
def stamp_of(limit: int) -> NDArray[np.uint16]:
    """Return the closeness around one occupied cell, up to k cells away.

    Shape (2 k + 1, 2 k + 1 and more), uint16.

    Rows begin with a block of zeros, and end with zeros to whole blocks and one more: 64 lanes from any place
    on are there, and raise nothing beyond the stamp.
    """
    reach = 0
    while (2 * reach + 1) ** 2 < limit:
        reach += 1
    steps = np.maximum(2 * np.abs(np.arange(-reach, reach + 1)) - 1, 0) ** 2
    stamp: NDArray[np.uint16] = np.zeros((len(steps), (-(-len(steps) // BLOCK) + 2) * BLOCK), np.uint16)
    stamp[:, BLOCK : BLOCK + len(steps)] = np.maximum(limit - (steps[:, None] + steps[None, :]), 0)
    stamp.flags.writeable = False
    return stamp
