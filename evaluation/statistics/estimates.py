"""Medians, means, interquartile means and shares of runs with confidence intervals, and paired comparisons.

The interval of a median is from the d-th smallest to the d-th largest of n values, which holds the median
with probability 1 - 2 P(Binomial(n, 1/2) < d)for any distribution. d is whole, so the best of these
intervals is wider than asked for; interpolation between it and the next narrower one brings the probability
close to the one asked for. Intervals of means are studentised ones (`samples`), those of shares Wilson's.

References
----------
Hettmansperger and Sheather, Confidence intervals based on interpolated order
statistics, Statistics and Probability Letters 4 (1986). Nyblom, Note on interpolated order statistics,
Statistics and Probability Letters 14 (1992). Interquartile mean: Agarwal et al., Deep reinforcement learning
at the edge of the statistical precipice (NeurIPS 2021). Its standard error: Tukey and McLaughlin (1963), from
the winsorised variance. Shares: Wilson, Journal of the American Statistical Association 22 (1927). Brown, Cai
and DasGupta, Interval estimation for a binomial proportion, Statistical Science 16 (2001): close to nominal
in the mean over shares, also for few runs and shares near 0 or 1. Shares of clusters: Korn and Graubard, Confidence
intervals for proportions with small expected number of positive counts, Survey Methodology 24 (1998). Medians of
clusters: Woodruff, Confidence intervals for medians and other position measures, JASA 47 (1952).
"""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse, stats

from lidarium.evaluation.statistics.samples import (
    FEWEST_FOR_INTERVAL,
    RESAMPLES,
    Counts,
    Interval,
    Replicates,
    Values,
    checked_confidence,
    checked_pairs,
    checked_values,
    cluster_indices,
    in_parts,
    no_interval,
    studentised_interval,
)


