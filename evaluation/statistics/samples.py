"""Samples: checks, estimates with their intervals, and studentised bootstrap intervals.

A resample of n values is a row of counts that sum to n. Statistics are computed from the counts and the
sample itself, which costs no copies, and the same rows serve every statistic of samples of one size.

References
----------
Efron and Tibshirani, An Introduction to the Bootstrap (1993), section 12.5. Hall, Theoretical comparison of
bootstrap confidence intervals, Annals of Statistics 16 (1988): with equal tails the studentised interval
follows skewness. Hall, On symmetric bootstrap confidence intervals, Journal of the Royal Statistical Society
B 50 (1988): the symmetric form suits nearly symmetric distributions.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

Values = NDArray[np.float64]

FEWEST_FOR_NOMINAL = 50
"""Sample size from which intervals hold the truth about as often as stated.

See docs/results/interval_coverage.md.
"""


@dataclass(frozen=True, slots=True)
class Interval:
    """An estimate and its confidence interval.

    Attributes
    ----------
    estimate : float
        The estimate.
    low, high : float
        Ends of the interval, -inf or inf if the sample does not bound it.
    confidence : float
        Probability that such an interval holds the truth.
    size : int
        Number of values, pairs or runs.
    """

    estimate: float
    low: float
    high: float
    confidence: float
    size: int

    @property
    def is_nominal(self) -> bool:
        """Whether the sample is large enough for the interval to be nominal.

        The interval then holds the truth with the stated probability.
        """
        return self.size >= FEWEST_FOR_NOMINAL


def checked_values(values: ArrayLike, name: str = "values", allow_infinite: bool = False) -> Values:
    """Return a sample as (n,) float64."""
    sample = np.asarray(values, np.float64)
    if sample.ndim != 1:
        raise ValueError(f"{name} have shape {sample.shape}; want one dimension")
    if not len(sample):
        raise ValueError(f"{name} are empty; want at least one")
    is_bad = np.isnan(sample) | np.isneginf(sample) if allow_infinite else ~np.isfinite(sample)
    if is_bad.any():
        first = int(np.flatnonzero(is_bad)[0])
        wanted = "numbers or inf" if allow_infinite else "finite numbers"
        raise ValueError(f"{name}[{first}] is {sample[first]}; want {wanted}")
    return sample


def checked_pairs(a: ArrayLike, b: ArrayLike, names: tuple[str, str] = ("a", "b")) -> tuple[Values, Values]:
    """Return the two samples of paired values, each (n,) float64."""
    first, second = checked_values(a, names[0]), checked_values(b, names[1])
    if len(first) != len(second):
        raise ValueError(
            f"{names[0]} has {len(first)} values and {names[1]} has {len(second)}; want as many, each with its partner"
        )
    return first, second


def checked_confidence(confidence: float) -> float:
    """Return a confidence between 0 and 1."""
    if not 0.0 < confidence < 1.0:
        raise ValueError(f"confidence is {confidence}; want more than 0 and less than 1, such as 0.95")
    return float(confidence)


Counts = NDArray[np.uint16]

RESAMPLES = 10_000
"""Number of resamples of an interval by default."""

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

    Returns
    -------
    (resamples, size) uint16
        Rows sum to ``size``; read-only, since it is kept for the next call.
    """
    if resamples < FEWEST_RESAMPLES:
        raise ValueError(f"resamples is {resamples}; want at least {FEWEST_RESAMPLES}")
    if not 1 <= size <= MOST_VALUES:
        raise ValueError(f"the sample has {size:,} values; want 1 to {MOST_VALUES:,}: part the episodes by settings")
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
        return np.concatenate([estimates for estimates, _ in parts]), np.concatenate([errors for _, errors in parts])

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

    With equal tails it goes from estimate - q_high error to estimate - q_low error; the symmetric form takes the
    quantile of |t| on both sides. An error of 0, if all values are equal, gives an interval of no width.
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
        ratios = np.where(errors > 0.0, shifts / errors, np.where(shifts == 0.0, 0.0, np.copysign(np.inf, shifts)))
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
