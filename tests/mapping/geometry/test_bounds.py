"""Bounds of numbers, and rules of settings."""

import math
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
import pytest

from lidarium.mapping.geometry.bounds import (
    Bounds,
    above,
    check_settings,
    inner,
    rules_of,
    share,
    shown,
    within,
)


def test_bounds_tell_themselves():
    assert str(within(1, 64)) == "from 1 to 64"
    assert str(above(0.0, 5.0)) == "above 0 and at most 5"
    assert str(within(0.0, 1e6)) == "of 0 or more and at most 1,000,000"
    assert within(1, 64).interval == "[1, 64]"
    assert Bounds(0.0, 1.0, has_maximum=False).interval == "[0, 1)"
    assert not within(0.0, 1.0).hold(math.nan)


def test_what_is_shown_is_never_longer_than_a_line():
    deep: list = []
    for _ in range(10_000):
        deep = [deep, deep]
    for value in (10**5000, "x" * 10_000, list(range(10_000)), deep, np.zeros(10_000)):
        assert len(shown(value)) <= 100


@dataclass(frozen=True)
class Part:
    depth: float = 1.0


@dataclass(frozen=True)
class Sample:
    count: Annotated[int, within(1, 5)] = 2
    ratio: Annotated[float | None, share(has_maximum=False)] = 0.5
    name: str = "a"
    part: Annotated[Part, inner(depth=above(0.0, 2.0))] = field(default_factory=Part)

    def __post_init__(self):
        check_settings(self, "the sample")


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"count": 6}, "count of the sample is 6; want a whole number from 1 to 5"),
        ({"count": 2.0}, "count of the sample is 2.0; want a whole number"),
        ({"count": True}, "count of the sample is True"),
        ({"ratio": 1.0}, "ratio of the sample is 1.0; want a share of 0 or more and below 1, or None"),
        ({"ratio": math.nan}, "ratio of the sample is nan"),
        ({"name": 3}, "name of the sample is 3; want text"),
        ({"part": Part(0.0)}, "depth of part is 0.0; want a number above 0"),
        ({"part": None}, "part of the sample is None; want Part"),
    ],
)
def test_a_setting_of_another_kind_or_out_of_bounds_is_named_with_what_to_want(wrong, message):
    with pytest.raises(ValueError, match=message):
        Sample(**wrong)


def test_settings_within_their_bounds_pass_at_both_ends():
    for values in (
        {"count": 1},
        {"count": np.int64(5)},
        {"ratio": 0.0},
        {"ratio": None},
        {"part": Part(2.0)},
    ):
        assert Sample(**values)


def test_rules_say_what_a_setting_has_to_be():
    rules = rules_of(Sample)
    assert list(rules) == ["count", "ratio", "name", "part"]
    assert (rules["count"].kind, rules["ratio"].is_optional) == (int, True)
    assert list(rules["part"].inner) == ["depth"]