def median_interval(
    values: ArrayLike,
    confidence: float = 0.95,
    is_interpolated: bool = True,
    clusters: ArrayLike | None = None,
) -> Interval:
    """Return the median and its interval by order statistics.

    Parameters
    ----------
    values : (n,) array_like
        The sample; inf is the time of events after the horizon, so medians and ends of
        intervals may be inf. There is no interval if the values between its ends are all the same.
    is_interpolated : bool, default True
        Whether ends lie between order statistics, so that the probability is close to ``confidence``.
    clusters : (n,) array_like or None, default None
        As in `mean_interval`. The interval is then Woodruff's: the order statistics at the ends of the interval of
        the share of values up to the median.
    """
    sample = checked_values(values, allow_infinite=True)
    ordered = np.sort(sample)
    size, tail = len(ordered), 0.5 * (1.0 - checked_confidence(confidence))
    median = _between(ordered[(size - 1) // 2], ordered[size // 2], 0.5)
    indices, groups = cluster_indices(clusters, size)
    if groups < size:
        less, equal = sample < median, sample == median
        # Values equal to the median count as below in part, so that half of all are: it may lie beyond the horizon.
        below = less + equal * (0.5 * size - less.sum()) / max(equal.sum(), 1)
        found = mean_share_interval(below, confidence, indices)
        low, high = (float(ordered[min(int(share * size), size - 1)]) for share in (found.low, found.high))
        if groups < FEWEST_FOR_INTERVAL or (low == high and math.isfinite(low)):
            return no_interval(median, confidence, groups)
        return Interval(median, low, high, confidence, groups)
    rank, share = _rank_and_share(size, tail)
    if rank < 1 or (ordered[rank - 1] == ordered[-rank] and math.isfinite(ordered[-rank])):
        return no_interval(median, confidence, size)
    if not is_interpolated:
        return Interval(median, float(ordered[rank - 1]), float(ordered[-rank]), confidence, size)
    low = _between(ordered[rank - 1], ordered[rank], share)
    high = _between(ordered[size - rank], ordered[size - rank - 1], share)
    return Interval(median, low, high, confidence, size)


def median_bands(values: Values, confidence: float = 0.95, clusters: ArrayLike | None = None) -> Values:
    """Return the median of each column and the ends of its interval, (3, k).

    The values (n, k) are finite; ``clusters`` (n,) as in `mean_interval`.

    For curves over time; the same figures as `median_interval` gives column by column.
    """
    columns = [median_interval(column, confidence, clusters=clusters) for column in np.asarray(values, np.float64).T]
    # A curve on which all runs agree at some time has a band of no width there.
    ends = [
        (each.low, each.high) if each.is_known or each.size < FEWEST_FOR_INTERVAL else (each.estimate, each.estimate)
        for each in columns
    ]
    return np.array([[each.estimate, *both] for each, both in zip(columns, ends, strict=True)]).T


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


def mean_interval(
    values: ArrayLike,
    confidence: float = 0.95,
    resamples: int = RESAMPLES,
    seed: int = 0,
    clusters: ArrayLike | None = None,
    bounds: tuple[float, float] = (-math.inf, math.inf),
) -> Interval:
    """Return the mean and its studentised interval.

    Parameters
    ----------
    values : (n,) array_like
        The sample.
    clusters : (n,) array_like or None, default None
        What values have in common, such as the floor of their run; by default they are independent.
    bounds : (float, float), default unbounded
        Least and greatest mean that there can be.
    """
    sample = checked_values(values)
    scale = float(np.abs(sample).max())
    indices, size = cluster_indices(clusters, len(sample))
    replicates = in_parts(_means(sample, indices, size))
    return studentised_interval(replicates, size, confidence, resamples, seed, scale=scale, bounds=bounds)


def interquartile_mean(values: ArrayLike) -> float:
    """Return the mean of the middle half.

    Values at its ends count only in part.
    """
    sample = checked_values(values)
    size = len(sample)
    return float(_middle_means(sample, np.arange(size), size)(np.ones((1, size), np.uint16))[0][0])


def interquartile_mean_interval(
    values: ArrayLike,
    confidence: float = 0.95,
    resamples: int = RESAMPLES,
    seed: int = 0,
    clusters: ArrayLike | None = None,
    bounds: tuple[float, float] = (-math.inf, math.inf),
) -> Interval:
    """Return the interquartile mean and its studentised interval.

    Parameters as `mean_interval`.
    """
    sample = checked_values(values)
    ordered = np.sort(sample)
    indices, size = cluster_indices(clusters, len(sample))
    return studentised_interval(
        in_parts(_middle_means(sample, indices, size)),
        size,
        confidence,
        resamples,
        seed,
        scale=float(np.abs(ordered[len(ordered) // 4 : len(ordered) - len(ordered) // 4]).max()),
        degrees=size - 2 * (size // 4) - 1,
        bounds=bounds,
    )


def paired_difference(
    a: ArrayLike,
    b: ArrayLike,
    confidence: float = 0.95,
    resamples: int = RESAMPLES,
    seed: int = 0,
    clusters: ArrayLike | None = None,
) -> Interval:
    """Return the mean of ``a - b`` over pairs and its studentised interval.

    Parameters
    ----------
    a, b : (n,) array_like
        Values of the two partners of each pair.
    clusters : (n,) array_like or None, default None
        As in `mean_interval`.
    """
    first, second = checked_pairs(a, b)
    scale = float(max(np.abs(first).max(), np.abs(second).max()))
    indices, size = cluster_indices(clusters, len(first))
    replicates = in_parts(_means(first - second, indices, size))
    return studentised_interval(replicates, size, confidence, resamples, seed, scale=scale, is_symmetric=True)


def paired_ratio(
    a: ArrayLike,
    b: ArrayLike,
    confidence: float = 0.95,
    resamples: int = RESAMPLES,
    seed: int = 0,
    clusters: ArrayLike | None = None,
) -> Interval:
    """Return the geometric mean of ``a / b`` over pairs and its interval.

    The interval is a studentised one, made of logarithms.

    Parameters
    ----------
    a, b : (n,) array_like
        Values of the two partners of each pair, above 0.
    clusters : (n,) array_like or None, default None
        As in `mean_interval`.
    """
    first, second = checked_pairs(a, b)
    for name, sample in (("a", first), ("b", second)):
        if (sample <= 0.0).any():
            index = int(np.flatnonzero(sample <= 0.0)[0])
            raise ValueError(f"{name}[{index}] is {sample[index]}; want values above 0 for a ratio")
    indices, size = cluster_indices(clusters, len(first))
    replicates = in_parts(_means(np.log(first) - np.log(second), indices, size))
    return exponential(
        studentised_interval(replicates, size, confidence, resamples, seed, scale=1.0, is_symmetric=True)
    )


def exponential(interval: Interval) -> Interval:
    """Return the interval of a value from that of its logarithm."""
    if not interval.is_known:
        return no_interval(math.exp(interval.estimate), interval.confidence, interval.size)
    low, high = (math.exp(end) if end < 700.0 else math.inf for end in (interval.low, interval.high))
    return Interval(math.exp(interval.estimate), low, high, interval.confidence, interval.size)


def _means(sample: Values, clusters: NDArray[np.int64], size: int) -> Replicates:
    """Return the function that gives means and their standard errors of resamples of clusters."""
    centre = sample.mean()
    sums, numbers = np.zeros(size), np.bincount(clusters, minlength=size).astype(np.float64)
    # Around the mean the sums of squares lose no digits.
    np.add.at(sums, clusters, sample - centre)
    columns = np.stack([sums, numbers, sums**2, sums * numbers, numbers**2], axis=1)

    def replicates(counts: Counts) -> tuple[Values, Values]:
        total, drawn, squares, products, weights = (counts.astype(np.float64) @ columns).T
        shifts = total / drawn
        # The residual of a cluster is its sum less as many times the mean.
        kept = squares - 2.0 * shifts * products + shifts**2 * weights
        kept = np.where(kept > 1e-12 * squares, kept, 0.0)
        return centre + shifts, np.asarray(np.sqrt(kept) / drawn)

    return replicates


def _middle_means(sample: Values, clusters: NDArray[np.int64], size: int) -> Replicates:
    """Return the function that gives interquartile means and their standard errors of resamples of clusters."""
    order = np.argsort(sample, kind="stable")
    ordered, of = sample[order], clusters[order]
    centre, numbers = ordered[len(ordered) // 2], np.bincount(of, minlength=size)
    members = sparse.csr_array((np.ones(len(of)), (of, np.arange(len(of)))), shape=(size, len(of)))

    def replicates(counts: Counts) -> tuple[Values, Values]:
        cumulated = np.cumsum(counts[:, of], axis=1, dtype=np.float64)
        drawn = cumulated[:, -1:]
        first, last = 0.25 * drawn, 0.75 * drawn
        # How much of each value's stretch of ranks lies in the middle half.
        inside = np.diff(np.clip(cumulated, first, last), axis=1, prepend=first)
        low = ordered[(cumulated <= first).sum(axis=1)]
        high = ordered[(cumulated < last).sum(axis=1)]
        winsorised = np.clip(ordered, low[:, np.newaxis], high[:, np.newaxis]) - centre
        sums = np.asarray((members @ winsorised.T).T)
        means = np.einsum("ij,ij->i", counts, sums)[:, np.newaxis] / drawn
        squares = np.einsum("ij,ij->i", counts, sums**2)
        residuals = np.einsum("ij,ij->i", counts, (sums - means * numbers) ** 2)
        # Equal values have no error; rounding leaves a little.
        kept = np.where(residuals > 1e-12 * squares, residuals, 0.0)
        return inside @ ordered / (0.5 * drawn[:, 0]), np.asarray(2.0 * np.sqrt(kept) / drawn[:, 0])

    return replicates


def share_interval(successes: int, size: int, confidence: float = 0.95) -> Interval:
    """Return the share ``successes / size`` and its Wilson interval."""
    if size < 1 or not 0 <= successes <= size:
        raise ValueError(f"{successes} successes of {size} runs; want 1 run at least and 0 to as many successes")
    return _wilson(successes / size, float(size), size, confidence)


def mean_share_interval(shares: ArrayLike, confidence: float = 0.95, clusters: ArrayLike | None = None) -> Interval:
    """Return the mean of values from 0 to 1, such as successes, and its interval.

    It is Wilson's interval of as many independent successes and failures as vary as much (Korn and Graubard): as many
    as there are values if these are successes and failures of independent runs.

    Parameters
    ----------
    shares : (n,) array_like
        Values from 0 to 1.
    clusters : (n,) array_like or None, default None
        As in `mean_interval`; the mean is over all values, whatever their cluster.
    """
    sample = checked_values(shares, "shares")
    if (sample < 0.0).any() or (sample > 1.0).any():
        raise ValueError(f"shares reach from {sample.min():g} to {sample.max():g}; want 0 to 1")
    indices, size = cluster_indices(clusters, len(sample))
    mean = float(sample.mean())
    (error,) = _means(sample, indices, size)(np.ones((1, size), np.uint16))[1].tolist()
    # If all clusters are equal there is one independent success or failure in each.
    equivalent = mean * (1.0 - mean) / error**2 if error > 1e-9 else size
    return _wilson(mean, min(equivalent, len(sample)), size, confidence)


def probability_of_improvement(
    a: ArrayLike, b: ArrayLike, confidence: float = 0.95, clusters: ArrayLike | None = None
) -> Interval:
    """Return the probability that ``a`` is below ``b``, ties counted half, and its interval.

    Every value of a cluster, such as the runs on one floor, is compared with every value of the other sample in that
    cluster; the probability is the mean over clusters (Agarwal et al. 2021).

    Parameters
    ----------
    a, b : (n,) array_like
        Costs, such as times; inf is larger than any other.
    clusters : (n,) array_like or None, default None
        What the runs of both samples have in common; by default each pair is a cluster.
    """
    first, second = (checked_values(each, name, allow_infinite=True) for name, each in (("a", a), ("b", b)))
    if len(first) != len(second):
        raise ValueError(f"a has {len(first)} values and b has {len(second)}; want as many")
    indices, size = cluster_indices(clusters, len(first))
    wins = np.empty(size)
    for cluster in range(size):
        ours, theirs = first[indices == cluster][:, np.newaxis], second[indices == cluster]
        wins[cluster] = (ours < theirs).mean() + 0.5 * (ours == theirs).mean()
    return mean_share_interval(wins, confidence)


def optimality_gap(
    times: ArrayLike,
    bounds: ArrayLike,
    confidence: float = 0.95,
    resamples: int = RESAMPLES,
    seed: int = 0,
    clusters: ArrayLike | None = None,
) -> Interval:
    """Return the mean of ``1 - bound / time``, the share of the time that is above the bound, and its interval.

    Parameters
    ----------
    times, bounds : (n,) array_like
        Time of each run, the horizon or inf if it was not reached, and the least time that there can be, above 0.
    clusters : (n,) array_like or None, default None
        As in `mean_interval`.
    """
    took, least = checked_values(times, "times", allow_infinite=True), checked_values(bounds, "bounds")
    if len(took) != len(least):
        raise ValueError(f"there are {len(took)} times and {len(least)} bounds; want a bound for each time")
    if (least <= 0.0).any() or (took <= 0.0).any():
        raise ValueError(f"the least time is {took.min():g} and the least bound {least.min():g}; want more than 0")
    gaps = np.maximum(1.0 - least / took, 0.0)
    return mean_interval(gaps, confidence, resamples, seed, clusters, (0.0, 1.0))


def _wilson(share: float, trials: float, size: int, confidence: float) -> Interval:
    """Return Wilson's interval of a share of a number of trials, which need not be whole."""
    z = float(stats.norm.ppf(0.5 + 0.5 * checked_confidence(confidence)))
    middle = (share + z * z / (2.0 * trials)) / (1.0 + z * z / trials)
    reach = z / (1.0 + z * z / trials) * math.sqrt(share * (1.0 - share) / trials + (z / (2.0 * trials)) ** 2)
    return Interval(share, max(middle - reach, 0.0), min(middle + reach, 1.0), confidence, size)
