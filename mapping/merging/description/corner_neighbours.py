"""How alike corners of two maps are by the corners around them: their distances, triangles and clusters.

A rigid motion keeps all of them, so they need no descriptors.

References
----------
Methods a and b of the thesis on merging; clusters by radius stand for its equations 3-10 and 3-11, of which
only the idea is known: a corner's cluster are the corners within a radius, and two clusters are one
where their distances are.
"""

import numpy as np
from numpy.typing import NDArray

LEAST_CLUSTER = 2
"""Corners beside its own that a cluster needs."""


def common_distances(
    first: NDArray[np.float64], second: NDArray[np.float64], tolerance: float
) -> NDArray[np.float64]:
    """Return the share of common distances of each pair of corners, (n, m).

    The share of the first corner's distances that the second one has too.
    """
    votes = _common(_distances(first), _distances(second), tolerance)
    return np.asarray(votes / max(len(first) - 1, 1))


def like_clusters(
    first: NDArray[np.float64], second: NDArray[np.float64], tolerance: float, radius_m: float
) -> NDArray[np.float64]:
    """Return the share of common distances of each pair of corners within a radius, (n, m).

    The share is that of the larger cluster; 0 where either has fewer than ``LEAST_CLUSTER`` corners beside
    its own.
    """
    left, right = (_within(_distances(points), radius_m) for points in (first, second))
    common = np.minimum(_common(left, right, tolerance), _common(right, left, tolerance).T)
    sizes = [np.count_nonzero(distances > 0.0, axis=1) for distances in (left, right)]
    larger = np.maximum(sizes[0][:, None], sizes[1][None])
    smaller = np.minimum(sizes[0][:, None], sizes[1][None])
    return np.where(smaller >= LEAST_CLUSTER, common / np.maximum(larger, 1), 0.0)


def like_triangles(
    first: NDArray[np.float64], second: NDArray[np.float64], tolerance: float
) -> NDArray[np.float64]:
    """Return the similarity of the triangles of each pair of corners, (n, m).

    Triangles are with the two nearest neighbours; 0 where they are not alike.
    """
    if len(first) < 3 or len(second) < 3:
        return np.zeros((len(first), len(second)))
    left, right = _triangles(first), _triangles(second)
    longer = np.maximum(left[:, None], right[None])
    difference = (np.abs(left[:, None] - right[None]) / np.maximum(longer, 1e-9)).max(axis=2)
    return np.where(difference <= tolerance, 1.0 - difference, 0.0)


def _common(left: NDArray[np.float64], right: NDArray[np.float64], tolerance: float) -> NDArray[np.float64]:
    """Count the distances of each row (n, n) that each row of others (m, m) has too, (n, m); 0 is none."""
    votes = np.zeros((len(left), len(right)))
    for j, row in enumerate(right):
        lengths = np.sort(row[row > 0.0])
        if len(lengths) == 0:
            continue
        # A length has a like one if the first not shorter than its lower bound is not longer than its upper
        # bound.
        place = np.minimum(np.searchsorted(lengths, left * (1.0 - tolerance)), len(lengths) - 1)
        votes[:, j] = (
            (lengths[place] >= left * (1.0 - tolerance))
            & (lengths[place] * (1.0 - tolerance) <= left)
            & (left > 0.0)
        ).sum(axis=1)
    return votes


def _within(distances: NDArray[np.float64], radius_m: float) -> NDArray[np.float64]:
    return np.where(distances <= radius_m, distances, 0.0)


def _triangles(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the sides of each corner's triangle of neighbours, (n, 3) [m].

    Distances to the nearest and second neighbour, and between the two.
    """
    distances = _distances(points)
    order = np.argsort(distances + np.diag(np.full(len(points), np.inf)), axis=1, kind="stable")[:, :2]
    rows = np.arange(len(points))
    return np.stack(
        [distances[rows, order[:, 0]], distances[rows, order[:, 1]], distances[order[:, 0], order[:, 1]]],
        axis=1,
    )


def _distances(points: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.linalg.norm(points[:, None] - points[None], axis=2))
