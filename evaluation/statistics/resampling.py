"""Studentised bootstrap intervals from how often each value is drawn.

A resample of n values is a row of counts that sum to n. Statistics are computed from the counts and the
sample itself, which costs no copies, and the same rows serve every statistic of samples of one size.

References
----------
Efron and Tibshirani, An Introduction to the Bootstrap (1993), section 12.5. Hall, Theoretical comparison of
bootstrap confidence intervals, Annals of Statistics 16 (1988): with equal tails the studentised interval
follows skewness. Hall, On symmetric bootstrap confidence intervals, Journal of the Royal Statistical Society
B 50 (1988): the symmetric form suits what is nearly symmetric.
"""

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from lidarium.evaluation.statistics.samples import Interval, Values, checked_confidence

Counts = NDArray[np.uint16]

RESAMPLES = 10_000
"""Resamples of an interval unless something else is asked for."""

FEWEST_RESAMPLES = 100
MOST_VALUES = 65_535
"""Largest sample."""

_CHUNK = 500

Replicates = Callable[[Counts], tuple[Values, Values]]
"""Function from counts (resamples, n) to the statistic of each resample.

It also gives the standard error of each; both have shape (resamples,).
"""


@lru_cache(maxsize=8)
def resample_counts(size: int, resamples: int, seed: int) -> Counts:
    """Return how often each of ``size`` values is drawn in each resample.

    Parameters
    ----------
    size, resamples : int
        Size of the sample, number of resamples.
    seed : int
        Where all draws come from.

    Returns
    -------
    (resamples, size) uint16
        Rows sum to ``size``; read-only, since it is kept for the next call.

    Raises
    ------
    ValueError
        Where there are too few resamples or too many values.
    """
    if resamples < FEWEST_RESAMPLES:
        raise ValueError(f"resamples is {resamples}; want at least {FEWEST_RESAMPLES}")
    if not 1 <= size <= MOST_VALUES:
        raise ValueError(
            f"the sample has {size:,} values; want 1 to {MOST_VALUES:,}: part the episodes by settings"
        )
    generator = np.random.default_rng(seed)
    counts = np.empty((resamples, size), np.uint16)
    for first in range(0, resamples, _CHUNK):
        rows = min(_CHUNK, resamples - first)
        drawn = generator.integers(0, size, (rows, size)) + size * np.arange(rows)[:, np.newaxis]
        counts[first : first + rows] = np.bincount(drawn.ravel(), minlength=rows * size).reshape(rows, size)
    counts.setflags(write=False)
    return counts


def in_parts(replicates: Replicates) -> Replicates:
    """Return the same function, working on some resamples at a time.

    Its intermediate results thus stay small.
    """

    def in_turn(counts: Counts) -> tuple[Values, Values]:
        parts = [replicates(counts[first : first + _CHUNK]) for first in range(0, len(counts), _CHUNK)]
        return np.concatenate([estimates for estimates, _ in parts]), np.concatenate(
            [errors for _, errors in parts]
        )

    return in_turn


def studentised_interval(
    replicates: Replicates,
    size: int,
    confidence: float,
    resamples: int,
    seed: int,
    is_symmetric: bool = False,
) -> Interval:
    """Return an estimate and its studentised interval.

    The interval is from the quantiles q of t = (estimate* - estimate) / error* over resamples.

    With equal tails it goes from estimate - q_high error to estimate - q_low error; the symmetric form takes
    the quantile of |t| on both sides. An error of 0, where all values are equal, gives an interval of no
    width.

    Parameters
    ----------
    replicates : callable
        Gives the statistic and its standard error of resamples, the sample itself among them.
    size : int
        Size of the sample.
    confidence : float
        How often the interval shall hold the truth.
    resamples, seed : int
        Number of resamples, and where their draws come from.
    is_symmetric : bool
        Whether both sides are of one length.
    """
    tail = 0.5 * (1.0 - checked_confidence(confidence))
    counts = resample_counts(size, resamples, seed)
    (estimate,), (error,) = (found.tolist() for found in replicates(np.ones((1, size), np.uint16)))
    if error <= 0.0:
        return Interval(estimate, estimate, estimate, confidence, size)
    estimates, errors = replicates(counts)
    shifts = estimates - estimate
    # A resample of equal values has no error: it is as far off as can be, or not at all.
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = np.where(
            errors > 0.0, shifts / errors, np.where(shifts == 0.0, 0.0, np.copysign(np.inf, shifts))
        )
    if is_symmetric:
        reach = _ranked(np.abs(ratios), 1.0 - 2.0 * tail)
        return Interval(estimate, estimate - reach * error, estimate + reach * error, confidence, size)
    low, high = _ranked(ratios, tail), _ranked(ratios, 1.0 - tail)
    return Interval(estimate, estimate - high * error, estimate - low * error, confidence, size)


def _ranked(ratios: Values, share: float) -> float:
    """Return the value of rank (number + 1) share.

    No rounding of the number of resamples makes it too near the middle.
    """
    rank = min(max(round((len(ratios) + 1) * share), 1), len(ratios))
    return float(np.partition(ratios, rank - 1)[rank - 1])
