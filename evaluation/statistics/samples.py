"""Samples: checks, estimates with their intervals, Student's and studentised bootstrap intervals.

A sample of fewer than 6 values, or of equal ones, has no interval; one of 6 to 10 has Student's, larger ones have
the studentised bootstrap's: with so few, too many resamples have hardly any error to divide by.

A resample of n values is a row of counts that sum to n. Statistics are computed from the counts and the
sample itself, which costs no copies, and the same rows serve every statistic of samples of one size. Values of one
cluster, such as runs on one floor, are not independent: clusters are drawn whole, and the errors of their values
are added before they are squared (Cameron, Gelbach and Miller 2008). The size of a sample is then the number of
its clusters.

References
----------
Efron and Tibshirani, An Introduction to the Bootstrap (1993), section 12.5. Hall, Theoretical comparison of
bootstrap confidence intervals, Annals of Statistics 16 (1988): with equal tails the studentised interval
follows skewness. Hall, On symmetric bootstrap confidence intervals, Journal of the Royal Statistical Society
B 50 (1988): the symmetric form suits nearly symmetric distributions. Cameron, Gelbach and Miller, Bootstrap-based
improvements for inference with clustered errors, Review of Economics and Statistics 90 (2008).
"""

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

Values = NDArray[np.float64]

FEWEST_FOR_NOMINAL = 50
"""Sample size from which intervals hold the truth about as often as stated.

See docs/results/interval_coverage.md.
"""

FEWEST_FOR_INTERVAL = 6
"""Sample size from which there is an interval."""

FEWEST_FOR_BOOTSTRAP = 11
"""Sample size from which intervals of means are the bootstrap's instead of Student's."""


@dataclass(frozen=True, slots=True)
class Interval:
    """An estimate and its confidence interval.

    Attributes
    ----------
    estimate : float
        The estimate.
    low, high : float
        Ends of the interval. Both are infinite if there is none: fewer than 6 values, or all of them equal; one is
        if the sample does not bound it on that side.
    confidence : float
        Probability that such an interval holds the truth.
    size : int
        Number of values, pairs or runs, or of clusters of them.
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

    @property
    def is_known(self) -> bool:
        """Whether there is an interval."""
        return math.isfinite(self.low) or math.isfinite(self.high)

    def __format__(self, spec: str) -> str:
        """Return the estimate and the ends of the interval, each by a format of numbers; inf is a dash.

        They have more digits if both ends would look the same: no interval is of zero width.
        """
        if not self.is_known:
            return f"{format(self.estimate, spec)} (no interval)"
        digits = re.search(r"\.(\d)[ef%]?$", spec)
        if digits and self.low < self.high and format(self.low, spec) == format(self.high, spec) and digits[1] < "9":
            return format(self, f"{spec[: digits.start(1)]}{int(digits[1]) + 1}{spec[digits.end(1) :]}")
        low, high = (format(end, spec) if math.isfinite(end) else "-" for end in (self.low, self.high))
        return f"{format(self.estimate, spec)} ({low} to {high})"

    def excludes(self, value: float) -> bool:
        """Return whether the interval lies on one side of a value."""
        return value < self.low or value > self.high


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


def cluster_indices(clusters: ArrayLike | None, size: int) -> tuple[NDArray[np.int64], int]:
    """Return the index of each value's cluster, (size,), and the number of clusters; by default each is its own."""
    if clusters is None:
        return np.arange(size), size
    names = np.asarray(clusters)
    if names.shape != (size,):
        raise ValueError(f"clusters have shape {names.shape} for {size} values; want the name of one for each value")
    found, indices = np.unique(names, return_inverse=True)
    return indices, len(found)


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


def no_interval(estimate: float, confidence: float, size: int) -> Interval:
    """Return an estimate whose sample says nothing about its error."""
    return Interval(estimate, -math.inf, math.inf, confidence, size)


def studentised_interval(
    replicates: Replicates,
    size: int,
    confidence: float,
    resamples: int,
    seed: int,
    *,
    scale: float,
    degrees: int | None = None,
    is_symmetric: bool = False,
    bounds: tuple[float, float] = (-math.inf, math.inf),
) -> Interval:
    """Return an estimate and its studentised interval.

    The interval is from the quantiles q of t = (estimate* - estimate) / error* over resamples; from Student's
    distribution if there are fewer than `FEWEST_FOR_BOOTSTRAP` values; none if there are fewer than
    `FEWEST_FOR_INTERVAL`, or if the error is only rounding.

    With equal tails it goes from estimate - q_high error to estimate - q_low error; the symmetric form takes the
    quantile of |t| on both sides.

    Parameters
    ----------
    scale : float
        Size of the values: errors are rounding if they are much smaller.
    degrees : int or None, default None
        Degrees of freedom of Student's distribution; by default one less than there are values.
    bounds : (float, float), default unbounded
        Least and greatest value that the truth may have; ends beyond are moved there.
    """
    tail = 0.5 * (1.0 - checked_confidence(confidence))
    resample_counts(size, resamples, seed)  # checks the size and the number of resamples
    (estimate,), (error,) = (found.tolist() for found in replicates(np.ones((1, size), np.uint16)))
    negligible = _ROUNDING * scale
    if size < FEWEST_FOR_INTERVAL or error <= negligible:
        return no_interval(estimate, confidence, size)
    if size < FEWEST_FOR_BOOTSTRAP:
        # Errors are of n values; Student's are of n - 1.
        reach = float(stats.t.ppf(1.0 - tail, degrees or size - 1)) * math.sqrt(size / (size - 1.0))
        low, high = estimate - reach * error, estimate + reach * error
    else:
        estimates, errors = replicates(resample_counts(size, resamples, seed))
        shifts = estimates - estimate
        # A resample of equal values has no error: it is as far off as can be, or not at all.
        far = np.where(np.abs(shifts) <= negligible, 0.0, np.copysign(np.inf, shifts))
        ratios = np.where(errors > negligible, shifts / np.maximum(errors, negligible), far)
        if is_symmetric:
            reach = _ranked(np.abs(ratios), 1.0 - 2.0 * tail)
            low, high = estimate - reach * error, estimate + reach * error
        else:
            low, high = estimate - _ranked(ratios, 1.0 - tail) * error, estimate - _ranked(ratios, tail) * error
        if not (math.isfinite(low) and math.isfinite(high)):
            return no_interval(estimate, confidence, size)
    return Interval(estimate, max(low, bounds[0]), min(high, bounds[1]), confidence, size)


_ROUNDING = 1e-9
"""Errors below this share of the values are rounding: variances, their squares, have 16 digits."""


def _ranked(ratios: Values, share: float) -> float:
    """Return the value of rank (number + 1) share.

    No rounding of the number of resamples makes it too near the middle.
    """
    rank = min(max(round((len(ratios) + 1) * share), 1), len(ratios))
    return float(np.partition(ratios, rank - 1)[rank - 1])
