"""The figures of the outcomes on the bank, with intervals. They are recall, false accepts, errors and times."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import beta

from lidarium.benchmarks.studies.merging.bank.bank import Pair
from lidarium.benchmarks.studies.merging.bank.pairs import PLENTY
from lidarium.benchmarks.studies.merging.trials import Outcome

Tried = Sequence[tuple[Pair, Outcome]]

SAME_PLACE = ("positive", "refurnished")
NEGATIVE, UNDECIDABLE = ("negative", "look_alike"), ("symmetric", "indistinct")


@dataclass(frozen=True, slots=True)
class Share:
    """A share of some trials with its Clopper-Pearson interval (95 %)."""

    hits: int
    total: int

    @property
    def value(self) -> float:
        """The share; nan of no trials."""
        return self.hits / self.total if self.total else math.nan

    @property
    def low(self) -> float:
        """Lower end."""
        return float(beta.ppf(0.025, self.hits, self.total - self.hits + 1)) if self.hits else 0.0

    @property
    def high(self) -> float:
        """Upper end; of no hits that of a one-sided interval."""
        if self.hits == self.total:
            return 1.0
        return float(beta.ppf(0.975 if self.hits else 0.95, self.hits + 1, self.total - self.hits))

    def __str__(self) -> str:
        if not self.total:
            return "-"
        return f"{100 * self.value:.1f} % ({self.hits} of {self.total}; {100 * self.low:.1f} to {100 * self.high:.1f})"


def is_plenty(pair: Pair) -> bool:
    """Return whether a pair is of one place with much overlap, moved furniture or not."""
    return pair.category in SAME_PLACE and pair.overlap >= PLENTY


def is_little(pair: Pair) -> bool:
    """Return whether a pair is of one place with little overlap."""
    return pair.category in SAME_PLACE and pair.overlap < PLENTY


def is_refurnished(pair: Pair) -> bool:
    """Return whether a pair is of one place whose furniture was taken away between its maps."""
    return pair.category == "refurnished"


def recall(tried: Tried, of: Callable[[Pair], bool], above: float = -math.inf) -> Share:
    """Return the share of some positives that are joined where they belong.

    They are accepted by a confidence above a threshold.
    """
    chosen = [outcome for pair, outcome in tried if of(pair)]
    return Share(sum(one.is_accepted and one.is_exact and one.confidence > above for one in chosen), len(chosen))


def accepted(tried: Tried, categories: Sequence[str], above: float = -math.inf) -> Share:
    """Return the share of the pairs of some categories that are accepted.

    They are accepted by a confidence above a threshold.
    """
    chosen = [outcome for pair, outcome in tried if pair.category in categories]
    return Share(sum(one.is_accepted and one.confidence > above for one in chosen), len(chosen))


def refused(tried: Tried, categories: Sequence[str]) -> Share:
    """Return the share of the pairs of some categories that are refused."""
    share = accepted(tried, categories)
    return Share(share.total - share.hits, share.total)


def wrong_positives(tried: Tried) -> Share:
    """Return the share of positives that are joined by a wrong transform. It is more than 0.5 m or 5 degrees off."""
    chosen = [outcome for pair, outcome in tried if pair.category in SAME_PLACE]
    return Share(sum(one.is_accepted and not _is_near(one) for one in chosen), len(chosen))


def safe_threshold(tried: Tried, categories: Sequence[str] = NEGATIVE) -> float:
    """Return the least confidence above which no pair of some categories is accepted."""
    return max((one.confidence for pair, one in tried if pair.category in categories and one.is_accepted), default=0.0)


def errors(tried: Tried) -> tuple[float, float, float]:
    """Return the errors of positives that were accepted.

    They are the median and the 95th percentile of the distance [m], and the median angle [rad].
    """
    found = [
        (one.distance_m, one.angle)
        for pair, one in tried
        if pair.category in SAME_PLACE and one.is_accepted and one.distance_m is not None
    ]
    if not found:
        return math.nan, math.nan, math.nan
    distances, angles = np.array(found, np.float64).T
    return float(np.median(distances)), float(np.quantile(distances, 0.95)), float(np.median(angles))


@dataclass(frozen=True, slots=True)
class Times:
    """Times of pairs [ms]: how many, the median, and the 95th percentile."""

    count: int
    median: float
    p95: float

    def __str__(self) -> str:
        return "-" if not self.count else f"{self.median:.0f} / {self.p95:.0f}"


def times(tried: Tried, of: Callable[[Outcome], bool] = lambda _: True) -> Times:
    """Return the times of pairs of standard maps."""
    found = [one.time_ms for _, one in tried if one.is_standard and of(one)]
    return (
        Times(len(found), float(np.median(found)), float(np.quantile(found, 0.95)))
        if found
        else Times(0, math.nan, math.nan)
    )


def _is_near(outcome: Outcome) -> bool:
    return (
        outcome.distance_m is not None
        and outcome.distance_m <= 0.5
        and outcome.angle is not None
        and outcome.angle <= math.radians(5.0)
    )
