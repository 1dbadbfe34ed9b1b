"""Normals of surfaces, from the neighbours of each point."""

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from lidarium.mapping.point_clouds.point_cloud import PointCloud

_AT_ONCE = 1 << 16


def with_normals(cloud: PointCloud, neighbours: int = 12, origin: ArrayLike = (0.0, 0.0, 0.0)) -> PointCloud:
    """Return a cloud with normals, along which a point's nearest vary least.

    Parameters
    ----------
    cloud : PointCloud
        Finite points, at least three.
    neighbours : int
        How many nearest points are looked at, the point itself among them; at least three.
    origin : (3,)
        Where the sensor is; normals point to its side [m].

    Returns
    -------
    PointCloud
        The same points, with normals.

    Raises
    ------
    ValueError
        Where there are fewer than three points or neighbours.
    """
    count = min(neighbours, len(cloud))
    if count < 3:
        raise ValueError(f"normals of {len(cloud):,} points by {neighbours} neighbours; want three at least")
    points = cloud.points.astype(np.float64)
    tree, normals = cKDTree(points), np.empty((len(points), 3))
    for start in range(0, len(points), _AT_ONCE):
        some = points[start : start + _AT_ONCE]
        near = points[tree.query(some, count)[1]]
        near -= near.mean(axis=1, keepdims=True)
        normals[start : start + _AT_ONCE] = np.linalg.eigh(np.einsum("nka,nkb->nab", near, near))[1][:, :, 0]
    is_away = np.einsum("na,na->n", normals, points - np.asarray(origin, np.float64)) > 0.0
    normals[is_away] *= -1.0
    return PointCloud(cloud.points, cloud.weights, normals.astype(np.float32), cloud.source)
