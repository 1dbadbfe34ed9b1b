"""Medians with intervals from order statistics.

The interval from the d-th smallest to the d-th largest of n values holds the median with probability 1 - 2
P(Binomial(n, 1/2) < d), whatever the distribution. d is whole, so the best of these intervals is wider than
asked for; interpolation between it and the next narrower one brings the probability close to the one asked
for.

References
----------
Hettmansperger and Sheather, Confidence intervals based on interpolated order statistics, Statistics and
Probability Letters 4 (1986). Nyblom, Note on interpolated order statistics, Statistics and Probability
Letters 14 (1992).
"""

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from lidarium.evaluation.statistics.samples import Interval, Values, checked_confidence, checked_values


def median_interval(values: ArrayLike, confidence: float = 0.95, is_interpolated: bool = True) -> Interval:
    """Return the median and its interval by order statistics.

    Parameters
    ----------
    values : (n,) array_like
        The sample; inf stands for the time of what did not happen before the horizon, so medians and ends of
        intervals may be inf.
    confidence : float
        How often the interval shall hold the median.
    is_interpolated : bool
        Whether to interpolate towards the next narrower interval (about ``confidence``); otherwise the
        interval between two of the values that holds the median with at least ``confidence``.

    Returns
    -------
    Interval
        From -inf to inf where even the least and the greatest value do not hold the median often enough (n <
        6 at 0.95).
    """
    ordered = np.sort(checked_values(values, allow_infinite=True))
    size, tail = len(ordered), 0.5 * (1.0 - checked_confidence(confidence))
    median = _between(ordered[(size - 1) // 2], ordered[size // 2], 0.5)
    rank, share = _rank_and_share(size, tail)
    if rank < 1:
        return Interval(median, -np.inf, np.inf, confidence, size)
    if not is_interpolated:
        return Interval(median, float(ordered[rank - 1]), float(ordered[-rank]), confidence, size)
    low = _between(ordered[rank - 1], ordered[rank], share)
    high = _between(ordered[size - rank], ordered[size - rank - 1], share)
    return Interval(median, low, high, confidence, size)


def median_bands(values: Values, confidence: float = 0.95) -> Values:
    """Return the median of each column and the ends of its interval, (3, k).

    The values (n, k) are finite.

    For curves over time; the same figures as `median_interval` gives column by column.
    """
    columns = [median_interval(column, confidence) for column in np.asarray(values, np.float64).T]
    return np.array([[each.estimate, each.low, each.high] for each in columns]).T


@lru_cache(maxsize=1024)
def _rank_and_share(size: int, tail: float) -> tuple[int, float]:
    """Return the greatest rank d with P(Binomial(n, 1/2) < d) <= tail, and a share.

    The share is how far to go from there to rank d + 1.

    The latter is equation 2 of Hettmansperger and Sheather. Rank 0 where there is none.
    """
    rank = int(stats.binom.ppf(tail, size, 0.5))
    if stats.binom.cdf(rank, size, 0.5) <= tail:
        rank += 1
    if rank < 1:
        return 0, 0.0
    outer, inner = (1.0 - 2.0 * stats.binom.cdf(d - 1, size, 0.5) for d in (rank, rank + 1))
    part = (outer - (1.0 - 2.0 * tail)) / (outer - inner)
    return rank, float((size - rank) * part / (rank + (size - 2 * rank) * part))


def _between(start: float, end: float, share: float) -> float:
    """Return ``(1 - share) start + share end`` where either may be infinite."""
    if share <= 0.0 or start == end:
        return float(start)
    return float(start + share * (end - start)) if np.isfinite(start) and np.isfinite(end) else float(np.inf)
