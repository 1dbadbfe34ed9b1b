"""Medians, means, interquartile means and shares of runs with confidence intervals, and paired comparisons.

The interval of a median is from the d-th smallest to the d-th largest of n values, which holds the median
with probability 1 - 2 P(Binomial(n, 1/2) < d)for any distribution. d is whole, so the best of these
intervals is wider than asked for; interpolation between it and the next narrower one brings the probability
close to the one asked for. Intervals of means are studentised bootstrap intervals, those of shares Wilson's.

References
----------
Hettmansperger and Sheather, Confidence intervals based on interpolated order
statistics, Statistics and Probability Letters 4 (1986). Nyblom, Note on interpolated order statistics,
Statistics and Probability Letters 14 (1992). Interquartile mean: Agarwal et al., Deep reinforcement learning
at the edge of the statistical precipice (NeurIPS 2021). Its standard error: Tukey and McLaughlin (1963), from
the winsorised variance. Shares: Wilson, Journal of the American Statistical Association 22 (1927). Brown, Cai
and DasGupta, Interval estimation for a binomial proportion, Statistical Science 16 (2001): close to nominal
in the mean over shares, also for few runs and shares near 0 or 1.
"""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from lidarium.evaluation.statistics.samples import (
    RESAMPLES,
    Counts,
    Interval,
    Replicates,
    Values,
    checked_confidence,
    checked_pairs,
    checked_values,
    in_parts,
    studentised_interval,
)


def median_interval(values: ArrayLike, confidence: float = 0.95, is_interpolated: bool = True) -> Interval:
    """Return the median and its interval by order statistics.

    Parameters
    ----------
    values : (n,) array_like
        The sample; inf is the time of events after the horizon, so medians and ends of
        intervals may be inf.
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

    The latter is equation 2 of Hettmansperger and Sheather. Rank 0 if there is none.
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
    """Return ``(1 - share) start + share end`` if either may be infinite."""
    if share <= 0.0 or start == end:
        return float(start)
    return float(start + share * (end - start)) if np.isfinite(start) and np.isfinite(end) else float(np.inf)


def mean_interval(values: ArrayLike, confidence: float = 0.95, resamples: int = RESAMPLES, seed: int = 0) -> Interval:
    """Return the mean and its studentised bootstrap interval.

    Parameters
    ----------
    values : (n,) array_like
        The sample.
    """
    sample = checked_values(values)
    return studentised_interval(in_parts(_means(sample)), len(sample), confidence, resamples, seed)


def interquartile_mean(values: ArrayLike) -> float:
    """Return the mean of the middle half.

    Values at its ends count only in part.
    """
    ordered = np.sort(checked_values(values))
    return float(_middle_means(np.ones((1, len(ordered)), np.uint16), ordered)[0][0])


def interquartile_mean_interval(
    values: ArrayLike, confidence: float = 0.95, resamples: int = RESAMPLES, seed: int = 0
) -> Interval:
    """Return the interquartile mean and its studentised bootstrap interval.

    Parameters as `mean_interval`.
    """
    ordered = np.sort(checked_values(values))
    return studentised_interval(
        in_parts(lambda counts: _middle_means(counts, ordered)), len(ordered), confidence, resamples, seed
    )


def paired_difference(
    a: ArrayLike, b: ArrayLike, confidence: float = 0.95, resamples: int = RESAMPLES, seed: int = 0
) -> Interval:
    """Return the mean of ``a - b`` over pairs and its studentised bootstrap interval.

    Parameters
    ----------
    a, b : (n,) array_like
        Values of the two partners of each pair.
    """
    first, second = checked_pairs(a, b)
    replicates = in_parts(_means(first - second))
    return studentised_interval(replicates, len(first), confidence, resamples, seed, is_symmetric=True)


def paired_ratio(
    a: ArrayLike, b: ArrayLike, confidence: float = 0.95, resamples: int = RESAMPLES, seed: int = 0
) -> Interval:
    """Return the geometric mean of ``a / b`` over pairs and its interval.

    The interval is a studentised bootstrap interval, made of logarithms.

    Parameters
    ----------
    a, b : (n,) array_like
        Values of the two partners of each pair, above 0.
    """
    first, second = checked_pairs(a, b)
    for name, sample in (("a", first), ("b", second)):
        if (sample <= 0.0).any():
            index = int(np.flatnonzero(sample <= 0.0)[0])
            raise ValueError(f"{name}[{index}] is {sample[index]}; want values above 0 for a ratio")
    replicates = in_parts(_means(np.log(first) - np.log(second)))
    return exponential(studentised_interval(replicates, len(first), confidence, resamples, seed, is_symmetric=True))


def exponential(interval: Interval) -> Interval:
    """Return the interval of a value from that of its logarithm."""
    low, high = (math.exp(end) if end < 700.0 else math.inf for end in (interval.low, interval.high))
    return Interval(math.exp(interval.estimate), low, high, interval.confidence, interval.size)


def _means(sample: Values) -> Replicates:
    """Return the function that gives means and their standard errors of resamples."""
    centre = sample.mean()
    # Around the mean the sums of squares lose no digits.
    columns = np.stack([sample - centre, (sample - centre) ** 2], axis=1)

    def replicates(counts: Counts) -> tuple[Values, Values]:
        shifts, squares = (counts.astype(np.float64) @ columns / len(sample)).T
        return centre + shifts, _errors(shifts, squares, len(sample))

    return replicates


def _middle_means(counts: Counts, ordered: Values) -> tuple[Values, Values]:
    """Return interquartile means and their standard errors of resamples.

    The resamples (resamples, n) are of a sorted sample.
    """
    size = len(ordered)
    quarter = 0.25 * size
    cumulated = np.cumsum(counts, axis=1, dtype=np.float64)
    # How much of each value's stretch of ranks lies in the middle half.
    inside = np.diff(np.clip(cumulated, quarter, size - quarter), axis=1, prepend=quarter)
    means = inside @ ordered / (size - 2.0 * quarter)
    low = ordered[(cumulated <= quarter).sum(axis=1)]
    high = ordered[(cumulated < size - quarter).sum(axis=1)]
    centre = ordered[size // 2]
    winsorised = np.clip(ordered, low[:, np.newaxis], high[:, np.newaxis]) - centre
    shifts = np.einsum("ij,ij->i", counts, winsorised) / size
    squares = np.einsum("ij,ij->i", counts, winsorised**2) / size
    return means, 2.0 * _errors(shifts, squares, size)


def _errors(shifts: Values, squares: Values, size: int) -> Values:
    """Return standard errors from means and mean squares.

    0 for equal values, of which rounding leaves a little.
    """
    variances = squares - shifts**2
    return np.asarray(np.sqrt(np.where(variances > 1e-12 * squares, variances, 0.0) / size))


def share_interval(successes: int, size: int, confidence: float = 0.95) -> Interval:
    """Return the share ``successes / size`` and its Wilson interval."""
    if size < 1 or not 0 <= successes <= size:
        raise ValueError(f"{successes} successes of {size} runs; want 1 run at least and 0 to as many successes")
    ends = stats.binomtest(successes, size).proportion_ci(checked_confidence(confidence), method="wilson")
    return Interval(successes / size, float(ends.low), float(ends.high), confidence, size)
