import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy import stats

from lidarium.evaluation.statistics import (
    CensoredTimes,
    kaplan_meier,
    mean_interval,
    restricted_difference,
    restricted_mean,
    restricted_ratio,
)
from lidarium.evaluation.statistics.restricted import _influences_on

generator = np.random.default_rng(8)
TRUE_TIMES = generator.exponential(100.0, 80)
CUTS = generator.exponential(400.0, 80)
TIMES, OBSERVED = np.minimum(TRUE_TIMES, CUTS), TRUE_TIMES <= CUTS

censored_rows = st.lists(st.tuples(st.integers(1, 12), st.booleans()), min_size=2, max_size=25)


def area_below(times, is_observed, horizon):
    """The area below scipy's Kaplan-Meier curve."""
    sample = stats.CensoredData(
        uncensored=np.asarray(times)[is_observed], right=np.asarray(times)[~np.asarray(is_observed)]
    )
    curve = stats.ecdf(sample).sf
    ends = np.append(curve.quantiles[curve.quantiles < horizon], horizon)
    starts = np.concatenate([[0.0], ends[:-1]])
    return float(np.sum(np.diff(ends, prepend=0.0) * np.where(starts == 0.0, 1.0, curve.evaluate(starts))))


def test_known_times_have_their_plain_mean():
    found = restricted_mean([10.0, 20.0, 60.0], [True, True, True], 100.0)
    assert found.estimate == pytest.approx(30.0)


def test_times_cut_at_the_horizon_count_with_the_horizon():
    assert restricted_mean([10.0, 20.0, 100.0, 100.0], [True, True, False, False], 100.0).estimate == pytest.approx(
        57.5
    )
    assert restricted_mean([10.0, 20.0, 300.0, 150.0], [True, True, True, False], 100.0).estimate == pytest.approx(57.5)


def test_a_time_cut_early_counts_as_those_that_were_left_at_the_cut():
    # One of three is cut at 15: what happens to it afterwards is what happened to the one that went on.
    assert restricted_mean([10.0, 15.0, 30.0], [True, False, True], 40.0).estimate == pytest.approx(
        10.0 + 20.0 * 2.0 / 3.0
    )


def test_without_censoring_the_interval_is_that_of_the_mean():
    found, plain = restricted_mean(TRUE_TIMES, np.ones(80, bool), 1e4), mean_interval(TRUE_TIMES)
    assert (found.estimate, found.low, found.high) == pytest.approx((plain.estimate, plain.low, plain.high))


@given(censored_rows, st.integers(1, 12))
def test_the_estimate_is_the_area_below_scipys_curve(rows, horizon):
    times, seen = np.array([time for time, _ in rows], float), np.array([seen for _, seen in rows])
    assume((seen & (times <= horizon)).any() and (times.max() >= horizon or seen[times == times.max()].all()))
    found = restricted_mean(times, seen, horizon, resamples=100)
    assert found.estimate == pytest.approx(area_below(times, seen, horizon))
    assert 0.0 < found.estimate <= horizon


def test_the_curve_is_scipys():
    moments, shares = kaplan_meier(TIMES, OBSERVED)
    curve = stats.ecdf(stats.CensoredData(uncensored=TIMES[OBSERVED], right=TIMES[~OBSERVED])).sf
    assert shares == pytest.approx(curve.evaluate(moments))


def test_influences_are_the_change_by_a_little_more_of_a_run():
    sample = CensoredTimes(TIMES, OBSERVED, 150.0)
    counts, influences, areas = np.ones(80), np.empty(80), np.empty(80)
    mean = _influences_on.py_func(counts, np.arange(80), sample.arrays, areas, influences)
    assert influences.sum() == pytest.approx(0.0, abs=1e-9)
    for run in (0, 17, 42, 79):
        more = counts.copy()
        more[run] += 1e-6
        moved = _weighted_mean(more, sample)
        assert (moved - mean) / 1e-6 == pytest.approx(influences[run], rel=1e-3, abs=1e-4)


def _weighted_mean(weights, sample):
    """The area below the curve of runs of any weight, runs at risk summed anew for each."""
    order = sample.order
    share, area, last = 1.0, 0.0, 0.0
    for rank, run in enumerate(order):
        area += share * (sample.times[run] - last)
        last = sample.times[run]
        if sample.is_observed[run]:
            at_risk = weights[order[rank:]].sum()
            share *= 1.0 - weights[run] / at_risk
    return area + share * (sample.horizon - last)


def test_the_error_without_ties_is_greenwoods():
    sample = CensoredTimes(TIMES, OBSERVED, 150.0)
    influences, areas = np.empty(80), np.empty(80)
    mean = _influences_on(np.ones(80), np.arange(80), sample.arrays, areas, influences)
    moments, shares = kaplan_meier(TIMES, OBSERVED & (TIMES <= 150.0))
    at_risk = np.array([(moment <= TIMES).sum() for moment in moments])
    ends = np.append(moments[1:], 150.0)
    right = np.cumsum((shares * (ends - moments))[::-1])[::-1]
    assert np.sqrt((influences**2).sum()) == pytest.approx(np.sqrt(np.sum(right**2 / (at_risk * (at_risk - 1)))))
    assert mean == pytest.approx(moments[0] + right[0])


