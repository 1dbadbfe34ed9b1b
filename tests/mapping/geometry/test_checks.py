"""Checks of settings name the setting, its value and what would be right."""

import math
from types import SimpleNamespace

import pytest

from lidarium.mapping.geometry.checks import check_from_zero, check_positive


def settings(value):
    return SimpleNamespace(speed=1.0, gap=value)


@pytest.mark.parametrize("value", [0.0, -1.0, math.inf, math.nan])
def test_what_is_not_above_zero_is_refused_by_name(value):
    with pytest.raises(ValueError, match=rf"gap of the robot is {value}; want a number above 0"):
        check_positive(settings(value), "the robot", ("speed", "gap"))


@pytest.mark.parametrize("value", [-1e-9, math.inf, math.nan])
def test_what_is_below_zero_is_refused_by_name(value):
    with pytest.raises(ValueError, match=rf"gap of the robot is {value}; want a number of 0 or more"):
        check_from_zero(settings(value), "the robot", ("speed", "gap"))


def test_numbers_that_are_right_or_not_named_pass():
    check_from_zero(settings(0.0), "the robot", ("speed", "gap"))
    check_positive(settings(1e-9), "the robot", ("speed", "gap"))
    check_positive(settings(-5.0), "the robot", ("speed",))
