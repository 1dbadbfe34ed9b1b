"""Simultaneous bands: intervals around a mean curve that hold the whole true curve with the stated probability.

References
----------
Montiel Olea and Plagborg-Moller, Simultaneous confidence bands: theory, implementation, and an application to SVARs,
Journal of Applied Econometrics 34 (2019): one factor for all standard errors, from the largest of correlated t values.
"""

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from lidarium.evaluation.statistics.samples import Values, checked_confidence

FEWEST_FOR_BANDS = 5
"""Number of curves from which there is a band: t values of fewer are so large that bands tell nothing."""

DRAWS = 4000

_MOST_DRAWN = 30
"""More curves than this are taken for as many: the band is at most a fiftieth too wide then."""


def mean_bands(curves: ArrayLike, confidence: float = 0.95, seed: int = 0, draws: int = DRAWS) -> Values:
    """Return the mean of curves and the ends of a band that holds the whole true mean curve, (3, k).

    The largest t value along a curve is drawn as if deviations were normal and each point depended on the one
    before, with the correlation that the curves have there. For few curves, such as seeds of a training: each
    t value has its own standard error, as the band has.

    Parameters
    ----------
    curves : (n, k) array_like
        n curves of k points, finite.
    confidence : float, default 0.95
        Probability that the band holds the curve everywhere.
    seed : int, default 0
        Seed of the draws.
    draws : int, default 4000
        Number of curves of t values that are drawn.

    Raises
    ------
    ValueError
        If the curves are not finite or not an array of two dimensions.
    """
    values = np.asarray(curves, np.float64)
    if values.ndim != 2 or not values.size or not np.isfinite(values).all():
        raise ValueError(f"curves have shape {values.shape}; want n curves of k points, all of them finite")
    count, points = values.shape
    mean = values.mean(axis=0)
    if count < FEWEST_FOR_BANDS:
        return np.stack([mean, np.full(points, -np.inf), np.full(points, np.inf)])
    deviations = values - mean
    spread = deviations.std(axis=0, ddof=1)
    moves = spread > 1e-12 * np.maximum(np.abs(mean), 1e-300)
    scaled = deviations[:, moves] / spread[moves]
    correlations = np.clip((scaled[:, 1:] * scaled[:, :-1]).sum(axis=0) / (count - 1), -1.0, 1.0)
    factor = _largest_t(min(count, _MOST_DRAWN), correlations, confidence, seed, draws) if moves.any() else 0.0
    width = factor * np.where(moves, spread, 0.0) / np.sqrt(count)
    return np.stack([mean, mean - width, mean + width])


def _largest_t(count: int, correlations: Values, confidence: float, seed: int, draws: int) -> float:
    """Return the quantile of the largest absolute t value along curves of correlated normal points."""
    generator = np.random.default_rng(seed)
    point = generator.standard_normal((draws, count))
    largest = np.zeros(draws)
    for correlation in (None, *correlations):
        if correlation is not None:
            new = generator.standard_normal((draws, count))
            point = correlation * point + np.sqrt(1.0 - correlation**2) * new
        t = np.abs(point.mean(axis=1)) * np.sqrt(count) / point.std(axis=1, ddof=1)
        np.maximum(largest, t, out=largest)
    pointwise = float(stats.t.ppf(0.5 + 0.5 * checked_confidence(confidence), count - 1))
    return max(float(np.quantile(largest, confidence)), pointwise)
