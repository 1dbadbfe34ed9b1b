"""The study ``interval_coverage``: how often the intervals of reports hold a known truth."""

import time
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import integrate, optimize, stats

from lidarium.benchmarks.results_page import in_file
from lidarium.benchmarks.studies.shared.study import Progress, Study, Task, do_missing, kept_lines
from lidarium.evaluation.statistics import (
    FEWEST_FOR_NOMINAL,
    CensoredTimes,
    Interval,
    interquartile_mean_interval,
    mean_bands,
    mean_interval,
    median_interval,
    paired_difference,
    paired_ratio,
    restricted_difference,
    restricted_mean,
    restricted_ratio,
    share_interval,
)

SLOWER = 1.2
"""How much more time the second policy takes."""

CENSORED = 0.2
BAND = "band of a mean curve"
_CORRELATION = 0.5
_TRIALS_OF_A_DRAW = 40
_SEED = 2026

Values = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Family:
    """A distribution of times [s] as scipy has it. It belongs to what is asked for, or goes beyond it."""

    name: str
    times: Any
    is_asked_for: bool = True

    def pairs(self, generator: np.random.Generator, size: int) -> tuple[Values, Values]:
        """Draw the times of both policies, (size,) each, with correlated ranks."""
        first, second = generator.normal(size=(2, size))
        second = _CORRELATION * first + np.sqrt(1.0 - _CORRELATION**2) * second
        return self.times.ppf(stats.norm.cdf(first)), SLOWER * self.times.ppf(stats.norm.cdf(second))

    @property
    def horizon(self) -> float:
        """The time that a fifth of the runs of the first policy miss [s]."""
        return float(self.times.ppf(1.0 - CENSORED))

    def restricted(self, horizon: float, scale: float = 1.0) -> float:
        """Return the true restricted mean of the times, stretched by a scale [s]."""
        return float(scale * integrate.quad(self.times.sf, 0.0, horizon / scale)[0])


FAMILIES = (
    Family("normal, mean 100, sd 15", stats.norm(100.0, 15.0)),
    Family("lognormal, sigma 0.5", stats.lognorm(0.5, scale=100.0)),
    Family("exponential", stats.expon(scale=100.0)),
    Family("lognormal, sigma 1", stats.lognorm(1.0, scale=100.0), is_asked_for=False),
)
ASKED_FOR = tuple(family for family in FAMILIES if family.is_asked_for)


@cache
def _cut_scale(times: Any) -> float:  # noqa: ANN401
    """Return the mean of exponential cuts that come before a fifth of the times [s]."""

    def excess(logarithm: float) -> float:
        rate = np.exp(-logarithm)
        return float(integrate.quad(lambda rank: np.exp(-rate * times.ppf(rank)), 0.0, 1.0)[0]) - (1.0 - CENSORED)

    return float(np.exp(optimize.brentq(excess, 3.0, 9.0)))


@dataclass(frozen=True, slots=True)
class Case(Task):
    """A figure of data of known truth.

    `figure`, `data`: what is estimated, and from what; `truth`: what the interval should hold; `interval`: from a
    generator, the size and a seed of resampling: the interval of one trial. A ``ValueError`` is a refusal;
    `is_asked_for`: whether the interval must hold the truth about as often as it says; others go beyond that.
    """

    figure: str
    data: str
    truth: float
    interval: Callable[[np.random.Generator, int, int], Interval]
    is_asked_for: bool = True

    @property
    def key(self) -> str:
        """Name that no other one of its file has."""
        return f"{self.figure} | {self.data}"


