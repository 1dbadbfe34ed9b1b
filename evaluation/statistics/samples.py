"""Shared parts of all statistics: an estimate with its interval, and checks.

The checks are of the values that the statistics are given.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Values = NDArray[np.float64]

FEWEST_FOR_NOMINAL = 50
"""Sample size from which intervals hold the truth about as often as stated.

See docs/results/interval_coverage.md.
"""


@dataclass(frozen=True, slots=True)
class Interval:
    """An estimate and where the truth may lie.

    Attributes
    ----------
    estimate : float
        The estimate.
    low, high : float
        Ends of the interval, -inf or inf where the sample does not bound it.
    confidence : float
        How often such an interval holds the truth.
    size : int
        How many values, pairs or runs it is made of.
    """

    estimate: float
    low: float
    high: float
    confidence: float
    size: int

    @property
    def is_nominal(self) -> bool:
        """Whether the sample is large enough for the interval to be nominal.

        The interval then holds the truth as often as it says.
        """
        return self.size >= FEWEST_FOR_NOMINAL


def checked_values(values: ArrayLike, name: str = "values", allow_infinite: bool = False) -> Values:
    """Return a sample as (n,) float64.

    Parameters
    ----------
    values : array_like
        The sample.
    name : str
        What a message calls it.
    allow_infinite : bool
        Whether inf may be among them, as the time of what never happened.

    Raises
    ------
    ValueError
        Where it is empty, not of one dimension, or holds nan or, unless allowed, infinite values.
    """
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
    """Return the two samples of paired values, each (n,) float64.

    Raises
    ------
    ValueError
        As `checked_values`, and where they differ in length.
    """
    first, second = checked_values(a, names[0]), checked_values(b, names[1])
    if len(first) != len(second):
        raise ValueError(
            f"{names[0]} has {len(first)} values and {names[1]} has {len(second)}; want as many, each with "
            "its partner"
        )
    return first, second


def checked_confidence(confidence: float) -> float:
    """Return a confidence between 0 and 1.

    Raises
    ------
    ValueError
        Where it is not.
    """
    if not 0.0 < confidence < 1.0:
        raise ValueError(f"confidence is {confidence}; want more than 0 and less than 1, such as 0.95")
    return float(confidence)
