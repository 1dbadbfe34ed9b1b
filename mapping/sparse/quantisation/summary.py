"""What is known of each code's points: counts, boxes, radii, second moments, distortion."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.simd.codes import TILE
from lidarium.mapping.kernels.views import scratch_grid, scratch_vector
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

    def means(self, codes: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the means of codes' points, (k, 3) [m]; of no points, the code."""
        offsets = self.moments[:, :3] / np.maximum(self.masses, np.finfo(np.float64).tiny)[:, None]
        return (codes + offsets).astype(np.float32)

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


@kernel(nrt=False)
def _sum_up(tiles: Tiles, count: int, codes: Array, nearest: Nearest, summary: Summary) -> None:
    """Add every point to the sums of its code, tiles of one code at once."""
    distances, offsets = scratch_vector(TILE, np.float32), scratch_grid(3, TILE, np.float64)
    own = scratch_vector(_MOMENTS, np.float64)
    for tile in range(len(tiles.boxes)):
        labels, weights = nearest.labels[tile], tiles.weights[tile]
        found = min(TILE, count - tile * TILE)
        changes = 0
        for lane in range(TILE):
            changes |= labels[lane] ^ labels[0]
            distances[lane] = np.sqrt(nearest.squares[tile, lane])
            for axis in range(3):
                side = tiles.points[tile, axis, lane]
                offsets[axis, lane] = float(side) - float(codes[labels[lane], axis])
        if changes == 0:
            number = labels[0]
            _stretch(summary.boxes[number], tiles.boxes[tile, 0], tiles.boxes[tile, 1])
            summary.counts[number] += found
            summary.masses[number] += tiles.sums[tile, 3]
            summary.errors[number, 1] += nearest.errors[tile]
            summary.radii[number] = max(summary.radii[number], np.sqrt(nearest.worst[tile]))
            _add_all(weights, distances, offsets, summary.errors[number], summary.moments[number])
            continue
        for lane in range(found):
            number, mass, reach = labels[lane], float(weights[lane]), distances[lane]
            point = tiles.points[tile, :, lane]
            _stretch(summary.boxes[number], point, point)
            summary.counts[number] += 1
            summary.masses[number] += mass
            summary.errors[number, 0] += mass * float(reach)
            summary.errors[number, 1] += mass * float(nearest.squares[tile, lane])
            summary.radii[number] = max(summary.radii[number], reach)
            _set_moments(offsets, lane, mass, own)
            for moment in range(_MOMENTS):
                summary.moments[number, moment] += own[moment]


@kernel(forceinline=True, nrt=False)
def _stretch(box: Array, low: Array, high: Array) -> None:
    """Stretch a box so that it holds another one."""
    for axis in range(3):
        box[0, axis] = min(box[0, axis], low[axis])
        box[1, axis] = max(box[1, axis], high[axis])


@kernel(forceinline=True, nrt=False)
def _set_moments(offsets: Array, lane: int, mass: float, own: Array) -> None:
    """Set the moments of a point."""
    x, y, z = offsets[0, lane], offsets[1, lane], offsets[2, lane]
    own[0], own[1], own[2] = mass * x, mass * y, mass * z
    own[3], own[4], own[5] = own[0] * x, own[1] * y, own[2] * z
    own[6], own[7], own[8] = own[0] * y, own[0] * z, own[1] * z


@kernel(forceinline=True, nrt=False)
def _add_all(weights: Array, distances: Array, offsets: Array, errors: Array, moments: Array) -> None:
    """Add the distances and moments of a tile's points to those of a code."""
    far, a, b, c, aa, bb, cc, ab, ac, bc = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for lane in range(TILE):
        mass = float(weights[lane])
        x, y, z = offsets[0, lane], offsets[1, lane], offsets[2, lane]
        u, v, w = mass * x, mass * y, mass * z
        far += mass * float(distances[lane])
        a, b, c = a + u, b + v, c + w
        aa, bb, cc = aa + u * x, bb + v * y, cc + w * z
        ab, ac, bc = ab + u * y, ac + u * z, bc + v * z
    errors[0] += far
    for moment, value in enumerate((a, b, c, aa, bb, cc, ab, ac, bc)):
        moments[moment] += value