def cases(resamples: int) -> Iterator[Case]:
    """Yield all cases, the figures of one kind one after the other."""
    for family in FAMILIES:
        yield _median(family, False, True)
    for family in FAMILIES:
        yield _median(family, True, True)
    yield _median(FAMILIES[0], False, False)
    draws: dict[str, Any] = {"resamples": resamples}
    for family in FAMILIES:
        yield Case(
            "mean",
            family.name,
            family.times.mean(),
            _on_first(family, partial(mean_interval, **draws)),
            family.is_asked_for,
        )
    for family in ASKED_FOR:
        truth = 2.0 * integrate.quad(family.times.ppf, 0.25, 0.75)[0]
        interval = _on_first(family, partial(interquartile_mean_interval, **draws))
        yield Case("interquartile mean", family.name, truth, interval, family.is_asked_for)
    for family in FAMILIES:
        truth = (1.0 - SLOWER) * family.times.mean()
        yield Case(
            "paired difference",
            family.name,
            truth,
            _on_both(family, partial(paired_difference, **draws)),
            family.is_asked_for,
        )
    for family in FAMILIES:
        yield Case(
            "paired ratio",
            family.name,
            1.0 / SLOWER,
            _on_both(family, partial(paired_ratio, **draws)),
            family.is_asked_for,
        )
    for compare in (None, restricted_difference, restricted_ratio):
        for is_random in (False, True):
            for family in FAMILIES if compare is None else ASKED_FOR:
                yield _restricted(family, is_random, compare, draws)
    for is_simultaneous in (True, False):
        for kind in _CURVES:
            yield _band(kind, is_simultaneous, resamples)
    for share in (0.5, 0.8, 0.95):
        yield Case("success rate", f"true rate {share:g}", share, partial(_share, share), is_asked_for=False)


def _on_first(family: Family, figure: Callable[..., Interval]) -> Callable[[np.random.Generator, int, int], Interval]:
    return lambda generator, size, seed: figure(family.pairs(generator, size)[0], seed=seed)


def _on_both(family: Family, figure: Callable[..., Interval]) -> Callable[[np.random.Generator, int, int], Interval]:
    return lambda generator, size, seed: figure(*family.pairs(generator, size), seed=seed)


def _median(family: Family, is_censored: bool, is_interpolated: bool) -> Case:
    def interval(generator: np.random.Generator, size: int, _seed: int) -> Interval:
        times = family.pairs(generator, size)[0]
        if is_censored:
            times = np.where(times <= family.horizon, times, np.inf)
        return median_interval(times, is_interpolated=is_interpolated)

    figure = "median" if is_interpolated else "median between two of the values (for comparison)"
    data = f"{family.name}{', 20 % cut by the horizon' if is_censored else ''}"
    return Case(figure, data, float(family.times.median()), interval, family.is_asked_for and is_interpolated)


def _restricted(
    family: Family, is_random: bool, compare: Callable[..., Interval] | None, draws: dict[str, int]
) -> Case:
    """Return a case of restricted means: cut by the horizon, or at random before it."""
    # Where runs are cut at random, hardly any is watched for very long: the horizon lies where a quarter is
    # still on its way.
    horizon = float(family.times.ppf(0.75)) if is_random else family.horizon
    scale = _cut_scale(family.times) if is_random else np.inf

    def censored(generator: np.random.Generator, times: Values) -> tuple[Values, NDArray[np.bool_]]:
        cuts = generator.exponential(scale, len(times)) if is_random else np.full(len(times), horizon)
        return np.minimum(times, cuts), times <= cuts

    def interval(generator: np.random.Generator, size: int, seed: int) -> Interval:
        first, second = (censored(generator, times) for times in family.pairs(generator, size))
        if compare is None:
            return restricted_mean(*first, horizon, **draws, seed=seed)
        return compare(CensoredTimes(*first, horizon), CensoredTimes(*second, horizon), **draws, seed=seed)

    of_first, of_second = family.restricted(horizon), family.restricted(horizon, SLOWER)
    figure, truth = {
        None: ("restricted mean", of_first),
        restricted_difference: ("paired difference of restricted means", of_first - of_second),
        restricted_ratio: ("paired ratio of restricted means", of_first / of_second),
    }[compare]
    data = f"{family.name}, 20 % cut {'at random' if is_random else 'by the horizon'}"
    return Case(figure, data, truth, interval, family.is_asked_for)


def _smooth(generator: np.random.Generator, size: int) -> Values:
    places, waves = np.linspace(0.0, 1.0, _POINTS), np.arange(1, 9)
    cosines, sines = generator.standard_normal((2, size, len(waves))) / waves
    angles = np.pi * np.outer(waves, places)
    return np.asarray(cosines @ np.cos(angles) + sines @ np.sin(angles))


def _walk(generator: np.random.Generator, size: int) -> Values:
    return 0.3 * generator.standard_normal((size, 1)) + _steps(generator, size)


