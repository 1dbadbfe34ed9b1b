"""Studentised intervals from counts of how often each value is drawn."""

import numpy as np
import pytest

from lidarium.evaluation.statistics.resampling import in_parts, resample_counts, studentised_interval


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
    even = studentised_interval(mean_of(values), 40, 0.9, 500, 0, is_symmetric=True)
    tailed = studentised_interval(mean_of(values), 40, 0.9, 500, 0)
    assert even.estimate == tailed.estimate == pytest.approx(values.mean())
    assert even.high - even.estimate == pytest.approx(even.estimate - even.low)
    assert tailed.high - tailed.estimate > tailed.estimate - tailed.low
    wider = studentised_interval(mean_of(values), 40, 0.99, 500, 0)
    assert wider.low < tailed.low < tailed.high < wider.high


@pytest.mark.parametrize("size", [0, 65_536])
def test_sizes_that_cannot_be_counted_are_refused(size):
    with pytest.raises(ValueError, match=f"the sample has {size:,} values; want 1 to 65,535"):
        resample_counts(size, 100, 0)
