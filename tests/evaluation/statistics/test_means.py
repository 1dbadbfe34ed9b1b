import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from lidarium.evaluation.statistics import (
    interquartile_mean,
    interquartile_mean_interval,
    mean_interval,
    paired_difference,
    paired_ratio,
)
from lidarium.evaluation.statistics.resampling import resample_counts

skewed = np.random.default_rng(3).exponential(10.0, 60)


def test_the_mean_of_normal_values_has_about_students_interval():
    values = np.random.default_rng(2).normal(5.0, 2.0, 80)
    found = mean_interval(values)
    low, high = stats.t.interval(0.95, 79, values.mean(), stats.sem(values))
    assert found.estimate == pytest.approx(values.mean())
    assert (found.low, found.high) == pytest.approx((low, high), abs=0.05)


def test_of_skewed_values_the_interval_reaches_further_to_the_long_tail():
    found = mean_interval(skewed)
    assert found.high - found.estimate > 1.2 * (found.estimate - found.low)


def test_the_interval_is_the_studentised_one_of_the_drawn_samples():
    counts = resample_counts(len(skewed), 199, 4)
    drawn = [np.repeat(skewed, row) for row in counts]
    ratios = [(sample.mean() - skewed.mean()) / (sample.std() / np.sqrt(60)) for sample in drawn]
    low, high = np.sort(ratios)[[5 - 1, 195 - 1]]
    found, error = mean_interval(skewed, resamples=199, seed=4), skewed.std() / np.sqrt(60)
    assert (found.low, found.high) == pytest.approx(
        (skewed.mean() - high * error, skewed.mean() - low * error)
    )


def test_draws_come_from_the_seed():
    assert mean_interval(skewed, resamples=500) == mean_interval(skewed, resamples=500)
    assert mean_interval(skewed, resamples=500, seed=1) != mean_interval(skewed, resamples=500)


def test_equal_values_have_an_interval_of_no_width():
    for interval in (mean_interval, interquartile_mean_interval):
        found = interval([0.1] * 30)
        assert (found.estimate, found.low, found.high) == pytest.approx((0.1, 0.1, 0.1))


def test_two_values_bound_nothing():
    found = mean_interval([1.0, 2.0])
    assert (found.low, found.high) == (-np.inf, np.inf)


def test_the_interquartile_mean_is_scipys_trimmed_mean_where_quarters_are_whole():
    for size in (4, 20, 60):
        assert interquartile_mean(skewed[:size]) == pytest.approx(stats.trim_mean(skewed[:size], 0.25))


def test_of_six_values_the_second_and_the_fifth_count_by_half():
    assert interquartile_mean([0.0, 1.0, 2.0, 3.0, 10.0, 100.0]) == pytest.approx(
        (0.5 * 1 + 2 + 3 + 0.5 * 10) / 3
    )


def test_an_outlier_does_not_move_the_interquartile_mean():
    found, with_outlier = (
        interquartile_mean_interval(values) for values in (skewed, np.append(skewed[:-1], 1e9))
    )
    assert with_outlier.estimate == pytest.approx(found.estimate, rel=0.1)
    assert with_outlier.high < 100.0


def test_a_paired_difference_is_symmetric_and_sees_less_noise_than_the_floors_have():
    generator = np.random.default_rng(5)
    floors = generator.normal(100.0, 50.0, 60)
    a, b = floors + generator.normal(3.0, 1.0, 60), floors + generator.normal(0.0, 1.0, 60)
    found = paired_difference(a, b)
    assert found.low < 3.0 < found.high
    assert found.high - found.low < 1.2
    assert found.high - found.estimate == pytest.approx(found.estimate - found.low)


def test_a_paired_ratio_is_the_geometric_mean_of_ratios():
    found = paired_ratio([2.0, 8.0, 4.0], [1.0, 2.0, 4.0])
    assert found.estimate == pytest.approx(2.0)
    turned = paired_ratio([1.0, 2.0, 4.0], [2.0, 8.0, 4.0])
    assert turned.estimate == pytest.approx(0.5)


@settings(max_examples=25)
@given(
    st.lists(st.floats(-100.0, 100.0), min_size=8, max_size=30), st.floats(-50.0, 50.0), st.floats(0.1, 10.0)
)
def test_intervals_move_and_stretch_with_the_values(values, shift, scale):
    sample = np.round(values, 3)
    for interval in (mean_interval, interquartile_mean_interval):
        found, moved = interval(sample, resamples=100), interval(scale * sample + shift, resamples=100)
        expected = [scale * end + shift for end in (found.low, found.high)]
        assert [moved.low, moved.high] == pytest.approx(expected, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: mean_interval([]), "values are empty"),
        (lambda: mean_interval([1.0, np.inf]), r"values\[1\] is inf; want finite"),
        (lambda: mean_interval([1.0, 2.0], resamples=10), "resamples is 10; want at least 100"),
        (lambda: mean_interval([1.0, 2.0], confidence=95), "confidence is 95"),
        (lambda: mean_interval(np.zeros(70_000)), "1 to 65,535"),
        (lambda: paired_difference([1.0, 2.0], [1.0]), "a has 2 values and b has 1"),
        (lambda: paired_difference([1.0], [np.nan]), r"b\[0\] is nan"),
        (lambda: paired_ratio([1.0, 2.0], [1.0, 0.0]), r"b\[1\] is 0.0; want values above 0"),
    ],
)
def test_bad_samples_are_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()
