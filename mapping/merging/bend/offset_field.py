"""A coarse grid of offsets, bilinear between its nodes: how one map is bent against another."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.kernels.compilation import Array, kernel


@dataclass(frozen=True, slots=True, eq=False)
class OffsetField:
    """Offsets of a map's points from where a rigid motion takes them.

    Attributes
    ----------
    corner : (x, y)
        The first node, in the map that is bent [m].
    spacing_m : float
        Between nodes, along both axes [m].
    offsets : (rows, columns, 2) float64
        At the nodes, along the axes of the other map [m].
    """

    corner: tuple[float, float]
    spacing_m: float
    offsets: NDArray[np.float64]

    def at(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the offsets of points (n, 2) of the bent map [m]; beyond the grid those of its rim."""
        found = np.empty((len(points), 2))
        _interpolate(np.ascontiguousarray(points), self.corner, self.spacing_m, self.offsets, found)
        return found

    def bent(self, a_from_b: Transform, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return where points (n, 2) of the bent map b lie in map a [m]."""
        return np.asarray(a_from_b.apply(points) + self.at(points))

    def unbent(self, a_from_b: Transform, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return where points (n, 2) of map a lie in the bent map b [m].

        Offsets change by a small share of the distance, so that two steps are exact to a millimetre.
        """
        back = a_from_b.inverse()
        found = back.apply(points)
        for _ in range(2):
            found = back.apply(points - self.at(found))
        return np.asarray(found)


def bilinear(
    points: NDArray[np.float64], corner: tuple[float, float], spacing: float, shape: tuple[int, ...]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the four nodes around each point and their weights, both (n, 4)."""
    rows, columns = shape
    place = (points - corner) / spacing
    x, y = np.clip(place[:, 0], 0.0, columns - 1.0), np.clip(place[:, 1], 0.0, rows - 1.0)
    left = np.minimum(x.astype(np.int64), max(columns - 2, 0))
    low = np.minimum(y.astype(np.int64), max(rows - 2, 0))
    u, v = x - left, y - low
    right, high = np.minimum(left + 1, columns - 1), np.minimum(low + 1, rows - 1)
    nodes = np.stack(
        [low * columns + left, low * columns + right, high * columns + left, high * columns + right], axis=1
    )
    weights = np.stack([(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v], axis=1)
    return nodes, weights


@kernel
def _interpolate(
    points: Array, corner: tuple[float, float], spacing: float, offsets: Array, found: Array
) -> None:
    """Write the bilinear offsets of points; `bilinear` is the plain form."""
    rows, columns = offsets.shape[0], offsets.shape[1]
    for i in range(points.shape[0]):
        x = min(max((points[i, 0] - corner[0]) / spacing, 0.0), columns - 1.0)
        y = min(max((points[i, 1] - corner[1]) / spacing, 0.0), rows - 1.0)
        left, low = min(int(x), max(columns - 2, 0)), min(int(y), max(rows - 2, 0))
        right, high = min(left + 1, columns - 1), min(low + 1, rows - 1)
        u, v = x - left, y - low
        for axis in range(2):
            lower = (1.0 - u) * offsets[low, left, axis] + u * offsets[low, right, axis]
            upper = (1.0 - u) * offsets[high, left, axis] + u * offsets[high, right, axis]
            found[i, axis] = (1.0 - v) * lower + v * upper
