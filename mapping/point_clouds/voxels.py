"""A grid of voxels, each of which leaves the mean of its points with their weight."""

import numpy as np

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.point_clouds.point_cloud import PointCloud

FRAME_EDGE, FLOOR_EDGE = 0.02, 0.05
"""Edges of voxels for single frames, and for whole floors [m]."""

MOST_CELLS = 1 << 20
"""Most voxels along an axis, to each side of the middle."""


def thinned(cloud: PointCloud, edge: float) -> PointCloud:
    """Replace the points of each voxel by their weighted mean.

    Parameters
    ----------
    cloud : PointCloud
        Finite points.
    edge : float
        Edge of a voxel [m]; corners are at multiples of it.

    Returns
    -------
    PointCloud
        A point for each voxel that has any, in the order of their first points; weights are the sums of those
        of its points, normals their means, of unit length.

    Raises
    ------
    ValueError
        Where points are not finite or too many voxels away.
    """
    if not 0.0 < edge < np.inf:
        raise ValueError(f"edge of voxels is {edge}; want a number above 0")
    if len(cloud) == 0:
        return cloud
    places = np.floor(cloud.points.astype(np.float64) / edge)
    if not np.abs(places).max() < MOST_CELLS:
        raise ValueError(
            f"{cloud.source} has points that are not finite or more than {MOST_CELLS:,} voxels of {edge} m "
            "away"
        )
    cells = places.astype(np.int64) + MOST_CELLS
    keys = cells[:, 0] | cells[:, 1] << 21 | cells[:, 2] << 42
    labels, count = numbered(keys)
    weights = np.ones(len(cloud)) if cloud.weights is None else cloud.weights.astype(np.float64)
    masses = np.bincount(labels, weights, count)
    points = _sums(cloud.points, labels, weights, count) / masses[:, None]
    normals = None
    if cloud.normals is not None:
        sums = _sums(cloud.normals, labels, weights, count)
        lengths = np.linalg.norm(sums, axis=1, keepdims=True)
        normals = (sums / np.where(lengths > 0.0, lengths, 1.0)).astype(np.float32)
    return PointCloud(points.astype(np.float32), masses.astype(np.float32), normals, cloud.source)


def _sums(values: Array, labels: Array, weights: Array, count: int) -> Array:
    """Return weighted sums of (N, 3) values by label, (count, 3)."""
    return np.stack([np.bincount(labels, weights * values[:, axis], count) for axis in range(3)], axis=1)


@kernel
def numbered(keys: Array) -> tuple[Array, int]:
    """Return numbers of keys (N,) int64 in the order of their first, (N,), and how many there are."""
    size = 2
    while size < 2 * len(keys):
        size *= 2
    slots, labels = np.full(size, -1, np.int64), np.empty(len(keys), np.int64)
    held, count = np.empty(len(keys), np.int64), 0
    for i in range(len(keys)):
        key = keys[i]
        mixed = np.uint64(key) * np.uint64(0x9E3779B97F4A7C15)
        slot = np.int64(mixed >> np.uint64(20)) & (size - 1)
        while slots[slot] >= 0 and held[slots[slot]] != key:
            slot = (slot + 1) & (size - 1)
        if slots[slot] < 0:
            slots[slot], held[count] = count, key
            count += 1
        labels[i] = slots[slot]
    return labels, count
