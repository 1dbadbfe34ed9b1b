"""Samples, and how they are drawn again."""

import numpy as np
import pytest

from lidarium.evaluation.statistics.samples import (
    FEWEST_FOR_NOMINAL,
    Interval,
    checked_confidence,
    checked_pairs,
    checked_values,
    in_parts,
    resample_counts,
    studentised_interval,
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


def test_each_resample_draws_as_many_values_as_there_are():
    counts = resample_counts(7, 1100, 0)
    assert counts.shape == (1100, 7)
    assert (counts.sum(axis=1) == 7).all()
    assert counts.mean(axis=0) == pytest.approx(np.ones(7), abs=0.15)


def mean_of(values):
    """Return the mean and its standard error of each resample."""

    def replicates(counts):
        means = counts @ values / len(values)
        return means, np.sqrt(counts @ values**2 / len(values) - means**2) / np.sqrt(len(values))

    return replicates


def test_counts_are_kept_and_cannot_be_changed():
    counts = resample_counts(5, 100, 1)
    assert counts is resample_counts(5, 100, 1)
    with pytest.raises(ValueError, match="read-only"):
        counts[0, 0] = 9
    assert not np.array_equal(counts, resample_counts(5, 100, 2))


def test_parts_give_what_the_whole_gives():
    values = np.random.default_rng(0).normal(size=9)
    counts = resample_counts(9, 1201, 3)
    for part, whole in zip(in_parts(mean_of(values))(counts), mean_of(values)(counts), strict=True):
        assert part.shape == (1201,)
        assert np.allclose(part, whole)


def test_the_symmetric_form_reaches_equally_far_to_both_sides():
    values = np.random.default_rng(1).exponential(3.0, 40)
    even = studentised_interval(mean_of(values), 40, 0.9, 500, 0, scale=1.0, is_symmetric=True)
    tailed = studentised_interval(mean_of(values), 40, 0.9, 500, 0, scale=1.0)
    assert even.estimate == tailed.estimate == pytest.approx(values.mean())
    assert even.high - even.estimate == pytest.approx(even.estimate - even.low)
    assert tailed.high - tailed.estimate > tailed.estimate - tailed.low
    wider = studentised_interval(mean_of(values), 40, 0.99, 500, 0, scale=1.0)
    assert wider.low < tailed.low < tailed.high < wider.high


@pytest.mark.parametrize("size", [0, 65_536])
def test_sizes_that_cannot_be_counted_are_refused(size):
    with pytest.raises(ValueError, match=f"the sample has {size:,} values; want 1 to 65,535"):
        resample_counts(size, 100, 0)
