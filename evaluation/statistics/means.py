"""Means, interquartile means and paired comparisons.

The values are all known; the intervals are studentised bootstrap intervals.

References
----------
Interquartile mean: Agarwal et al., Deep reinforcement learning at the edge of the statistical precipice
(NeurIPS 2021). Its standard error: Tukey and McLaughlin (1963), from the winsorised variance.
"""

import math

import numpy as np
from numpy.typing import ArrayLike

from lidarium.evaluation.statistics.resampling import (
    RESAMPLES,
    Counts,
    Replicates,
    in_parts,
    studentised_interval,
)
from lidarium.evaluation.statistics.samples import Interval, Values, checked_pairs, checked_values


def mean_interval(
    values: ArrayLike, confidence: float = 0.95, resamples: int = RESAMPLES, seed: int = 0
) -> Interval:
    """Return the mean and its studentised bootstrap interval.

    Parameters
    ----------
    values : (n,) array_like
        The sample.
    confidence : float
        How often the interval shall hold the truth.
    resamples, seed : int
        Number of resamples, and where their draws come from.
    """
    sample = checked_values(values)
    return studentised_interval(in_parts(_means(sample)), len(sample), confidence, resamples, seed)


def interquartile_mean(values: ArrayLike) -> float:
    """Return the mean of the middle half.

    Of the values at its ends only the part that lies within counts.
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
    confidence, resamples, seed
        As in `mean_interval`.
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
    confidence, resamples, seed
        As in `mean_interval`.

    Raises
    ------
    ValueError
        Where a value is not above 0.
    """
    first, second = checked_pairs(a, b)
    for name, sample in (("a", first), ("b", second)):
        if (sample <= 0.0).any():
            index = int(np.flatnonzero(sample <= 0.0)[0])
            raise ValueError(f"{name}[{index}] is {sample[index]}; want values above 0 for a ratio")
    replicates = in_parts(_means(np.log(first) - np.log(second)))
    return exponential(
        studentised_interval(replicates, len(first), confidence, resamples, seed, is_symmetric=True)
    )


def exponential(interval: Interval) -> Interval:
    """Return an interval of a logarithm as one of what it is the logarithm of."""
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
