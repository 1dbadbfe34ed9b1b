"""Filters of clouds: which points are kept."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from lidarium.mapping.point_clouds.point_cloud import PointCloud


def within_range(
    cloud: PointCloud, farthest: float, nearest: float = 0.0, origin: ArrayLike = (0.0, 0.0, 0.0)
) -> PointCloud:
    """Keep the points that are from ``nearest`` to ``farthest`` away from the sensor.

    Parameters
    ----------
    cloud : PointCloud
        The points; such as are not finite are dropped.
    farthest, nearest : float
        Distances [m]; the thesis has 4 m for real depth cameras.
    origin : (3,)
        Where the sensor is in the cloud's frame [m].

    Returns
    -------
    PointCloud
        The points that are left.
    """
    across = cloud.points.astype(np.float64) - np.asarray(origin, np.float64)
    squares = np.einsum("na,na->n", across, across)
    return cloud.chosen((squares >= nearest**2) & (squares <= farthest**2))


def finite(cloud: PointCloud) -> PointCloud:
    """Keep the points whose coordinates are finite."""
    return cloud.chosen(np.isfinite(cloud.points).all(axis=1))


def without_lonely(cloud: PointCloud, radius: float, neighbours: int = 1) -> PointCloud:
    """Keep the points that have enough others nearby.

    Parameters
    ----------
    cloud : PointCloud
        Finite points.
    radius : float
        How far away others may be [m].
    neighbours : int
        How many others there have to be.

    Returns
    -------
    PointCloud
        The points that are left.
    """
    if neighbours < 1 or len(cloud) == 0:
        return cloud
    if neighbours >= len(cloud):
        return cloud.chosen(np.zeros(len(cloud), bool))
    points = cloud.points.astype(np.float64)
    # Each point is the nearest to itself.
    farthest = float(np.nextafter(radius, np.inf))
    found: Any = cKDTree(points).query(points, [neighbours + 1], distance_upper_bound=farthest)
    return cloud.chosen(found[0][:, 0] <= radius)
