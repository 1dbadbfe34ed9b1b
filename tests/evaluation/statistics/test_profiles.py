"""Profiles: shares of runs within a factor of the best, or with at least a score."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lidarium.evaluation.statistics import ratio_profile, score_profile, share_interval

COSTS = [[10.0, 20.0], [30.0, 15.0], [np.inf, 40.0], [np.inf, np.inf]]


def test_shares_of_runs_within_a_factor_of_the_best():
    assert ratio_profile(COSTS, [1.0, 2.0]).tolist() == [[0.25, 0.5], [0.5, 0.75]]


def test_a_run_in_which_none_succeeded_counts_for_nobody():
    assert ratio_profile(COSTS, [1e9]).ravel().tolist() == [0.5, 0.75]


def test_equal_costs_are_both_the_best():
    assert ratio_profile([[5.0, 5.0], [0.0, 0.0]], [1.0]).ravel().tolist() == [1.0, 1.0]


@given(st.lists(st.tuples(st.floats(0.0, 1e6), st.floats(0.0, 1e6)), min_size=1, max_size=20))
def test_profiles_rise_to_one_where_all_succeed(costs):
    profile = ratio_profile(costs, np.geomspace(1.0, 1e3, 20))
    assert (np.diff(profile, axis=1) >= 0.0).all()
    assert profile[:, 0].sum() >= 1.0 - 1e-12
    assert (profile <= 1.0).all()


def test_shares_of_runs_with_at_least_a_score():
    share, low, high = score_profile([0.5, 0.9, 0.99, 1.0], [0.0, 0.9, 1.0, 1.1])
    assert share.tolist() == [1.0, 0.75, 0.25, 0.0]
    assert (low <= share).all()
    assert (high >= share).all()
    ends = share_interval(3, 4)
    assert (low[1], high[1]) == pytest.approx((ends.low, ends.high))


def test_scores_of_a_cluster_that_are_the_same_count_as_one():
    scores = np.array([0.2, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 1.0])
    alone = score_profile(scores, [0.55])
    often = score_profile(np.repeat(scores, 5), [0.55], clusters=np.repeat(np.arange(8), 5))
    assert often == pytest.approx(alone)
    assert (score_profile(np.repeat(scores, 5), [0.55])[1] > alone[1]).all()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: ratio_profile([], [1.0]), "want .runs, policies."),
        (lambda: ratio_profile([[1.0, np.nan]], [1.0]), "nan or negative"),
        (lambda: ratio_profile([[1.0, 2.0]], [0.5]), "factors reach down to 0.5"),
        (lambda: score_profile([], [1.0]), "scores are empty"),
        (lambda: score_profile([np.nan], [1.0]), r"scores\[0\] is nan"),
        (lambda: share_interval(3, 2), "3 successes of 2 runs"),
        (lambda: share_interval(0, 0), "want 1 run at least"),
    ],
)
def test_bad_input_is_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()
