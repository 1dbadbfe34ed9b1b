"""Maps in coarser cells."""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.grids.occupancy import FREE, OCCUPIED, UNKNOWN


def resampled(levels: NDArray[np.uint8], resolution: float, wanted: float) -> NDArray[np.uint8]:
    """Return a map in coarser cells.

    A cell with an occupied one in it is occupied, else free where most known ones are.

    Parameters
    ----------
    levels : (rows, columns) uint8
        The three-level map.
    resolution, wanted : float
        Its side of a cell and the new one, not smaller [m].

    Returns
    -------
    (rows, columns) uint8
        The map from the same corner; the last cells may reach beyond it.
    """
    if math.isclose(resolution, wanted, rel_tol=1e-6):
        return levels
    ratio = resolution / wanted
    rows, columns = (math.ceil(side * ratio - 1e-9) for side in levels.shape)
    row, column = (
        np.minimum(((np.arange(side) + 0.5) * ratio).astype(np.int64), count - 1)
        for side, count in zip(levels.shape, (rows, columns), strict=True)
    )
    place = (row[:, None] * columns + column[None, :]).ravel()
    counts = {
        level: np.bincount(place[(levels == level).ravel()], minlength=rows * columns)
        for level in (OCCUPIED, UNKNOWN, FREE)
    }
    coarse = np.where(counts[FREE] > counts[UNKNOWN], FREE, UNKNOWN)
    return np.where(counts[OCCUPIED] > 0, OCCUPIED, coarse).astype(np.uint8).reshape(rows, columns)
