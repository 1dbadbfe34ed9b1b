"""What a robot may expect to see at a place: the unknown area in its view, as if nothing stood in it."""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel

RAYS = 64
"""Rays by which a view is measured."""


def ray_directions() -> NDArray[np.float64]:
    """Return the directions of the rays, (RAYS, 2): their share of a cell along rows and along columns."""
    angles = (np.arange(RAYS) + 0.5) * (2.0 * math.pi / RAYS)
    return np.stack([np.sin(angles), np.cos(angles)], axis=1)


@kernel
def expected_gain(log_odds: Array, row: int, column: int, rays: Array, reach: int) -> float:
    """Return the unknown area in view of a cell [cells], by rays that end at occupied cells.

    Parameters
    ----------
    log_odds : (rows, columns) int8
        The map: 0 unknown, above 0 occupied.
    row, column : int
        The cell to look from.
    rays : (rays, 2) float64
        See `ray_directions`.
    reach : int
        How far the rays go [cells].
    """
    rows, columns = log_odds.shape
    area = 0.0
    for ray in range(rays.shape[0]):
        along_rows, along_columns = rays[ray, 0], rays[ray, 1]
        for step in range(1, reach + 1):
            at_row = int(math.floor(row + 0.5 + step * along_rows))
            at_column = int(math.floor(column + 0.5 + step * along_columns))
            if not (0 <= at_row < rows and 0 <= at_column < columns):
                break
            level = log_odds[at_row, at_column]
            if level > 0:
                break
            if level == 0:
                area += step
    return float(area * (2.0 * math.pi / rays.shape[0]))
