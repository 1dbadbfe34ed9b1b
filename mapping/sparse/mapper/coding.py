"""Codes of weighted points: the one place that says how they are made.

References
----------
Sparse mapper, section 3.3: seeds drawn by squared distance, then Lloyd's steps.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

STEPS = 7


def coded(
    points: NDArray[np.float64], weights: NDArray[np.float64], count: int, seed: int
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return codes of weighted points.

    Parameters
    ----------
    points : (N, 3) float64
        Points [m], at least one.
    weights : (N,) float64
        Their weights, above zero.
    count : int
        How many codes; fewer where there are fewer points.
    seed : int
        Of the first codes.

    Returns
    -------
    (k, 3) float64
        Codes [m], each with a point.
    (N,) int64
        The code of each point.
    """
    count = min(count, len(points))
    codes = _seeds(points, weights, count, np.random.default_rng(seed))
    for _ in range(STEPS):
        labels = cKDTree(codes).query(points)[1]
        masses = np.bincount(labels, weights, count)
        sums = np.stack([np.bincount(labels, weights * points[:, axis], count) for axis in range(3)], axis=1)
        held = masses > 0.0
        codes[held] = sums[held] / masses[held, None]
    labels = cKDTree(codes).query(points)[1]
    held, labels = np.unique(labels, return_inverse=True)
    return codes[held], labels


def _seeds(
    points: NDArray[np.float64], weights: NDArray[np.float64], count: int, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Draw points, each by its squared distance to those drawn before."""
    codes = np.empty((count, 3))
    squares = np.full(len(points), 1.0)
    for place in range(count):
        totals = np.cumsum(squares * weights)
        drawn = np.searchsorted(totals, rng.random() * totals[-1], side="right")
        codes[place] = points[min(int(drawn), len(points) - 1)]
        gaps = points - codes[place]
        own = np.einsum("ij,ij->i", gaps, gaps)
        squares = own if place == 0 else np.minimum(squares, own)
    return codes