def _steps(generator: np.random.Generator, size: int) -> Values:
    return np.asarray(generator.standard_normal((size, _POINTS)).cumsum(axis=1) / np.sqrt(_POINTS))


def _skewed(generator: np.random.Generator, size: int) -> Values:
    logarithms = 0.5 * generator.standard_normal((size, 1)) + 0.5 * _steps(generator, size)
    return np.asarray(np.exp(logarithms) - np.exp(0.125 + 0.125 * np.arange(1, _POINTS + 1) / _POINTS))


_POINTS = 50
_CURVES: dict[str, Callable[[np.random.Generator, int], Values]] = {
    "smooth curves": _smooth,
    "random walks": _walk,
    "noise": lambda generator, size: generator.standard_normal((size, _POINTS)),
    "skewed random walks": _skewed,
}
"""Curves whose true mean is zero at all points."""


def _band(kind: str, is_simultaneous: bool, resamples: int) -> Case:
    """Return a case of mean curves: a trial holds the truth if its band does everywhere."""

    def interval(generator: np.random.Generator, size: int, seed: int) -> Interval:
        curves = _CURVES[kind](generator, size)
        if is_simultaneous:
            mean, low, high = mean_bands(curves, seed=seed, draws=resamples)
        else:
            mean = curves.mean(axis=0)
            width = stats.t.ppf(0.975, size - 1) * curves.std(axis=0, ddof=1) / np.sqrt(size)
            low, high = mean - width, mean + width
        return Interval(float(mean.mean()), float(low.max()), float(high.min()), 0.95, size)

    figure = BAND if is_simultaneous else "intervals at each point of a mean curve (for comparison)"
    return Case(figure, kind, 0.0, interval, is_simultaneous and kind != "skewed random walks")


def _share(share: float, generator: np.random.Generator, size: int, _seed: int) -> Interval:
    return share_interval(int(generator.binomial(size, share)), size)


