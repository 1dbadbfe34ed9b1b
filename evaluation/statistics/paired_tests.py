"""Tests of whether the partners of pairs differ, singly and in a table.

Holm's correction is for several tests in one table.

References
----------
Wilcoxon, Biometrics Bulletin 1 (1945). Holm, A simple sequentially rejective multiple test procedure,
Scandinavian Journal of Statistics 6 (1979).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from lidarium.evaluation.statistics.samples import Values, checked_pairs, checked_values

MOST_EXACT = 50
"""Wilcoxon's test is exact for so many unequal pairs, and by the normal distribution beyond."""

_ROUNDING = 1e-9
"""Differences below this share of the values are rounding."""


@dataclass(frozen=True, slots=True)
class PairedTest:
    """The result of a paired test.

    Attributes
    ----------
    p_value : float
        Probability of this difference or a larger one by chance, two-sided; 1 if all pairs are ties.
    size : int
        Number of pairs.
    less, greater, ties : int
        Pairs with a < b, with a > b, and with equal values; ties are no evidence and left out of the test.
    """

    p_value: float
    size: int
    less: int
    greater: int
    ties: int


def wilcoxon_test(a: ArrayLike, b: ArrayLike) -> PairedTest:
    """Test by Wilcoxon's signed ranks whether ``a - b`` lies around 0.

    Parameters
    ----------
    a, b : (n,) array_like
        Values of the two partners of each pair.
    """
    differences = _differences(a, b)
    less, greater, ties = _signs(differences)
    if less + greater == 0:
        return PairedTest(1.0, len(differences), 0, 0, ties)
    unequal = differences[differences != 0.0]
    p_value = (
        _exact_p_value(unequal)
        if len(unequal) <= MOST_EXACT
        else min(float(stats.wilcoxon(unequal, method="approx").pvalue), 1.0)
    )
    return PairedTest(p_value, len(differences), less, greater, ties)


def _exact_p_value(differences: Values) -> float:
    """Return the probability of a smaller sum of signed ranks, or one as small, over all signs; ties share ranks."""
    doubled = np.round(2.0 * stats.rankdata(np.abs(differences))).astype(np.int64)
    whole = int(doubled.sum())
    # Of all 2^n signs, how many give each sum of the ranks of positive differences.
    numbers = np.zeros(whole + 1)
    numbers[0] = 1.0
    for rank in doubled:
        numbers[rank:] = numbers[rank:] + numbers[: whole + 1 - rank]
    positive = int(doubled[differences > 0.0].sum())
    return float(min(2.0 * numbers[: min(positive, whole - positive) + 1].sum() / numbers.sum(), 1.0))


def sign_test(a: ArrayLike, b: ArrayLike) -> PairedTest:
    """Test whether a is as often below b as above.

    The size of differences does not count.

    Parameters
    ----------
    a, b : (n,) array_like
        Values of the two partners of each pair.
    """
    differences = _differences(a, b)
    less, greater, ties = _signs(differences)
    p_value = float(stats.binomtest(less, less + greater).pvalue) if less + greater else 1.0
    return PairedTest(p_value, len(differences), less, greater, ties)


def holm(p_values: ArrayLike) -> Values:
    """Return p values corrected for how many there are.

    They are the least times m, the next times m - 1, and so on, never falling.

    A table in which those below 0.05 are taken for real holds a false one with a probability of at most 0.05.

    Parameters
    ----------
    p_values : (m,) array_like
        From 0 to 1.
    """
    given = checked_values(p_values, "p_values")
    if (given < 0.0).any() or (given > 1.0).any():
        raise ValueError(f"p_values reach from {given.min():g} to {given.max():g}; want 0 to 1")
    order = np.argsort(given, kind="stable")
    corrected = np.empty_like(given)
    corrected[order] = np.minimum(np.maximum.accumulate(given[order] * np.arange(len(given), 0, -1)), 1.0)
    return corrected


def _differences(a: ArrayLike, b: ArrayLike) -> Values:
    """Return the differences of pairs in whole steps of rounding: its residue would split ties at random."""
    first, second = checked_pairs(a, b)
    step = _ROUNDING * float(max(np.abs(first).max(), np.abs(second).max()))
    return np.asarray(np.round((first - second) / step) * step if step > 0.0 else first - second)


def _signs(differences: Values) -> tuple[int, int, int]:
    return int((differences < 0.0).sum()), int((differences > 0.0).sum()), int((differences == 0.0).sum())
