"""Checks of settings: each names the setting, its value and what would be right."""

import math
from collections.abc import Iterable


def check_positive(settings: object, whose: str, names: Iterable[str]) -> None:
    """Raise ValueError where a named setting is not a finite number above 0."""
    for name in names:
        if not 0.0 < getattr(settings, name) < math.inf:
            raise ValueError(f"{name} of {whose} is {getattr(settings, name)}; want a number above 0")


def check_from_zero(settings: object, whose: str, names: Iterable[str]) -> None:
    """Raise ValueError where a named setting is not a finite number of 0 or more."""
    for name in names:
        if not 0.0 <= getattr(settings, name) < math.inf:
            raise ValueError(f"{name} of {whose} is {getattr(settings, name)}; want a number of 0 or more")
