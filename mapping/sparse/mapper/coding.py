"""Codes of weighted points: the one place that says how they are made.

References
----------
Sparse mapper, section 3.3: seeds drawn by squared distance, then Lloyd's steps.
"""

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.sparse.quantisation.quantiser import quantise
from lidarium.mapping.sparse.quantisation.settings import QuantisationSettings


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
    found = quantise(points, min(count, len(points)), QuantisationSettings(seed=seed), weights)
    held, labels = np.unique(found.labels, return_inverse=True)
    return found.codes[held], labels
