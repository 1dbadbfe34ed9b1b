"""Point clouds, and their voxels: at most one point for each cube of space."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lidarium.mapping.kernels.compilation import Array, kernel


@dataclass(frozen=True, slots=True, eq=False)
class PointCloud:
    """Points in space, with weights and normals.

    Attributes
    ----------
    points : (N, 3) float32
        Coordinates [m].
    weights : (N,) float32 or None
        Number of points that each represents; None if each represents itself.
    normals : (N, 3) float32 or None
        Unit vectors across the surface.
    source : str
        Source for messages: the name of a file.
    offset : (3,) float64
        What is to be added to the points for the coordinates of the file, whose digits float32 would lose [m].
    remarks : tuple of str
        What was assumed of a file, and what of it is left out.
    """

    points: NDArray[np.float32]
    weights: NDArray[np.float32] | None = None
    normals: NDArray[np.float32] | None = None
    source: str = "points"
    offset: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        count = len(self.points)
        wanted = (("points", (count, 3)), ("weights", (count,)), ("normals", (count, 3)))
        for name, shape in wanted:
            value = getattr(self, name)
            if value is None:
                continue
            array = np.ascontiguousarray(value, np.float32)
            if array.shape != shape:
                raise ValueError(f"{name} of {self.source} have shape {array.shape}; want {shape}")
            object.__setattr__(self, name, array)

    def __len__(self) -> int:
        return len(self.points)

    def chosen(self, which: ArrayLike) -> "PointCloud":
        """Return the cloud of some points, (N,) bool or their places."""
        places = np.asarray(which)
        return PointCloud(
            self.points[places],
            None if self.weights is None else self.weights[places],
            None if self.normals is None else self.normals[places],
            self.source,
            self.offset,
            self.remarks,
        )


FRAME_EDGE, FLOOR_EDGE = 0.02, 0.05
"""Edges of voxels for single frames, and for whole floors [m]."""

MAX_CELLS = 1 << 20
"""Most voxels along an axis, to each side of the middle."""


def thinned(cloud: PointCloud, edge: float) -> PointCloud:
    """Replace the points of each voxel by their weighted mean.

    Parameters
    ----------
    edge : float
        Edge of a voxel [m]; corners are at multiples of it.
    """
    if not 0.0 < edge < np.inf:
        raise ValueError(f"edge of voxels is {edge}; want a number above 0")
    if len(cloud) == 0:
        return cloud
    places = np.floor(cloud.points.astype(np.float64) / edge)
    if not np.abs(places).max() < MAX_CELLS:
        raise ValueError(
            f"{cloud.source} has points that are not finite or more than {MAX_CELLS:,} voxels of {edge} m away"
        )
    cells = places.astype(np.int64) + MAX_CELLS
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
    found = points.astype(np.float32), masses.astype(np.float32), normals
    return PointCloud(*found, cloud.source, cloud.offset, cloud.remarks)


def _sums(values: Array, labels: Array, weights: Array, count: int) -> Array:
    """Return weighted sums of (N, 3) values by label, (count, 3)."""
    return np.stack([np.bincount(labels, weights * values[:, axis], count) for axis in range(3)], axis=1)


@kernel
def numbered(keys: Array) -> tuple[Array, int]:
    """Return numbers of keys (N,) int64 in the order of their first, (N,), and their number."""
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
