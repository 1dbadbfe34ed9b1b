"""Medians, means and shares with intervals."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from lidarium.evaluation.statistics import (
    interquartile_mean,
    interquartile_mean_interval,
    mean_interval,
    mean_share_interval,
    median_bands,
    median_interval,
    optimality_gap,
    paired_difference,
    paired_ratio,
    probability_of_improvement,
    share_interval,
)
from lidarium.evaluation.statistics.samples import resample_counts

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
def test_bad_samples_of_medians_are_refused(values, message):
    with pytest.raises(ValueError, match=message):
        median_interval(values)


@pytest.mark.parametrize("confidence", [0.0, 1.0, 95.0, np.nan])
def test_a_confidence_is_a_probability(confidence):
    with pytest.raises(ValueError, match="more than 0 and less than 1"):
        median_interval([1.0, 2.0], confidence)


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
    assert (found.low, found.high) == pytest.approx((skewed.mean() - high * error, skewed.mean() - low * error))


def test_draws_come_from_the_seed():
    assert mean_interval(skewed, resamples=500) == mean_interval(skewed, resamples=500)
    assert mean_interval(skewed, resamples=500, seed=1) != mean_interval(skewed, resamples=500)


@pytest.mark.parametrize("interval", [mean_interval, interquartile_mean_interval, median_interval])
def test_equal_values_have_no_interval(interval):
    found = interval([0.1] * 30)
    assert found.estimate == pytest.approx(0.1)
    assert not found.is_known
    assert not found.excludes(5.0)


def test_two_values_bound_nothing():
    found = mean_interval([1.0, 2.0])
    assert (found.low, found.high) == (-np.inf, np.inf)


def test_the_interquartile_mean_is_scipys_trimmed_mean_where_quarters_are_whole():
    for size in (4, 20, 60):
        assert interquartile_mean(skewed[:size]) == pytest.approx(stats.trim_mean(skewed[:size], 0.25))


def test_of_six_values_the_second_and_the_fifth_count_by_half():
    assert interquartile_mean([0.0, 1.0, 2.0, 3.0, 10.0, 100.0]) == pytest.approx((0.5 * 1 + 2 + 3 + 0.5 * 10) / 3)


def test_an_outlier_does_not_move_the_interquartile_mean():
    found, with_outlier = (interquartile_mean_interval(values) for values in (skewed, np.append(skewed[:-1], 1e9)))
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
@given(st.lists(st.floats(-100.0, 100.0), min_size=8, max_size=30), st.floats(-50.0, 50.0), st.floats(0.1, 10.0))
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


@pytest.mark.parametrize("size", [6, 8, 10])
def test_intervals_of_few_are_students(size):
    values = skewed[:size]
    expected = stats.ttest_1samp(values, 0.0).confidence_interval(0.95)
    found = mean_interval(values)
    assert (found.low, found.high) == pytest.approx((expected.low, expected.high))
    assert mean_interval(values, bounds=(values.mean() - 0.01, np.inf)).low == pytest.approx(values.mean() - 0.01)


def test_values_of_a_cluster_count_as_one_if_they_are_the_same():
    clusters = np.repeat(np.arange(20), 3)
    for interval in (mean_interval, paired):
        alone, often = interval(skewed[:20]), interval(np.repeat(skewed[:20], 3), clusters=clusters)
        assert (often.size, often.low, often.high) == (20, pytest.approx(alone.low), pytest.approx(alone.high))


def paired(values, **options):
    return paired_ratio(np.exp(values), np.ones(len(values)), **options)


def test_clusters_of_one_change_nothing():
    values = skewed[:40]
    assert mean_interval(values, clusters=np.arange(40)) == mean_interval(values)
    assert median_interval(values, clusters=np.arange(40)) == median_interval(values)


def test_a_median_after_the_horizon_has_a_lower_end_with_clusters_too():
    """Of 40 floors with three runs each a little less than half were in time."""
    times = np.concatenate([np.linspace(300.0, 1700.0, 58), np.full(62, np.inf)])
    np.random.default_rng(5).shuffle(times)
    alone, within = median_interval(times), median_interval(times, clusters=np.repeat(np.arange(40), 3))
    assert alone.estimate == within.estimate == within.high == np.inf
    assert within.low == pytest.approx(alone.low, abs=150.0)


def held_by(interval, trials=400):
    """Return the share of trials in which the interval of clustered values holds their mean or median, 0."""
    generator, hits = np.random.default_rng(3), 0
    clusters = np.repeat(np.arange(25), 4)
    for _ in range(trials):
        values = np.repeat(generator.normal(size=25), 4) + generator.normal(size=100)
        hits += not interval(values, clusters).excludes(0.0)
    return hits / trials


def test_intervals_over_clusters_hold_the_truth_as_often_as_they_say():
    assert held_by(lambda values, clusters: mean_interval(values, clusters=clusters, resamples=400)) > 0.92
    assert held_by(lambda values, clusters: median_interval(values, clusters=clusters)) > 0.92
    assert held_by(lambda values, _: mean_interval(values, resamples=400)) < 0.85


def test_shares_of_independent_runs_are_wilsons():
    for successes, size in ((0, 12), (5, 12), (12, 12), (1, 1)):
        found = mean_share_interval([1.0] * successes + [0.0] * (size - successes))
        expected = share_interval(successes, size)
        assert (found.estimate, found.low, found.high) == pytest.approx(
            (expected.estimate, expected.low, expected.high)
        )
        ends = stats.binomtest(successes, size).proportion_ci(method="wilson")
        assert (found.low, found.high) == pytest.approx((ends.low, ends.high))


def test_shares_of_floors_on_which_all_runs_end_alike_are_those_of_floors():
    floors = np.array([1.0, 0.0, 1.0, 1.0, 0.0, 1.0, 1.0])
    found = mean_share_interval(np.repeat(floors, 5), clusters=np.repeat(np.arange(7), 5))
    expected = share_interval(5, 7)
    assert (found.low, found.high) == pytest.approx((expected.low, expected.high))


def test_the_probability_of_improvement_is_that_of_mann_and_whitney():
    generator = np.random.default_rng(7)
    a, b = generator.integers(0, 9, 30).astype(float), generator.integers(2, 11, 30).astype(float)
    found = probability_of_improvement(a, b, clusters=np.zeros(30, int))
    assert found.estimate == pytest.approx(stats.mannwhitneyu(b, a).statistic / 900.0)
    assert probability_of_improvement([1.0, 2.0, np.inf], [2.0, np.inf, np.inf]).estimate == pytest.approx(2.5 / 3.0)
    never = probability_of_improvement([np.inf] * 8, [1.0] * 8)
    assert never.estimate == 0.0
    assert never.high > 0.2


def test_the_optimality_gap_is_the_share_above_the_bound():
    found = optimality_gap([10.0, 20.0, np.inf, 8.0, 40.0, 10.0], [10.0, 10.0, 10.0, 9.0, 10.0, 5.0])
    assert found.estimate == pytest.approx((0.0 + 0.5 + 1.0 + 0.0 + 0.75 + 0.5) / 6.0)
    assert 0.0 <= found.low < found.high <= 1.0
    with pytest.raises(ValueError, match="the least bound 0; want more than 0"):
        optimality_gap([1.0], [0.0])


def test_an_interval_is_written_with_its_ends_or_without():
    assert f"{mean_interval(skewed[:30]):.1f}".count("to") == 1
    assert f"{mean_interval([1.0, 2.0]):.1f}" == "1.5 (no interval)"


def test_an_interval_that_is_narrower_than_its_digits_has_more():
    values = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0002, 1.0, 1.0, 0.99995]
    assert f"{mean_interval(values):.2f}" == "1.0000 (1.0000 to 1.0001)"
    assert f"{mean_interval([1.0] * 10):.2f}" == "1.00 (no interval)"


def test_interquartile_means_of_clusters_are_as_wide_as_those_of_their_floors():
    generator = np.random.default_rng(6)
    floors = np.repeat(np.arange(30), 3)
    values = generator.normal(50.0, 10.0, 30)[floors] + generator.normal(0.0, 0.5, 90)
    alone, clustered = (interquartile_mean_interval(values, clusters=each) for each in (None, floors))
    of_means = interquartile_mean_interval(values.reshape(30, 3).mean(axis=1))
    assert clustered.estimate == alone.estimate
    assert clustered.size == 30
    width, narrow, wanted = (each.high - each.low for each in (clustered, alone, of_means))
    assert width > 1.4 * narrow
    assert width == pytest.approx(wanted, rel=0.25)


def test_ends_of_interquartile_means_stay_within_bounds():
    shares = [60.0, 70.0, 99.5, 99.8, 99.9, 100.0, 100.0, 100.0]
    assert interquartile_mean_interval(shares, bounds=(0.0, 100.0)).high == 100.0