def test_differences_and_ratios_use_the_pairs():
    slower = CensoredTimes(1.2 * TIMES + 1.0, OBSERVED, 200.0)
    faster = CensoredTimes(TIMES, OBSERVED, 200.0)
    difference, ratio = restricted_difference(slower, faster), restricted_ratio(slower, faster)
    of_slower = restricted_mean(1.2 * TIMES + 1.0, OBSERVED, 200.0)
    of_faster = restricted_mean(TIMES, OBSERVED, 200.0)
    assert difference.estimate == pytest.approx(of_slower.estimate - of_faster.estimate)
    assert ratio.estimate == pytest.approx(of_slower.estimate / of_faster.estimate)
    assert difference.high - difference.low < 0.4 * (of_slower.high - of_slower.low)
    assert difference.low > 0.0
    assert ratio.low > 1.0
    turned = restricted_difference(faster, slower)
    assert (turned.low, turned.high) == pytest.approx((-difference.high, -difference.low))


def test_a_policy_does_not_differ_from_itself():
    sample = CensoredTimes(TIMES, OBSERVED, 150.0)
    for found, same in ((restricted_difference(sample, sample), 0.0), (restricted_ratio(sample, sample), 1.0)):
        assert found.estimate == same
        assert not found.is_known


@pytest.mark.parametrize(
    ("times", "is_observed", "horizon", "message"),
    [
        ([], [], 10.0, "times are empty"),
        ([1.0, np.nan], [True, True], 10.0, r"times\[1\] is nan"),
        ([1.0, -2.0], [True, True], 10.0, r"times\[1\] is -2.0; want 0 or more"),
        ([1.0, 2.0], [True], 10.0, "want one for each time"),
        ([10.0, 10.0], [False, False], 10.0, "none of 2 times was observed up to the horizon of 10 s"),
        ([12.0, 14.0], [True, True], 10.0, "none of 2 times was observed"),
        ([1.0, 5.0], [True, False], 10.0, "want a horizon of at most 5 s"),
        ([1.0, 5.0], [True, True], 0.0, "horizon is 0.0"),
        ([1.0, 5.0], [True, True], np.inf, "horizon is inf"),
    ],
)
def test_bad_times_are_refused(times, is_observed, horizon, message):
    with pytest.raises(ValueError, match=message):
        restricted_mean(times, is_observed, horizon)


def test_partners_share_length_and_horizon():
    a = CensoredTimes([1.0, 2.0], [True, True], 10.0)
    with pytest.raises(ValueError, match="a has 2 times and b has 1"):
        restricted_difference(a, CensoredTimes([1.0], [True], 10.0))
    with pytest.raises(ValueError, match="horizon of a is 10 s and that of b 9 s"):
        restricted_ratio(a, CensoredTimes([1.0, 2.0], [True, True], 9.0))
    with pytest.raises(ValueError, match="all times of b are 0"):
        restricted_ratio(a, CensoredTimes([0.0, 0.0], [True, True], 10.0))


def test_of_a_policy_that_never_gets_there_the_horizon_counts():
    never = CensoredTimes([10.0] * 8, [False] * 8, 10.0)
    faster = CensoredTimes(np.linspace(2.0, 9.0, 8), [True] * 8, 10.0)
    assert restricted_difference(never, faster).estimate == pytest.approx(4.5)
    with pytest.raises(ValueError, match="neither in a nor in b"):
        restricted_difference(never, never)


def test_four_pairs_have_a_difference_without_an_interval():
    # The bootstrap divided by a standard error that was rounding, and made an interval of 4e16 s.
    a, b = (CensoredTimes(times, [True] * 4, 200.0) for times in ([81.9, 47.1, 118.6, 85.7], [83.0, 48.2, 119.7, 61.4]))
    difference = restricted_difference(a, b)
    assert difference.estimate == pytest.approx(5.25)
    assert not difference.is_known
    assert not restricted_ratio(a, b).is_known


@pytest.mark.parametrize("size", [6, 10, 11, 30])
def test_differences_stay_within_the_horizon(size):
    generator = np.random.default_rng(size)
    for _ in range(50):
        a, b = (
            CensoredTimes(np.where(generator.random(size) < 0.5, 1.0, 200.0), np.ones(size, bool), 200.0)
            for _ in range(2)
        )
        found = restricted_difference(a, b, resamples=200)
        assert not found.is_known or -200.0 <= found.low < found.high <= 200.0


def test_equal_differences_that_rounding_makes_unlike_have_no_interval():
    times = 100.0 + np.arange(20) / 7.0
    a, b = CensoredTimes(times, np.ones(20, bool), 200.0), CensoredTimes(times - 0.3, np.ones(20, bool), 200.0)
    assert not restricted_difference(a, b).is_known


def test_from_six_to_ten_pairs_the_interval_is_students():
    generator = np.random.default_rng(0)
    a, b = generator.uniform(50.0, 90.0, 8), generator.uniform(50.0, 90.0, 8)
    found = restricted_difference(*(CensoredTimes(each, np.ones(8, bool), 200.0) for each in (a, b)))
    expected = stats.ttest_rel(a, b).confidence_interval(0.95)
    assert (found.low, found.high) == pytest.approx((expected.low, expected.high))


def test_runs_of_a_cluster_count_as_one_if_they_are_the_same():
    times = np.random.default_rng(1).uniform(10.0, 90.0, 15)
    alone = restricted_mean(times, np.ones(15, bool), 200.0)
    often = restricted_mean(np.repeat(times, 4), np.ones(60, bool), 200.0, clusters=np.repeat(np.arange(15), 4))
    assert often.size == 15
    assert (often.estimate, often.low, often.high) == pytest.approx((alone.estimate, alone.low, alone.high))
