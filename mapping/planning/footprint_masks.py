"""What a body covers of a grid while it drives along a trail."""


import cv2
import numpy as np
from numpy.typing import NDArray

MARGIN_M = 0.15
"""How much further than a body what others draw of it may lie [m]."""

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
    """Return the cells where others may have mapped a body driving along a trail.

    Parameters
    ----------
    shape : (rows, columns)
        Of the grid.
    origin : (x, y)
        Lower left corner of cell (0, 0) [m].
    trail : (N, 2) float64
        Where the body was [m].
    radius : float
        Of the body [m].
    resolution : float
        Side of a cell [m].
    margin_m : float
        How much further than the body what counts as its image may lie [m].
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
    """Return the cells of the body's own footprint along its trail.

    Cells so near to the trail's end that they may show the standing body are left out.

    No wall is where a body was, but beside it there may be one.
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
    """Return points [m] as pixels in parts of a cell.

    Pixels are addressed by their centres.
    """
    return np.rint(((points - origin) / resolution - 0.5) * _CELL).astype(np.int32)
