"""What is kept of each code's points: box, weight, normal."""

import numpy as np
from numpy.typing import NDArray

FLAT = 0.25
"""Variance across a surface over that along its narrower side, below which it has a normal."""


def boxes_of(points: NDArray[np.float64], labels: NDArray[np.int64], count: int) -> NDArray[np.float64]:
    """Return the boxes of the codes' points.

    Parameters
    ----------
    points : (N, 3) float64
        Points [m].
    labels : (N,) int64
        Code of each point; each code has one.
    count : int
        How many codes there are.

    Returns
    -------
    (count, 2, 3) float64
        Low and high corners [m].
    """
    if count == 0:
        return np.empty((0, 2, 3))
    order = np.argsort(labels, kind="stable")
    starts = np.searchsorted(labels[order], np.arange(count))
    ranked = points[order]
    return np.stack([np.minimum.reduceat(ranked, starts), np.maximum.reduceat(ranked, starts)], axis=1)


def masses_of(labels: NDArray[np.int64], weights: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return the sums of the weights (N,) of each code's points, (count,)."""
    return np.asarray(np.bincount(labels, weights, count), np.float64)


def means_of(
    points: NDArray[np.float64], weights: NDArray[np.float64], labels: NDArray[np.int64], count: int
) -> NDArray[np.float64]:
    """Return the weighted means of each code's points (N, 3), (count, 3)."""
    masses = np.maximum(np.bincount(labels, weights, count), 1e-12)
    sums = np.stack([np.bincount(labels, weights * points[:, axis], count) for axis in range(3)], axis=1)
    return np.asarray(sums / masses[:, None])


def normals_of(
    points: NDArray[np.float64], weights: NDArray[np.float64], labels: NDArray[np.int64], count: int
) -> NDArray[np.float64]:
    """Return the normals of the surfaces of the codes' points.

    Parameters
    ----------
    points : (N, 3) float64
        Points [m].
    weights : (N,) float64
        Their weights.
    labels : (N,) int64
        Code of each point.
    count : int
        How many codes there are.

    Returns
    -------
    (count, 3) float64
        Unit normals, their largest part above zero; zero where the points are no surface.
    """
    masses = np.maximum(np.bincount(labels, weights, count), 1e-12)
    gaps = points - means_of(points, weights, labels, count)[labels]
    spreads = np.empty((count, 3, 3))
    for row in range(3):
        for column in range(3):
            spreads[:, row, column] = (
                np.bincount(labels, weights * gaps[:, row] * gaps[:, column], count) / masses
            )
    values, vectors = np.linalg.eigh(spreads)
    normals = vectors[:, :, 0]
    largest = np.take_along_axis(normals, np.abs(normals).argmax(axis=1)[:, None], axis=1)
    normals = normals * np.where(largest < 0.0, -1.0, 1.0)
    normals[~(values[:, 0] < FLAT * values[:, 1])] = 0.0
    return np.asarray(normals)
