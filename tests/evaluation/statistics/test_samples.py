"""Samples are checked before anything is made of them."""

import numpy as np
import pytest

from lidarium.evaluation.statistics.samples import (
    FEWEST_FOR_NOMINAL,
    Interval,
    checked_confidence,
    checked_pairs,
    checked_values,
)


def test_a_sample_becomes_an_array_of_floats():
    found = checked_values([1, 2, 3])
    assert found.dtype == np.float64
    assert found.tolist() == [1.0, 2.0, 3.0]


def test_what_never_happened_is_infinite_where_that_is_allowed():
    assert checked_values([1.0, np.inf], allow_infinite=True)[1] == np.inf
    with pytest.raises(ValueError, match=r"times\[1\] is inf; want finite numbers"):
        checked_values([1.0, np.inf], "times")
    for bad in (-np.inf, np.nan):
        with pytest.raises(ValueError, match=r"values\[0\] is .*; want numbers or inf"):
            checked_values([bad], allow_infinite=True)


def test_tables_and_nothing_are_no_samples():
    with pytest.raises(ValueError, match=r"times have shape \(1, 2\); want one dimension"):
        checked_values([[1.0, 2.0]], "times")
    with pytest.raises(ValueError, match="times are empty"):
        checked_values([], "times")


def test_each_value_of_a_pair_has_its_partner():
    a, b = checked_pairs([1, 2], [3, 4])
    assert (a.tolist(), b.tolist()) == ([1.0, 2.0], [3.0, 4.0])
    with pytest.raises(ValueError, match="ours has 2 values and theirs has 1"):
        checked_pairs([1, 2], [3], ("ours", "theirs"))


@pytest.mark.parametrize("confidence", [0.0, 1.0, -0.5, 95.0, float("nan")])
def test_a_confidence_lies_between_0_and_1(confidence):
    with pytest.raises(ValueError, match="confidence is"):
        checked_confidence(confidence)


def test_an_interval_is_nominal_from_a_size_on():
    few, enough = (Interval(0.0, -1.0, 1.0, 0.95, FEWEST_FOR_NOMINAL - k) for k in (1, 0))
    assert (few.is_nominal, enough.is_nominal) == (False, True)
