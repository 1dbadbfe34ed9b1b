"""The figures of a report: of each policy, and of policies against a baseline, pair by pair."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.evaluation.analysis.episodes import Row
from lidarium.evaluation.analysis.groups import Group, paired, times_to
from lidarium.evaluation.episodes.result import METRICS
from lidarium.evaluation.metrics import Column
from lidarium.evaluation.statistics import (
    FEWEST_FOR_INTERVAL,
    Interval,
    PairedTest,
    holm,
    interquartile_mean_interval,
    mean_interval,
    mean_share_interval,
    median_interval,
    optimality_gap,
    paired_difference,
    paired_ratio,
    probability_of_improvement,
    restricted_difference,
    restricted_mean,
    restricted_ratio,
    sign_test,
    wilcoxon_test,
)


@dataclass(frozen=True, slots=True)
class OverBound:
    """The times to 99 % beside their bounds, of the runs that have one.

    Attributes
    ----------
    ratio : Interval
        Median of the times over their bounds.
    gap : Interval or None
        Optimality gap: mean share of the time that is above the bound; None if a run missed 99 % within a horizon that
        is below its bound, so that its share is unknown.
    """

    ratio: Interval
    gap: Interval | None


def over_bound(rows: Sequence[Row], horizon_s: float, seed: int = 0) -> OverBound | None:
    """Return the times to 99 % relative to their bounds; None if no run has a bound.

    Times not reached are later than all others in the median, and the horizon in the gap. Runs that see the floor from
    their starts are left out.
    """
    bounded = [row for row in rows if row.get("bound_s") and row["t99_s"] != 0.0]
    if not bounded:
        return None
    times, clusters = times_to(bounded, "t99_s", horizon_s), clusters_of(bounded)
    bounds = np.array([row["bound_s"] for row in bounded])
    is_known = (times.is_reached | (bounds < horizon_s)).all()
    return OverBound(
        median_interval(times.or_never / bounds, clusters=clusters),
        optimality_gap(times.up_to_horizon, bounds, seed=seed, clusters=clusters) if is_known else None,
    )


TIMES = {key: METRICS[key].title for key in ("t90_s", "t99_s")}
"""Keys of times to a share of the floor, and their titles."""


_NOT_FIGURES = ("robots", "seed", "horizon_s", "t99_over_bound", *TIMES)
"""Numbers of rows that are shown elsewhere."""


@dataclass(frozen=True, slots=True)
class Value:
    """A column of tables: a number that every run has."""

    metric: str
    column: Column

    def of(self, row: Row) -> float:
        """Return the number of a run."""
        return self.column.of(row[self.metric])


def values_of(rows: Sequence[Row]) -> tuple[Value, ...]:
    """Return the columns of all metrics that every run has a value for."""
    return tuple(
        Value(name, column)
        for name, metric in METRICS.items()
        for column in metric.columns
        if all(row.get(name) is not None for row in rows)
    )


@dataclass(frozen=True, slots=True)
class TimeFigure:
    """When the runs of a policy reached a share of the floor.

    Attributes
    ----------
    reached, size, cut : int
        Number of runs that did, of all runs, and of those cut before the horizon without it.
    success : Interval
        Share of the runs that did, up to the horizon.
    median : Interval
        Median time of all runs; inf is later than the horizon.
    restricted_mean : Interval or None
        Restricted mean, of min(time, horizon); None if no run reached the share or if cuts leave it unknown.
    """

    reached: int
    size: int
    cut: int
    success: Interval
    median: Interval
    restricted_mean: Interval | None


@dataclass(frozen=True, slots=True)
class ValueFigure:
    """A figure of all runs of a policy: its median, mean and interquartile mean."""

    median: Interval
    mean: Interval
    interquartile_mean: Interval


@dataclass(frozen=True, slots=True)
class Comparison:
    """A policy against the baseline, pair by pair, in one figure.

    Attributes
    ----------
    policy, key : str
        The policy and the figure.
    pairs : int
        Number of pairs.
    values : (pairs, 2) nested tuples
        The figures of policy and baseline, of the first `FEWEST_FOR_INTERVAL` pairs.
    difference, ratio : Interval or None
        Policy less baseline, policy over baseline; of times, of their restricted means. None if there is
        none.
    improvement : Interval or None
        Probability that a run of the policy is better than one of the baseline on the same floor, ties counted half;
        None if neither direction of the figure is better.
    wilcoxon, sign : PairedTest
        Tests; less means that the policy has the smaller figure.
    p_holm : float
        Wilcoxon's p value, corrected for the number of comparisons of the table.
    is_beyond_chance : bool
        Whether both say that policy and baseline differ: ``p_holm`` is below 0.05 and the interval of the difference
        excludes 0. Ranks weigh every pair alike, means weigh long times more; if only one says so, neither is sure.
    """

    policy: str
    key: str
    pairs: int
    values: tuple[tuple[float, float], ...]
    difference: Interval | None
    ratio: Interval | None
    improvement: Interval | None
    wilcoxon: PairedTest
    sign: PairedTest
    p_holm: float
    is_beyond_chance: bool = False


def clusters_of(rows: Sequence[Row]) -> list[str] | None:
    """Return the floor of each run, the cluster that it belongs to; None if runs count as independent.

    With `FEWEST_FOR_INTERVAL` floors or more, figures are about floors like these, on which runs are not independent.
    With fewer they are about these floors alone.
    """
    floors = [str(row["floor"]) for row in rows]
    return floors if FEWEST_FOR_INTERVAL <= len(set(floors)) < len(floors) else None


def time_figure(rows: Sequence[Row], key: str, horizon_s: float, seed: int) -> TimeFigure:
    """Return the figures of a time to a share of the floor."""
    clusters = clusters_of(rows)
    found = times_to(rows, key, horizon_s)
    reached = int(found.is_reached.sum())
    try:
        mean = restricted_mean(found.times, found.is_reached, horizon_s, seed=seed, clusters=clusters)
    except ValueError:
        # None reached the share, or the longest run was cut before the horizon.
        mean = None
    return TimeFigure(
        reached,
        len(rows),
        found.cut,
        mean_share_interval(found.is_reached, clusters=clusters),
        median_interval(found.or_never, clusters=clusters),
        mean,
    )


def value_figure(
    values: Sequence[float],
    seed: int,
    clusters: Sequence[str] | None = None,
    bounds: tuple[float, float] = (-np.inf, np.inf),
) -> ValueFigure:
    """Return the figures of a value that every run has."""
    return ValueFigure(
        median_interval(values, clusters=clusters),
        mean_interval(values, seed=seed, clusters=clusters, bounds=bounds),
        interquartile_mean_interval(values, seed=seed, clusters=clusters, bounds=bounds),
    )


def further_keys(rows: Sequence[Row], values: Sequence[Value]) -> list[str]:
    """Return the keys, apart from times and values, under which runs have numbers; those of some may be null."""
    told = {*_NOT_FIGURES, *(value.metric for value in values)}
    candidates = [key for key in rows[0] if key not in told and not key.endswith("_sha256")]
    return [
        key
        for key in candidates
        if all(row.get(key, "") is None or _is_number(row.get(key, "")) for row in rows)
        and (is_time(key) or any(row[key] is not None for row in rows))
    ]


def further_figure(rows: Sequence[Row], key: str) -> Interval:
    """Return the median of any other figure, of the runs that have it.

    A time that was not reached is later than all others.
    """
    known = [row for row in rows if is_time(key) or row[key] is not None]
    values = [np.inf if row[key] is None else float(row[key]) for row in known]
    return median_interval(values, clusters=clusters_of(known))


def compared(group: Group, values: Sequence[Value], baseline: str, seed: int) -> list[Comparison]:
    """Return the comparisons of all other policies with the baseline.

    Those without a pair are left out.
    """
    found = []
    for policy, rows in group.runs.items():
        ours, theirs = paired(rows, group.runs[baseline])
        if policy != baseline and ours:
            found += [_compared_times(policy, key, ours, theirs, group.horizon_s, seed) for key in TIMES]
            found += [
                _compared_values(policy, value, ours, theirs, seed) for value in values if value.column.is_compared
            ]
    if not found:
        return []
    corrected = holm([each.wilcoxon.p_value for each in found])
    return [
        replace(
            each,
            p_holm=float(p_value),
            is_beyond_chance=bool(p_value < 0.05 and each.difference is not None and each.difference.excludes(0.0)),
        )
        for each, p_value in zip(found, corrected, strict=True)
    ]


def _compared_times(
    policy: str, key: str, ours: Sequence[Row], theirs: Sequence[Row], horizon_s: float, seed: int
) -> Comparison:
    a, b = times_to(ours, key, horizon_s), times_to(theirs, key, horizon_s)
    difference = ratio = None
    clusters = clusters_of(ours)
    try:
        difference = restricted_difference(a.censored, b.censored, seed=seed, clusters=clusters)
        ratio = restricted_ratio(a.censored, b.censored, seed=seed, clusters=clusters)
    except ValueError:
        # As above: without restricted means there is nothing to subtract; the tests still tell which was
        # faster.
        pass
    ours_s, theirs_s = a.up_to_horizon, b.up_to_horizon
    # Nothing is known of a run after it was cut: unless the other was there before, neither was sooner.
    is_open = (a.is_cut & ~(b.is_reached & (b.times <= a.times))) | (b.is_cut & ~(a.is_reached & (a.times <= b.times)))
    ours_s[is_open] = theirs_s[is_open] = horizon_s
    improvement = None
    if not is_open.any():
        improvement = probability_of_improvement(a.or_never, b.or_never, clusters=clusters)
    return _tested(policy, key, ours_s, theirs_s, difference, ratio, improvement, clusters)


def _compared_values(policy: str, value: Value, ours: Sequence[Row], theirs: Sequence[Row], seed: int) -> Comparison:
    a, b = (np.array([value.of(row) for row in rows]) for rows in (ours, theirs))
    clusters = clusters_of(ours)
    difference = paired_difference(a, b, seed=seed, clusters=clusters)
    ratio = paired_ratio(a, b, seed=seed, clusters=clusters) if min(a.min(), b.min()) > 0.0 else None
    sign = {"higher": -1.0, "lower": 1.0, None: 0.0}[value.column.direction]
    improvement = probability_of_improvement(sign * a, sign * b, clusters=clusters) if sign else None
    return _tested(policy, value.column.key, a, b, difference, ratio, improvement, clusters)


def _tested(
    policy: str,
    key: str,
    a: NDArray[np.float64],
    b: NDArray[np.float64],
    difference: Interval | None,
    ratio: Interval | None,
    improvement: Interval | None,
    clusters: Sequence[str] | None,
) -> Comparison:
    values = tuple(zip(a[:FEWEST_FOR_INTERVAL].tolist(), b[:FEWEST_FOR_INTERVAL].tolist(), strict=True))
    found = Comparison(
        policy, key, len(a), values, difference, ratio, improvement, wilcoxon_test(a, b), sign_test(a, b), 1.0
    )
    if clusters is None:
        return found
    # A floor counts once in the tests, with the mean over its runs.
    floors = np.array(clusters)
    a, b = (np.array([each[floors == floor].mean() for floor in np.unique(floors)]) for each in (a, b))
    return replace(found, wilcoxon=wilcoxon_test(a, b), sign=sign_test(a, b))


def is_time(key: str) -> bool:
    """Whether a key is that of a time to a share of the floor."""
    return key.startswith("t") and key.endswith("_s") and key[1:-2].isdigit()


def _is_number(value: Any) -> bool:  # noqa: ANN401
    return isinstance(value, int | float) and not isinstance(value, bool)
