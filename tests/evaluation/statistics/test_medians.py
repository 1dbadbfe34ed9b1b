import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from lidarium.evaluation.statistics import median_bands, median_interval

samples = st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=60)


def test_ten_values_are_held_between_the_second_and_the_ninth():
    found = median_interval(range(1, 11), is_interpolated=False)
    assert (found.estimate, found.low, found.high) == (5.5, 2.0, 9.0)


def test_the_whole_ranks_are_those_of_scipys_quantile_test():
    for size in (6, 7, 20, 51, 200):
        values = np.arange(size, dtype=float) ** 1.3
        ends = stats.quantile_test(values).confidence_interval(0.95)
        found = median_interval(values, is_interpolated=False)
        assert (found.low, found.high) == (ends.low, ends.high), size


def test_interpolation_goes_the_way_of_hettmansperger_and_sheather():
    # n = 10: 97.85 % between ranks 2 and 9, 89.06 % between 3 and 8; I = 0.3243, share = 8 I / (2 + 6 I).
    outer, inner = 1 - 2 * 11 / 1024, 1 - 2 * 56 / 1024
    part = (outer - 0.95) / (outer - inner)
    share = 8 * part / (2 + 6 * part)
    found = median_interval(range(1, 11))
    assert (found.low, found.high) == pytest.approx((2 + share, 9 - share))


def test_too_few_values_bound_nothing():
    assert median_interval([3.0, 1.0, 2.0, 4.0, 5.0]).low == -np.inf
    assert median_interval([3.0, 1.0, 2.0, 4.0, 5.0]).high == np.inf
    assert np.isfinite(median_interval(range(6)).high)


def test_what_never_happened_is_later_than_everything():
    found = median_interval([1, 2, 3, 4, 5, 6, 7, np.inf, np.inf, np.inf])
    assert (found.estimate, found.high) == (5.5, np.inf)
    assert median_interval([1.0, np.inf]).estimate == np.inf
    assert median_interval([np.inf] * 8).low == np.inf


@given(samples)
def test_the_median_lies_in_its_interval_and_interpolation_makes_it_narrower(values):
    found, whole = median_interval(values), median_interval(values, is_interpolated=False)
    assert found.estimate == pytest.approx(np.median(values))
    assert whole.low <= found.low <= found.estimate <= found.high <= whole.high


@given(samples, st.floats(0.5, 0.98))
def test_more_confidence_makes_it_no_narrower(values, confidence):
    found, wider = median_interval(values, confidence), median_interval(values, confidence + 0.01)
    assert wider.low <= found.low + 1e-6
    assert wider.high >= found.high - 1e-6


@given(samples)
def test_it_turns_with_the_sample(values):
    found, turned = median_interval(values), median_interval([-value for value in values])
    assert (turned.low, turned.high) == pytest.approx((-found.high, -found.low), abs=1e-6)


def test_bands_are_the_intervals_of_the_columns():
    values = np.random.default_rng(1).normal(size=(30, 4))
    bands = median_bands(values)
    for column in range(4):
        found = median_interval(values[:, column])
        assert bands[:, column].tolist() == [found.estimate, found.low, found.high]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ([], "values are empty"),
        ([1.0, np.nan], r"values\[1\] is nan; want numbers or inf"),
        ([-np.inf], "want numbers or inf"),
        ([[1.0]], "one dimension"),
    ],
)
def test_bad_samples_are_refused(values, message):
    with pytest.raises(ValueError, match=message):
        median_interval(values)


@pytest.mark.parametrize("confidence", [0.0, 1.0, 95.0, np.nan])
def test_a_confidence_is_a_probability(confidence):
    with pytest.raises(ValueError, match="more than 0 and less than 1"):
        median_interval([1.0, 2.0], confidence)
