"""Merges beside the truth."""

import dataclasses

import numpy as np
import pytest

from lidarium.envs.faces.merged_maps import MergeEvent
from lidarium.evaluation.metrics import merges


def test_merges_are_correct_within_the_tolerances_of_m_explores_test():
    """EXPECT_NEAR(angle, found, 1e-2), and 2 cells for the translation."""
    assert merges.is_correct(*merges.transform_error((0.1, 0.0, 0.009), (0.0, 0.0, 0.0)), resolution=0.05)
    assert not merges.is_correct(*merges.transform_error((0.11, 0.0, 0.0), (0.0, 0.0, 0.0)), resolution=0.05)
    assert not merges.is_correct(*merges.transform_error((0.0, 0.0, 0.011), (0.0, 0.0, 0.0)), resolution=0.05)
    assert merges.transform_error((0.0, 0.0, np.pi - 0.001), (0.0, 0.0, 0.001 - np.pi)) == pytest.approx((0.0, 0.002))


def test_the_error_of_a_merge_is_that_where_the_maps_meet():
    turned = (20.0 * np.sin(0.01), 0.0, 0.01)
    far, _ = merges.transform_error(turned, (0.0, 0.0, 0.0))
    near, _ = merges.transform_error(turned, (0.0, 0.0, 0.0), at=(0.0, 20.0))
    assert far == pytest.approx(0.2, abs=1e-4)
    assert near < 0.002


def test_a_merge_is_judged_by_how_the_drifted_maps_lie_where_they_meet():
    """Robot b's map has slipped by 0.5 m in x from 4 s on; a merger that lays it where its walls are is
    right, though not by the starts."""
    times = np.arange(0.0, 10.0)
    true = np.zeros((10, 2, 3))
    true[:, 0, 0], true[:, 1, 0], true[:, 1, 1] = times, times, 1.0
    believed = true - (0.0, 0.0, 0.0)
    believed[4:, 1, 0] -= 0.5
    trajectories = merges.Trajectories(("a", "b"), times, true, believed)
    late = MergeEvent(9.0, "a", "b", (0.5, 0.0, 0.0), (0.0, 0.0, 0.0), (7.5, 1.0))
    early = MergeEvent(9.0, "a", "b", (0.5, 0.0, 0.0), (0.0, 0.0, 0.0), (1.0, 1.0))
    assert merges.drifted_truth(late, trajectories) == pytest.approx((0.5, 0.0, 0.0))
    assert merges.drifted_truth(early, trajectories) == pytest.approx((0.0, 0.0, 0.0))
    before = MergeEvent(3.0, "a", "b", (0.5, 0.0, 0.0), (0.0, 0.0, 0.0), (7.5, 1.0))
    assert merges.drifted_truth(before, trajectories) == pytest.approx((0.0, 0.0, 0.0))
    told = merges.merge_figures([late, early], 0.05, trajectories)
    assert (told["wrong"], told["off"], told["false"]) == (1, 2, 2)
    assert (told["worst_here_m"], told["worst_m"]) == pytest.approx((0.5, 0.5))
    assert merges.merge_figures([late], 0.05, trajectories)["worst_here_m"] == 0.0
    assert merges.merge_figures([late], 0.05)["wrong"] == 1
    assert merges.merge_figures([], 0.05, trajectories)["worst_here_m"] is None


def test_robots_that_others_join_are_judged_by_the_merges_that_join_them():
    """Robot c lies right on b, and b on a; what b's map has drifted in between puts c off a, and is
    nobody's wrong merge."""
    nowhere = (0.0, 0.0, 0.0)
    over = MergeEvent(9.0, "a", "c", (0.5, 0.0, 0.0), nowhere, (0.0, 0.0), is_direct=False)
    told = merges.merge_figures([MergeEvent(5.0, "a", "b", nowhere, nowhere, (0.0, 0.0)), over], 0.05)
    assert (told["accepted"], told["wrong"], told["worst_here_m"], told["off"], told["false"]) == (
        2,
        0,
        0.0,
        1,
        1,
    )
    assert merges.merge_figures([over], 0.05)["worst_here_m"] is None
    laid = dataclasses.replace(over, is_direct=True)
    assert merges.merge_figures([laid], 0.05)["wrong"] == 1


def test_precision_is_of_the_accepted_and_recall_of_what_could_be_merged():
    accepted, correct = np.array([1, 1, 1, 0, 0], bool), np.array([1, 1, 0, 0, 1], bool)
    assert merges.precision(accepted, correct) == pytest.approx(2 / 3)
    assert merges.recall(accepted, correct, [0.5, 0.05, 0.3, 0.1, 0.0]) == pytest.approx(1 / 3)
    assert merges.first_correct_time([30.0, 20.0, 10.0, 5.0, 1.0], accepted, correct) == 20.0
    nothing = np.zeros(5, bool)
    assert merges.precision(nothing, correct) is None
    assert merges.recall(accepted, correct, np.zeros(5)) is None
    assert merges.first_correct_time([1.0] * 5, nothing, correct) is None
