"""The footprint of a round body: the cost of its steps on a grid, and the cells that it covers."""

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.planning.clearance import limit_of
from lidarium.mapping.planning.search.search_state import DIAGONAL, STRAIGHT, Passage


@dataclass(frozen=True, slots=True)
class Footprint:
    """Clearance that a round body needs and prefers.

    Raises ValueError if ``radius`` is negative, ``preferred`` below it, or ``penalty`` outside [0, 1000].

    Attributes
    ----------
    radius : float
        Minimum clearance [m].
    preferred : float
        Clearance [m] from which on a step costs no more than on open floor.
    penalty : float
        Extra cost of a step at the minimum clearance, in multiples of its length; it falls off with the
        square towards ``preferred``.
    """

    radius: float = 0.18
    preferred: float = 0.33
    penalty: float = 3.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.radius <= self.preferred:
            raise ValueError(
                f"radius is {self.radius} m and preferred clearance {self.preferred} m; want 0 <= radius <= preferred"
            )
        if not 0.0 <= self.penalty <= 1000.0:
            raise ValueError(f"penalty is {self.penalty}; want 0 to 1000 times the length of a step")


@lru_cache(maxsize=64)
def passage_of(footprint: Footprint, resolution: float, limit: int) -> Passage:
    """Return how a body passes over a grid of cells of ``resolution`` [m].

    The grid's clearance field has this ``limit``. Raises ValueError if the footprint needs more clearance than the
    field's maximum.
    """
    minimum = limit_of(footprint.radius, resolution)
    if limit_of(footprint.preferred, resolution) > limit:
        raise ValueError(f"preferred clearance {footprint.preferred} m is beyond the maximum of the clearance field")
    squared = limit - np.arange(limit + 1)
    clearance = np.sqrt(squared) * 0.5 * resolution
    room = max(footprint.preferred - footprint.radius, 1e-9)
    shortfall = np.clip((footprint.preferred - clearance) / room, 0.0, 1.0)
    factors = 1.0 + footprint.penalty * shortfall**2
    costs = np.rint(np.array([[STRAIGHT / 2], [DIAGONAL / 2]]) * factors).astype(np.int32)
    costs[:, squared < max(minimum, 1)] = 0
    costs.flags.writeable = False
    return Passage(limit, costs, limit - minimum - 2, footprint.radius / resolution, footprint.preferred / resolution)


MARGIN_M = 0.15
"""Margin around a body within which other robots may have mapped it [m]."""

_SUBCELL = 4
_CELL = 1 << _SUBCELL


def footprint_mask(
    shape: tuple[int, int],
    origin: tuple[float, float],
    trail: NDArray[np.float64],
    radius: float,
    resolution: float,
    margin_m: float = MARGIN_M,
) -> NDArray[np.bool_]:
    """Return the cells, (rows, columns) bool, in which others may have mapped a driving body.

    Parameters
    ----------
    shape : (rows, columns)
        Of the grid.
    origin : (x, y)
        Lower left corner of cell (0, 0) [m].
    trail : (N, 2) float64
        Positions of the body [m].
    radius : float
        Of the body [m].
    resolution : float
        Side of a cell [m].
    margin_m : float
        Margin around the body that counts as its image [m].
    """
    covered = np.zeros(shape, np.uint8)
    if len(trail):
        thickness = max(round(2.0 * (radius + margin_m) / resolution), 1)
        # A single place is a line from there to there: of one point nothing is drawn.
        line = trail if len(trail) > 1 else np.repeat(trail, 2, axis=0)
        cv2.polylines(
            covered,
            [_pixels(line, origin, resolution).reshape(-1, 1, 2)],
            False,
            1,
            thickness,
            cv2.LINE_8,
            _SUBCELL,
        )
    return np.asarray(covered != 0)


def passed(
    shape: tuple[int, int],
    origin: tuple[float, float],
    trail: NDArray[np.float64],
    radius: float,
    resolution: float,
) -> NDArray[np.bool_]:
    """Return the cells of the body's own footprint along its trail, if there can be no wall.

    Cells so near to the trail's end that they may show the standing body are excluded.
    """
    covered = footprint_mask(shape, origin, trail, radius, resolution, 0.0).astype(np.uint8)
    if len(trail):
        stand = _pixels(trail[-1:], origin, resolution)[0].tolist()
        cv2.circle(
            covered,
            stand,
            round((radius + MARGIN_M) / resolution * _CELL),
            0,
            cv2.FILLED,
            cv2.LINE_8,
            _SUBCELL,
        )
    return np.asarray(covered != 0)


def _pixels(points: NDArray[np.float64], origin: tuple[float, float], resolution: float) -> NDArray[np.int32]:
    """Return points [m] as OpenCV's pixels in parts of a cell, which are addressed by their centres."""
    return np.rint(((points - origin) / resolution - 0.5) * _CELL).astype(np.int32)