def held(case: Case, size: int, trials: int) -> tuple[float, int]:
    """Return the share of trials whose interval holds the truth, and how many refused.

    The share is of those that did not refuse.
    """
    generator = np.random.default_rng([_SEED, size, zlib.crc32(f"{case.figure} {case.data}".encode())])
    hits = refused = 0
    for trial in range(trials):
        try:
            found = case.interval(generator, size, trial // _TRIALS_OF_A_DRAW)
        except ValueError:
            refused += 1
        else:
            hits += found.low <= case.truth <= found.high
    return hits / max(trials - refused, 1), refused


SIZES = (6, 8, 10, 20, 50, 100, 200)
WANTED = (0.93, 0.97)
TRIALS, RESAMPLES = 2000, 399
CASES_FILE = "cases.jsonl"

Line = Mapping[str, Any]


def measure(case: Case) -> dict[str, Any]:
    """Measure at all sizes how often the intervals of a case hold the truth."""
    began = time.perf_counter()
    shares = [held(case, size, TRIALS) for size in SIZES]
    return {
        "figure": case.figure,
        "data": case.data,
        "is_asked_for": case.is_asked_for,
        "trials": TRIALS,
        "resamples": RESAMPLES,
        "shares": shares,
        "seconds": time.perf_counter() - began,
    }


def work(folder: Path, _data: Path | None, every: int, _workers: int) -> Progress:
    """Measure every N-th case, in this process alone."""
    yield from do_missing(folder / CASES_FILE, "cases", list(cases(RESAMPLES))[::every], measure, 1)


def is_reached(shares: Sequence[tuple[float, int]]) -> bool:
    """Return whether a case is within `WANTED` at all sizes that count."""
    return all(
        WANTED[0] <= share <= WANTED[1]
        for size, (share, _) in zip(SIZES, shares, strict=True)
        if size >= FEWEST_FOR_NOMINAL
    )


def page(folder: Path) -> str:
    """Return the results as markdown."""
    lines = kept_lines(folder / CASES_FILE)
    trials, resamples, seconds = TRIALS, RESAMPLES, sum(line["seconds"] for line in lines)
    missed = [line for line in lines if line["is_asked_for"] and not is_reached(line["shares"])]
    asked = sum(line["is_asked_for"] for line in lines)
    text = [
        "# How often intervals hold the truth",
        "",
        f"Share of {trials:,} trials in which the 95 % interval holds the known truth, in %, by the number n of runs "
        f"or pairs; {seconds:.0f} s on one core. The standard error is {100.0 * np.sqrt(0.95 * 0.05 / trials):.1f} at "
        f"95 %. Intervals are made of {resamples:,} resamples here, of 10,000 in reports. Required are {_wanted()} for "
        f"n = {FEWEST_FOR_NOMINAL} and more, with normal, skewed and 20 % censored data; for smaller samples reports "
        "warn. Rows marked as beyond are harder than required, or discrete. How each interval is made: "
        "[statistics](../reference/statistics.md).",
        "",
        "Times of two policies are drawn in pairs whose normal scores have a correlation of 0.5; the second policy "
        "takes 1.2 times as long. Cut by the horizon: runs end when the first policy has missed a fifth. Cut at "
        "random: exponential cuts come before a fifth of its times, and the horizon is its upper quartile.",
        "",
        f"**Reached in {asked - len(missed)} of {asked} required rows.**"
        + ("" if not missed else " Missed: " + "; ".join(f"{line['figure']}, {line['data']}" for line in missed) + "."),
        "",
        "## By figure",
        "",
        f"Least and greatest share over the kinds of data, for n below {FEWEST_FOR_NOMINAL} and from there on. "
        "*Refused* is the greatest number of trials in which the longest time was cut before the horizon: the mean up "
        "to there is unknown, the function raises an error, and shares are of the other trials.",
        "",
        *_summary(lines),
        "",
        "## All rows",
        "",
        in_file("\n".join(_table(lines))),
        "",
        "## Bands of a mean curve",
        "",
        *_table([line for line in lines if line["figure"] == BAND]),
    ]
    return "\n".join(text) + "\n"


def _summary(lines: Sequence[Line]) -> list[str]:
    """Return a table with a row for each figure."""
    below = max(size for size in SIZES if size < FEWEST_FOR_NOMINAL)
    rows = [
        f"| figure | rows | n = {SIZES[0]} to {below} | n = {FEWEST_FOR_NOMINAL} to {SIZES[-1]} | refused | "
        f"{_wanted()} from n = {FEWEST_FOR_NOMINAL} |",
        "|---|---:|---:|---:|---:|---|",
    ]
    for figure in dict.fromkeys(line["figure"] for line in lines):
        members = [line for line in lines if line["figure"] == figure]
        shares = [(size, *found) for line in members for size, found in zip(SIZES, line["shares"], strict=True)]
        few = [share for size, share, _ in shares if size < FEWEST_FOR_NOMINAL]
        many = [share for size, share, _ in shares if size >= FEWEST_FOR_NOMINAL]
        cells = [figure, len(members), _range(few), _range(many), max(refused for *_, refused in shares)]
        verdicts = f"{sum(is_reached(line['shares']) for line in members)} of {len(members)}"
        rows.append(f"| {' | '.join(str(cell) for cell in cells)} | {verdicts} |")
    return rows


def _range(shares: Sequence[float]) -> str:
    return f"{100.0 * min(shares):.1f} to {100.0 * max(shares):.1f}"


def _wanted() -> str:
    return f"{100 * WANTED[0]:.0f} to {100 * WANTED[1]:.0f}"


def _table(lines: Sequence[Line]) -> list[str]:
    """Return a table with a row for each figure and kind of data."""
    rows = [
        f"| figure | data | {' | '.join(f'n = {size}' for size in SIZES)} | "
        f"{_wanted()} from n = {FEWEST_FOR_NOMINAL} |",
        "|---|---|" + "---:|" * len(SIZES) + "---|",
    ]
    for line in lines:
        verdict = ("yes" if is_reached(line["shares"]) else "**no**") + ("" if line["is_asked_for"] else " (beyond)")
        cells = [
            f"{100.0 * share:.1f}{f' ({refused} refused)' if refused else ''}" for share, refused in line["shares"]
        ]
        rows.append(f"| {line['figure']} | {line['data']} | {' | '.join(cells)} | {verdict} |")
    return rows


STUDY = Study(page, work=work, quick=10)
