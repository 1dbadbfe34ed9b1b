"""Clouds made ready to be coded: points that can be, gathered in voxels.

References
----------
Sparse mapper, section 2.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.point_clouds.voxels import numbered

WIDEST_M = 2000.0
"""Widest cloud [m]; millimetres are wider."""

_CELL_BITS = 21


class Voxels(NamedTuple):
    """Points gathered in voxels.

    Attributes
    ----------
    means : (V, 3) float64
        Mean of each voxel's points [m].
    weights : (V,) float64
        How many these are.
    labels : (N,) int64
        Voxel of each point.
    """

    means: NDArray[np.float64]
    weights: NDArray[np.float64]
    labels: NDArray[np.int64]


def usable_points(points: NDArray[np.floating], range_m: float | None = None) -> NDArray[np.float64]:
    """Return the finite points of a cloud that are near enough.

    Parameters
    ----------
    points : (N, 3) float
        The cloud, seen from its origin [m].
    range_m : float or None
        Farthest point that is kept [m]; None for any.

    Returns
    -------
    (M, 3) float64
        Points, in their order [m].

    Raises
    ------
    ValueError
        Where no point is left, or the cloud cannot be in metres.
    """
    cloud = np.asarray(points, np.float64)
    if cloud.ndim != 2 or cloud.shape[1] != 3:
        raise ValueError(f"points have shape {cloud.shape}; want (N, 3)")
    if len(cloud) == 0:
        raise ValueError("the cloud has no points; want some")
    finite = cloud[np.isfinite(cloud).all(axis=1)]
    if len(finite) == 0:
        raise ValueError(f"none of the {len(cloud):,} points of the cloud is finite; want numbers")
    if range_m is not None:
        squares = np.einsum("ij,ij->i", finite, finite)
        near = finite[squares <= range_m * range_m]
        if len(near) == 0:
            raise ValueError(
                f"the nearest point of the cloud is {np.sqrt(squares.min()):.4g} m away; want points in "
                f"metres within {range_m:g} m, or a longer range"
            )
        return np.asarray(near)
    low, high = np.percentile(finite, (1.0, 99.0), axis=0)
    if float((high - low).max()) > WIDEST_M:
        raise ValueError(
            f"the cloud is {(high - low).max():,.0f} m wide; want at most {WIDEST_M:,.0f} m: "
            "are these millimetres?"
        )
    return finite


def voxels_of(points: NDArray[np.float64], side: float) -> Voxels:
    """Gather points in voxels.

    Parameters
    ----------
    points : (N, 3) float64
        Points [m].
    side : float
        Side of a voxel [m]; 0 for one voxel a point.

    Returns
    -------
    Voxels
        In the order of their first points.
    """
    if side <= 0.0 or len(points) == 0:
        return Voxels(points, np.ones(len(points)), np.arange(len(points)))
    cells = np.floor((points - points.min(axis=0)) / side).astype(np.int64)
    cells = np.minimum(cells, (1 << _CELL_BITS) - 1)
    keys = (cells[:, 2] << 2 * _CELL_BITS) | (cells[:, 1] << _CELL_BITS) | cells[:, 0]
    labels, count = numbered(keys)
    weights = np.bincount(labels, minlength=count).astype(np.float64)
    sums = np.stack([np.bincount(labels, points[:, axis]) for axis in range(3)], axis=1)
    return Voxels(sums / weights[:, None], weights, labels)
