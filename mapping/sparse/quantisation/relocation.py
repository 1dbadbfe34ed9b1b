"""Codes that move from where they are of least use to where the error is greatest.

What merging two codes costs, Ward's distance tells; what splitting one gains, the greatest variance of its
points. The cheapest are merged and the richest split, whatever the balance: Lloyd's steps, which follow, gain
more than either tells. There are fewer exchanges after rounds that were no better, and the best codes of all
rounds are kept.
Source: G. Patane, M. Russo, "The enhanced LBG algorithm", 2001, whose exchanges are made many at a time.
"""

import time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from lidarium.mapping.sparse.quantisation.lloyd import Codes, improved, nearest_codes
from lidarium.mapping.sparse.quantisation.seeding import Nearest
from lidarium.mapping.sparse.quantisation.summary import Summary, summary_of
from lidarium.mapping.sparse.quantisation.tiles import Tiles

FIRST_SHARE = 0.2
"""Exchanges of the first round over codes."""

FEWER = 0.6
"""Exchanges of a round over those of the one before, where that was no better than the best so far."""

STEPS = 4
"""Lloyd's steps after exchanges."""


def relocated(
    tiles: Tiles, codes: Codes, deadline: float, keeps_empty: bool = False
) -> tuple[Codes, Nearest]:
    """Return better codes, found until a time, and the nearest of every point.

    Parameters
    ----------
    tiles : Tiles
        The points.
    codes : (k, 3) float32
        Codes to start from [m].
    deadline : float
        When to end, on the clock of ``time.perf_counter`` [s]; a round that takes longer is not begun.
    keeps_empty : bool
        Whether codes without points stay where they are.

    Returns
    -------
    codes : (k, 3) float32
        Codes whose mean squared distance is not above that of those given.
    nearest : Nearest
        The nearest of them of every point.
    """
    began = time.perf_counter()
    best = nearest = nearest_codes(tiles, codes)
    now = time.perf_counter()
    # A round labels the points so many times, and sums them up.
    best_codes, share, longest, began = codes, FIRST_SHARE, (STEPS + 2) * (now - began), now
    while began + longest < deadline:
        most = int(share * len(codes))
        if most > 0 and len(codes) > 2:
            codes = exchanged(codes, summary_of(tiles, codes, nearest), most)
        codes = improved(tiles, codes, STEPS, keeps_empty)
        nearest = nearest_codes(tiles, codes)
        if nearest.group_errors.sum() < best.group_errors.sum():
            best_codes, best = codes, nearest
        else:
            share *= FEWER
        now = time.perf_counter()
        longest, began = max(longest, now - began), now
    return best_codes, best


def exchanged(codes: Codes, summary: Summary, most: int) -> Codes:
    """Return means of codes' points, some merged, and as many split in two.

    Parameters
    ----------
    codes : (k, 3) float32
        At least three codes [m].
    summary : Summary
        Of their points.
    most : int
        Most exchanges.

    Returns
    -------
    (k, 3) float32
        The new codes; no code takes part in two exchanges.
    """
    means = summary.means(codes)
    costs, partners = merging_costs(means, summary.masses)
    variances, axes = np.linalg.eigh(summary.covariances())
    gains = summary.masses * variances[:, 2]
    moved = means.copy()
    is_free = np.ones(len(codes), bool)
    cheapest, richest = iter(np.argsort(costs, kind="stable")), iter(np.argsort(-gains, kind="stable"))
    for _ in range(most):
        merged = next((code for code in cheapest if is_free[code] and is_free[partners[code]]), None)
        if merged is None:
            break
        other = partners[merged]
        is_free[[merged, other]] = False
        split = next((code for code in richest if is_free[code]), None)
        if split is None:
            break
        is_free[split] = False
        masses = summary.masses[[merged, other]]
        moved[other] = (masses @ means[[merged, other]]) / max(masses.sum(), np.finfo(np.float64).tiny)
        # Halves of evenly spread points have their means so far from the middle.
        shift = 0.5 * np.sqrt(3.0 * max(variances[split, 2], 0.0)) * axes[split, :, 2]
        moved[split], moved[merged] = means[split] + shift, means[split] - shift
    return moved


def merging_costs(
    codes: Codes, masses: NDArray[np.float64], neighbours: int = 8
) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Return what merging each code with a neighbour costs, and with which.

    Parameters
    ----------
    codes : (k, 3) float32
        The codes, at least two [m].
    masses : (k,) float64
        Weights of their points.
    neighbours : int
        How many nearest codes are looked at.

    Returns
    -------
    costs : (k,) float64
        Ward's distances [m2].
    partners : (k,) int
        Numbers of the neighbours.
    """
    count = min(neighbours + 1, len(codes))
    found: Any = cKDTree(codes).query(codes, count)
    distances, near = found
    own, other = masses[:, None], masses[near]
    ward = distances**2 * own * other / np.maximum(own + other, np.finfo(np.float64).tiny)
    ward[near == np.arange(len(codes))[:, None]] = np.inf
    best = ward.argmin(axis=1)
    rows = np.arange(len(codes))
    return ward[rows, best], near[rows, best]
