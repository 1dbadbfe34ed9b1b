"""Restricted means of censored times: the mean of min(T, horizon).

Their intervals are studentised ones (`samples`).

A time that was cut before the event is censored: the event comes later than that, at an unknown time. The
restricted mean is the area below the Kaplan-Meier curve S up to a horizon. If all times are known or cut
at the horizon itself, it is the plain mean of min(T, horizon). Standard errors come from each run's influence
on the area, which also gives those of differences and ratios of paired runs: there the influences of both
partners are subtracted run by run.

References
----------
Kaplan and Meier, Journal of the American Statistical Association 53 (1958). Royston and Parmar, Restricted
mean survival time, BMC Medical Research Methodology 13 (2013). Influence: Reid, Annals of Statistics 9
(1981).
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lidarium.evaluation.statistics.estimates import exponential
from lidarium.evaluation.statistics.samples import (
    RESAMPLES,
    Counts,
    Interval,
    Values,
    checked_values,
    cluster_indices,
    studentised_interval,
)
from lidarium.mapping.kernels.compilation import Array, kernel


class _Sample(NamedTuple):
    """Censored times as kernels take them; see ``CensoredTimes``."""

    times: Values
    is_observed: NDArray[np.bool_]
    order: NDArray[np.int64]
    horizon: float


class CensoredTimes:
    """Times of which some are censored, ready for their restricted mean.

    Censored times are known only to be greater.

    Parameters
    ----------
    times : (n,) array_like
        When it happened, or until when it had not happened, 0 or more [s].
    is_observed : (n,) array_like of bool
        Whether it happened.
    """

    def __init__(self, times: ArrayLike, is_observed: ArrayLike, horizon: float) -> None:
        known, happened = _checked_times(times, is_observed)
        if not 0.0 < horizon < math.inf:
            raise ValueError(f"horizon is {horizon}; want a positive number of seconds")
        happened = happened & (known <= horizon)
        longest = float(known.max())
        if longest < horizon and not happened[known == longest].all():
            raise ValueError(
                f"the longest time, {longest:g} s, is censored before the horizon of {horizon:g} s; want a "
                f"horizon of at most {longest:g} s"
            )
        self.times: Values = np.minimum(known, horizon)
        self.is_observed: NDArray[np.bool_] = happened
        self.horizon = float(horizon)
        # At equal times events come before cuts.
        self.order: NDArray[np.int64] = np.lexsort((~happened, self.times))

    def __len__(self) -> int:
        return len(self.times)

    @property
    def arrays(self) -> _Sample:
        """Arguments of the kernels."""
        return _Sample(self.times, self.is_observed, self.order, self.horizon)


def _checked_times(times: ArrayLike, is_observed: ArrayLike) -> tuple[Values, NDArray[np.bool_]]:
    """Return times and whether each was observed, both (n,)."""
    known, happened = checked_values(times, "times"), np.asarray(is_observed, np.bool_)
    if happened.shape != known.shape:
        raise ValueError(f"is_observed has shape {happened.shape} and times {known.shape}; want one for each time")
    if (known < 0.0).any():
        raise ValueError(f"times[{int(np.argmin(known))}] is {known.min()}; want 0 or more seconds")
    return known, happened


def kaplan_meier(times: ArrayLike, is_observed: ArrayLike) -> tuple[Values, Values]:
    """Return event times and the estimated share of runs without the event.

    The share is that of runs in which it has not happened after each time.
    """
    known, happened = _checked_times(times, is_observed)
    moments, events = np.unique(known[happened], return_counts=True)
    at_risk = len(known) - np.searchsorted(np.sort(known), moments, side="left")
    return moments, np.asarray(np.cumprod(1.0 - events / at_risk), np.float64)


def restricted_mean(
    times: ArrayLike,
    is_observed: ArrayLike,
    horizon: float,
    confidence: float = 0.95,
    resamples: int = RESAMPLES,
    seed: int = 0,
    clusters: ArrayLike | None = None,
) -> Interval:
    """Return the restricted mean of censored times [s] and its interval.

    It is a studentised interval, within 0 and the horizon. ``clusters`` (n,) name what runs have in common, such as
    their floor; None by default.
    """
    sample = CensoredTimes(times, is_observed, horizon)
    if not sample.is_observed.any():
        raise ValueError(
            f"none of {len(sample)} times was observed up to the horizon of {horizon:g} s; want one at least"
        )

    indices, size = cluster_indices(clusters, len(sample))

    def replicates(counts: Counts) -> tuple[Values, Values]:
        return _unzipped(_means_of(counts, indices, sample.arrays))

    return studentised_interval(
        replicates, size, confidence, resamples, seed, scale=horizon, bounds=(0.0, sample.horizon)
    )


def restricted_difference(
    a: CensoredTimes,
    b: CensoredTimes,
    confidence: float = 0.95,
    resamples: int = RESAMPLES,
    seed: int = 0,
    clusters: ArrayLike | None = None,
) -> Interval:
    """Return the restricted mean of ``a`` minus that of ``b`` [s] and its interval.

    It is over paired runs, with a studentised interval within the horizon. ``clusters`` as in `restricted_mean`.
    """
    _check_partners(a, b)

    indices, size = cluster_indices(clusters, len(a))

    def replicates(counts: Counts) -> tuple[Values, Values]:
        return _unzipped(_differences_of(counts, indices, a.arrays, b.arrays, False))

    return studentised_interval(
        replicates,
        size,
        confidence,
        resamples,
        seed,
        scale=a.horizon,
        is_symmetric=True,
        bounds=(-a.horizon, a.horizon),
    )


def restricted_ratio(
    a: CensoredTimes,
    b: CensoredTimes,
    confidence: float = 0.95,
    resamples: int = RESAMPLES,
    seed: int = 0,
    clusters: ArrayLike | None = None,
) -> Interval:
    """Return the restricted mean of ``a`` over that of ``b`` and its interval.

    Both are over paired runs; the interval is made of logarithms.

    Parameters and errors as `restricted_difference`; also refused if one of the means is 0.
    """
    _check_partners(a, b)
    for name, sample in (("a", a), ("b", b)):
        if not sample.times.any():
            raise ValueError(f"all times of {name} are 0; want a positive one at least for a ratio")

    indices, size = cluster_indices(clusters, len(a))

    def replicates(counts: Counts) -> tuple[Values, Values]:
        return _unzipped(_differences_of(counts, indices, a.arrays, b.arrays, True))

    return exponential(
        studentised_interval(replicates, size, confidence, resamples, seed, scale=1.0, is_symmetric=True)
    )


def _check_partners(a: CensoredTimes, b: CensoredTimes) -> None:
    if len(a) != len(b):
        raise ValueError(f"a has {len(a)} times and b has {len(b)}; want as many, each with its partner")
    if a.horizon != b.horizon:
        raise ValueError(f"the horizon of a is {a.horizon:g} s and that of b {b.horizon:g} s; want the same")
    if not (a.is_observed.any() or b.is_observed.any()):
        raise ValueError(
            f"nothing was observed up to the horizon of {a.horizon:g} s, neither in a nor in b; want one time at least"
        )


def _unzipped(pairs: Values) -> tuple[Values, Values]:
    return pairs[:, 0], pairs[:, 1]


@kernel
def _means_of(counts: Array, clusters: Array, sample: _Sample) -> Array:
    """Return restricted means and their standard errors, (resamples, 2).

    They are of resamples (resamples, clusters) uint16.
    """
    size = sample.times.size
    found = np.empty((counts.shape[0], 2))
    influences, areas = np.empty(size), np.empty(size)
    totals = np.empty(counts.shape[1])
    for k in range(counts.shape[0]):
        found[k, 0] = _influences_on(counts[k], clusters, sample, areas, influences)
        totals[:] = 0.0
        for i in range(size):
            totals[clusters[i]] += influences[i]
        found[k, 1] = _error(counts[k], totals)
    return found


@kernel
def _differences_of(counts: Array, clusters: Array, a: _Sample, b: _Sample, is_logarithmic: bool) -> Array:
    """Return differences of restricted means and their errors, (resamples, 2).

    The means may be taken as logarithms; the errors are standard errors.
    """
    size = a.times.size
    found = np.empty((counts.shape[0], 2))
    of_a, of_b, areas = np.empty(size), np.empty(size), np.empty(size)
    totals = np.empty(counts.shape[1])
    for k in range(counts.shape[0]):
        mean_a = _influences_on(counts[k], clusters, a, areas, of_a)
        mean_b = _influences_on(counts[k], clusters, b, areas, of_b)
        scale_a = 1.0 / mean_a if is_logarithmic else 1.0
        scale_b = 1.0 / mean_b if is_logarithmic else 1.0
        totals[:] = 0.0
        for i in range(size):
            totals[clusters[i]] += scale_a * of_a[i] - scale_b * of_b[i]
        found[k, 0] = math.log(mean_a / mean_b) if is_logarithmic else mean_a - mean_b
        found[k, 1] = _error(counts[k], totals)
    return found


@kernel
def _error(counts: Array, totals: Array) -> float:
    """Return the standard error from the sums of the influences of each cluster."""
    variance = 0.0
    for cluster in range(totals.size):
        variance += counts[cluster] * totals[cluster] ** 2
    return math.sqrt(variance)


@kernel
def _influences_on(counts: Array, clusters: Array, sample: _Sample, areas: Array, influences: Array) -> float:
    """Return the restricted mean of a resample.

    Write the influence of each run on it; their squares, of independent runs, sum to the variance.

    With c the counts, those of a run's cluster, Y the runs at risk before a time and G the area right of it, the
    influence of run i is sum over events k up to i of c_k G_k / (Y_k (Y_k - c_k)), less G_i / (Y_i - c_i) if i is an
    event: the derivative of the area by the weight of the run. Of known times it is (T_i - mean) / n.
    """
    times, is_observed, order, horizon = sample
    size = times.size
    drawn = 0.0
    for i in range(size):
        drawn += counts[clusters[i]]
    at_risk = drawn
    share, area, last = 1.0, 0.0, 0.0
    for rank in range(size):
        i = order[rank]
        count = float(counts[clusters[i]])
        area += share * (times[i] - last)
        last = times[i]
        areas[rank] = area
        if is_observed[i] and count > 0.0:
            share *= (at_risk - count) / at_risk
        at_risk -= count
    area += share * (horizon - last)
    at_risk = drawn
    hazard = 0.0
    for rank in range(size):
        i = order[rank]
        count = float(counts[clusters[i]])
        influences[i] = 0.0
        if count == 0.0:
            continue
        left = at_risk - count
        influences[i] = hazard
        # Right of the last event of all the area is 0.
        if is_observed[i] and left > 0.0:
            pull = (area - areas[rank]) / (at_risk * left)
            hazard += count * pull
            influences[i] = hazard - at_risk * pull
        at_risk = left
    return float(area)
