"""When and on which ways thresholds are reached."""

import numpy as np
import pytest

from lidarium.evaluation import metrics


def test_path_lengths_add_up_the_steps_of_each_robot():
    track = np.array([[(0, 0, 9), (0, 0, 0)], [(3, 4, 0), (0, 0, 0)], [(3, 5, 1), (0, 0, 0)]], float)
    assert metrics.path_lengths(track).tolist() == [6.0, 0.0]


def test_thresholds_are_reached_where_coverage_first_is_as_much():
    times, coverage = [0.0, 2.0, 4.0, 6.0], [0.1, 0.85, 0.85, 0.99]
    lengths = np.array([[0.0, 0.0], [1.0, 3.0], [2.0, 4.0], [7.0, 5.0]])
    assert [metrics.time_to(times, coverage, share) for share in (0.1, 0.85, 0.9, 1.0)] == [
        0.0,
        2.0,
        6.0,
        None,
    ]
    assert metrics.decisions_to([0, 4, 9, 13], coverage, 0.85) == 4
    assert metrics.distance_to(lengths, coverage, 0.85) == 3.0
    assert metrics.distance_sum_to(lengths, coverage, 0.9) == 12.0
    assert (
        metrics.decisions_to([0, 4, 9, 13], coverage, 1.0)
        is metrics.distance_to(lengths, coverage, 1.0)
        is None
    )
    assert metrics.distance_sum_to(lengths, coverage, 1.0) is None


def test_success_is_within_the_horizon():
    times, coverage = [0.0, 5.0], [0.2, 0.99]
    assert metrics.is_success(times, coverage, 0.99, 5.0)
    assert metrics.is_success(times, coverage, 0.99, None)
    assert not metrics.is_success(times, coverage, 0.99, 4.0)
    assert not metrics.is_success(times, coverage, 1.0, None)


def test_the_area_under_the_curve_holds_each_value_until_the_next_and_the_last_to_the_horizon():
    assert metrics.area_under_curve([0.0, 2.0, 4.0], [0.0, 0.5, 1.0], 10.0) == pytest.approx(
        (2 * 0.5 + 6 * 1.0) / 10
    )
    assert metrics.area_under_curve([0.0, 2.0, 4.0], [0.0, 0.5, 1.0], 3.0) == pytest.approx(0.5 / 3)
    assert metrics.area_under_curve([1.0], [1.0], 4.0) == 0.75
    with pytest.raises(ValueError, match="horizon is 0"):
        metrics.area_under_curve([0.0], [1.0], 0.0)
    with pytest.raises(ValueError, match="in the order of time"):
        metrics.area_under_curve([1.0, 0.0], [0.0, 1.0], 2.0)


def test_restricted_time_has_the_horizon_in_place_of_what_was_not_reached():
    assert [metrics.restricted_time(reached, 60.0) for reached in (20.0, None, 70.0)] == [20.0, 60.0, 60.0]
