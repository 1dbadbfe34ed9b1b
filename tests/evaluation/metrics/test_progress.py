"""Time, distance, evenness, collisions and cost."""

import numpy as np
import pytest

from lidarium.evaluation.metrics import progress


def test_path_lengths_add_up_the_steps_of_each_robot():
    track = np.array([[(0, 0, 9), (0, 0, 0)], [(3, 4, 0), (0, 0, 0)], [(3, 5, 1), (0, 0, 0)]], float)
    assert progress.path_lengths(track).tolist() == [6.0, 0.0]


def test_thresholds_are_reached_where_coverage_first_is_as_much():
    times, coverage = [0.0, 2.0, 4.0, 6.0], [0.1, 0.85, 0.85, 0.99]
    lengths = np.array([[0.0, 0.0], [1.0, 3.0], [2.0, 4.0], [7.0, 5.0]])
    assert [progress.time_to(times, coverage, share) for share in (0.1, 0.85, 0.9, 1.0)] == [
        0.0,
        2.0,
        6.0,
        None,
    ]
    assert progress.decisions_to([0, 4, 9, 13], coverage, 0.85) == 4
    assert progress.distance_to(lengths, coverage, 0.85) == 3.0
    assert progress.distance_sum_to(lengths, coverage, 0.9) == 12.0
    assert progress.decisions_to([0, 4, 9, 13], coverage, 1.0) is progress.distance_to(lengths, coverage, 1.0) is None
    assert progress.distance_sum_to(lengths, coverage, 1.0) is None


def test_success_is_within_the_horizon():
    times, coverage = [0.0, 5.0], [0.2, 0.99]
    assert progress.is_success(times, coverage, 0.99, 5.0)
    assert progress.is_success(times, coverage, 0.99, None)
    assert not progress.is_success(times, coverage, 0.99, 4.0)
    assert not progress.is_success(times, coverage, 1.0, None)


def test_the_area_under_the_curve_holds_each_value_until_the_next_and_the_last_to_the_horizon():
    assert progress.area_under_curve([0.0, 2.0, 4.0], [0.0, 0.5, 1.0], 10.0) == pytest.approx((2 * 0.5 + 6 * 1.0) / 10)
    assert progress.area_under_curve([0.0, 2.0, 4.0], [0.0, 0.5, 1.0], 3.0) == pytest.approx(0.5 / 3)
    assert progress.area_under_curve([1.0], [1.0], 4.0) == 0.75
    with pytest.raises(ValueError, match="horizon is 0"):
        progress.area_under_curve([0.0], [1.0], 0.0)
    with pytest.raises(ValueError, match="in the order of time"):
        progress.area_under_curve([1.0, 0.0], [0.0, 1.0], 2.0)


def test_restricted_time_has_the_horizon_in_place_of_what_was_not_reached():
    assert [progress.restricted_time(reached, 60.0) for reached in (20.0, None, 70.0)] == [20.0, 60.0, 60.0]


def test_balance_is_the_spread_of_the_shares():
    assert progress.balance(np.array([0.2, 0.4])) == pytest.approx(0.1)
    assert progress.path_balance(np.array([10.0, 30.0])) == pytest.approx(0.5)
    assert progress.path_balance([0.1, 0.3]) == pytest.approx(0.5)
    assert progress.path_balance(np.zeros(3)) == 0.0


def test_jain_index_tells_how_evenly_work_is_shared():
    assert progress.jain_index([5.0, 5.0, 5.0, 5.0]) == pytest.approx(1.0)
    assert progress.jain_index([5.0, 0.0, 0.0, 0.0]) == pytest.approx(0.25)
    assert progress.jain_index([0.0, 0.0]) == 1.0


def test_collisions_are_told_by_kilometre_and_episode():
    assert progress.collisions_per_km(3, [1000.0, 500.0]) == 2.0
    assert progress.collisions_per_km(0, [0.0]) is None
    assert progress.collisions_per_episode([0, 1, 2]) == 1.0
    assert progress.collisions_per_episode([]) is None


def test_memory_is_told_in_megabytes():
    assert 20.0 < progress.peak_megabytes() < 1e6


def test_decision_times_are_told_in_milliseconds():
    assert progress.decision_percentiles([0.001, 0.002, 0.003]) == {"p50": 2.0, "p95": 2.9}
    assert progress.decision_percentiles([]) == {"p50": None, "p95": None}
