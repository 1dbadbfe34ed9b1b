"""Which points of a cloud are floor, and which stand on it.

References
----------
Sparse mapper, section 4, step 3. The thesis splits codes; points are split here before they are coded, so
that no code has both.
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from lidarium.mapping.sparse.floor_plane import FloorPlane
from lidarium.mapping.sparse.settings import MapperSettings

_NEIGHBOURS = 16


def is_floor(points: NDArray[np.float64], floor: FloorPlane, settings: MapperSettings) -> NDArray[np.bool_]:
    """Return which points (N, 3) [m] are floor, (N,) bool."""
    if settings.split == "height":
        return np.asarray(floor.heights(points) <= settings.floor_height_m)
    is_level = np.abs(surface_normals(points) @ floor.normal) >= math.cos(settings.most_slope)
    if settings.split == "normal":
        return np.asarray(is_level & ~_hangs_over(points, floor, settings))
    return np.asarray(is_level & (floor.heights(points) <= settings.floor_height_m))


def _hangs_over(
    points: NDArray[np.float64], floor: FloorPlane, settings: MapperSettings
) -> NDArray[np.bool_]:
    """Return which points are too high to be driven up to: table tops, seats."""
    reach = floor.heights(points) - settings.floor_height_m
    aside = points @ floor.levelling()[:2, :3].T
    low = aside[reach <= 0.0]
    if len(low) == 0:
        return np.ones(len(points), np.bool_)
    # A ramp rises from the floor no steeper than its slope allows.
    gaps = cKDTree(low).query(aside)[0]
    return np.asarray(reach > gaps * math.tan(settings.most_slope))


def surface_normals(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return unit normals around points (N, 3), either way round, (N, 3)."""
    count = min(_NEIGHBOURS, len(points))
    if count < 3:
        return np.zeros(points.shape)
    near = points[np.reshape(cKDTree(points).query(points, count)[1], (len(points), count))]
    near = near - near.mean(axis=1, keepdims=True)
    return np.asarray(np.linalg.eigh(np.einsum("nki,nkj->nij", near, near))[1][:, :, 0])
