"""What is known of each code's points: counts, boxes, radii, second moments, distortion."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.sparse.quantisation.point_lanes import TILE
from lidarium.mapping.sparse.quantisation.seeding import Nearest
from lidarium.mapping.sparse.quantisation.tiles import Tiles

AXES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""The axes of the six second moments."""

_FIRST_PRODUCT = 3
_MOMENTS = 9


class Summary(NamedTuple):
    """Sums over each code's points, with offsets of points from the code.

    Attributes
    ----------
    counts : (k,) int64
        Points.
    masses : (k,) float64
        Weights.
    errors : (k, 2) float64
        Weighted distances [m], and squared ones [m2].
    moments : (k, 9) float64
        Weighted offsets along three axes [m], and products of two, in the order of ``AXES`` [m2].
    boxes : (k, 2, 3) float32
        Least and greatest coordinates [m]; of no points, inf and -inf.
    radii : (k,) float32
        Greatest distance [m].
    """

    counts: NDArray[np.int64]
    masses: NDArray[np.float64]
    errors: NDArray[np.float64]
    moments: NDArray[np.float64]
    boxes: NDArray[np.float32]
    radii: NDArray[np.float32]

    def covariances(self) -> NDArray[np.float64]:
        """Return the covariances of each code's points, (k, 3, 3) [m2]; zero of no points."""
        parts = self.moments / np.maximum(self.masses, np.finfo(np.float64).tiny)[:, None]
        matrices = np.empty((len(parts), 3, 3))
        for place, (first, second) in enumerate(AXES):
            value = parts[:, _FIRST_PRODUCT + place] - parts[:, first] * parts[:, second]
            matrices[:, first, second] = matrices[:, second, first] = value
        return matrices


def summary_of(tiles: Tiles, codes: NDArray[np.float32], nearest: Nearest) -> Summary:
    """Sum up what is known of each code's points.

    Parameters
    ----------
    tiles : Tiles
        The points.
    codes : (k, 3) float32
        The codes [m].
    nearest : Nearest
        The nearest code of every point, with the distance to it.

    Returns
    -------
    Summary
        The sums.
    """
    count = len(codes)
    boxes = np.empty((count, 2, 3), np.float32)
    boxes[:, 0], boxes[:, 1] = np.inf, -np.inf
    summary = Summary(
        np.zeros(count, np.int64),
        np.zeros(count),
        np.zeros((count, 2)),
        np.zeros((count, _MOMENTS)),
        boxes,
        np.zeros(count, np.float32),
    )
    _sum_up(tiles, len(tiles.order), codes, nearest, summary)
    return summary


@kernel(borrowing=True)
def _sum_up(tiles: Tiles, count: int, codes: Array, nearest: Nearest, summary: Summary) -> None:
    """Add every point to the sums of its code."""
    for tile in range(len(tiles.boxes)):
        for lane in range(min(TILE, count - tile * TILE)):
            number, mass = nearest.labels[tile, lane], float(tiles.weights[tile, lane])
            own, box = summary.moments[number], summary.boxes[number]
            for axis in range(3):
                side = tiles.points[tile, axis, lane]
                box[0, axis] = min(box[0, axis], side)
                box[1, axis] = max(box[1, axis], side)
            x = float(tiles.points[tile, 0, lane]) - float(codes[number, 0])
            y = float(tiles.points[tile, 1, lane]) - float(codes[number, 1])
            z = float(tiles.points[tile, 2, lane]) - float(codes[number, 2])
            square = x * x + y * y + z * z
            distance = np.sqrt(square)
            summary.counts[number] += 1
            summary.masses[number] += mass
            summary.errors[number, 0] += mass * distance
            summary.errors[number, 1] += mass * square
            own[0] += mass * x
            own[1] += mass * y
            own[2] += mass * z
            own[3] += mass * x * x
            own[4] += mass * y * y
            own[5] += mass * z * z
            own[6] += mass * x * y
            own[7] += mass * x * z
            own[8] += mass * y * z
            summary.radii[number] = max(summary.radii[number], np.float32(distance))
