"""Points in voxels, for queries of what is beside a place.

References
----------
Sparse mapper, section 6, corrected: a query divides by the size of voxels, and the index counts columns times
rows for each layer.
"""

from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from lidarium.mapping.geometry.bounds import shown

NEIGHBOURHOODS: dict[int, NDArray[np.int64]] = {
    4: np.array([(-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0)]),
    6: np.array([(-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0), (0, 0, -1), (0, 0, 1)]),
    8: np.array([(i, j, 0) for i, j in product((-1, 0, 1), repeat=2) if (i, j) != (0, 0)]),
    27: np.array(list(product((-1, 0, 1), repeat=3))),
}
"""Voxels that a query takes beside its own: along x and y, along all axes, all of a layer, all around."""


class VoxelIndex:
    """Points sorted into voxels.

    Parameters
    ----------
    points : (N, 3) float64
        The points [m].
    size : float or (3,) float
        Sides of a voxel [m].

    Raises
    ------
    ValueError
        Where a size is not positive, or there are no points.
    """

    def __init__(self, points: NDArray[np.float64], size: float | NDArray[np.float64] = 0.5) -> None:
        self.points = np.ascontiguousarray(points, np.float64).reshape(-1, 3)
        self.size = np.broadcast_to(np.asarray(size, np.float64), 3)
        if not (np.isfinite(self.size).all() and (self.size > 0.0).all()):
            raise ValueError(f"size of voxels is {shown(size)} m; want positive numbers")
        if len(self.points) == 0:
            raise ValueError("there are no points to index; want at least one")
        self._low = self.points.min(axis=0)
        cells = np.floor((self.points - self._low) / self.size).astype(np.int64)
        self.shape = cells.max(axis=0) + 1
        places = self._places(cells)
        self._order = np.argsort(places, kind="stable")
        self._sorted = places[self._order]

    def _places(self, cells: NDArray[np.int64]) -> NDArray[np.int64]:
        return np.asarray(cells @ np.array([1, self.shape[0], self.shape[0] * self.shape[1]]))

    def _members(self, cells: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the points in cells (C, 3), in their order."""
        places = self._places(cells)
        firsts, lasts = (np.searchsorted(self._sorted, places, side) for side in ("left", "right"))
        found = [self._order[first:last] for first, last in zip(firsts, lasts, strict=True)]
        return np.sort(np.concatenate(found)) if found else np.zeros(0, np.int64)

    def voxel(self, point: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the voxel (3,) in which a point lies; it may lie beyond all of them."""
        place = (np.asarray(point, np.float64) - self._low) / self.size
        return np.asarray(np.floor(place).astype(np.int64))

    def beside(self, point: NDArray[np.float64], neighbours: int = 27) -> NDArray[np.int64]:
        """Return the points in the voxel of a point and those beside it.

        Parameters
        ----------
        point : (3,) float64
            The place [m].
        neighbours : int
            How many voxels beside it, a key of ``NEIGHBOURHOODS``.

        Returns
        -------
        (M,) int64
            Numbers of points, in their order.

        Raises
        ------
        ValueError
            Where there is no such neighbourhood.
        """
        if neighbours not in NEIGHBOURHOODS:
            raise ValueError(f"neighbours is {neighbours}; want one of {', '.join(map(str, NEIGHBOURHOODS))}")
        cells = np.unique(np.vstack([NEIGHBOURHOODS[neighbours], (0, 0, 0)]), axis=0) + self.voxel(point)
        return self._members(cells[((cells >= 0) & (cells < self.shape)).all(axis=1)])

    def within(self, point: NDArray[np.float64], radius: float) -> NDArray[np.int64]:
        """Return the points at most so far [m] from a place (3,), in their order, (M,) int64."""
        low = np.maximum(self.voxel(point - radius), 0)
        high = np.minimum(self.voxel(point + radius), self.shape - 1)
        if (low > high).any():
            return np.zeros(0, np.int64)
        spans = [np.arange(first, last + 1) for first, last in zip(low, high, strict=True)]
        found = self._members(np.stack(np.meshgrid(*spans, indexing="ij"), axis=-1).reshape(-1, 3))
        gaps = self.points[found] - point
        return np.asarray(found[np.einsum("ij,ij->i", gaps, gaps) <= radius * radius])


class KdTreeIndex:
    """Points in a k-d tree, which the thesis names as an alternative to voxels.

    Parameters
    ----------
    points : (N, 3) float64
        The points [m].
    """

    def __init__(self, points: NDArray[np.float64]) -> None:
        self.points = np.ascontiguousarray(points, np.float64).reshape(-1, 3)
        self._tree = cKDTree(self.points)

    def within(self, point: NDArray[np.float64], radius: float) -> NDArray[np.int64]:
        """Return the points at most so far [m] from a place (3,), in their order, (M,) int64."""
        return np.asarray(self._tree.query_ball_point(point, radius, return_sorted=True), np.int64)
