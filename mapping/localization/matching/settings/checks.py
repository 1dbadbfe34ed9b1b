"""The check that all settings of localization share."""

from dataclasses import fields
from typing import Any

from lidarium.mapping.geometry.checks import check_from_zero, check_positive


def check_numbers(settings: Any, zero: tuple[str, ...] = ()) -> None:  # noqa: ANN401
    """Check that all numbers are positive, but those that may be zero."""
    whose = type(settings).__name__
    check_from_zero(settings, whose, zero)
    check_positive(settings, whose, (entry.name for entry in fields(settings) if entry.name not in zero))
