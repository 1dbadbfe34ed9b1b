import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from lidarium.envs.scoring.coverage import pack_bits
from lidarium.envs.wrappers.merged_maps import MergeEvent
from lidarium.evaluation import metrics
from lidarium.evaluation.metrics import merges

masks = arrays(np.bool_, (6, 9))


def mask(text):
    """Read rows of # and . from top to bottom, row 0 last."""
    return np.array([[letter == "#" for letter in line] for line in text.split()])[::-1]


def test_free_coverage_is_the_sensed_share_of_what_counts():
    counted = mask("##.. ##..")
    assert metrics.free_coverage(mask("#.## ...."), counted) == 0.25
    assert metrics.free_coverage(counted, counted) == 1.0
    assert metrics.free_coverage(mask(".... ...."), np.zeros((2, 4), bool)) == 1.0


def test_own_coverage_gives_the_least_and_the_mean():
    counted = mask("####")
    assert metrics.own_coverage(np.stack([mask("##.."), mask("###.")]), counted) == (0.5, 0.625)


def test_known_coverage_counts_walls_as_well():
    assert metrics.known_coverage(mask("##.. ..##"), mask("###. ###.")) == 0.5


def test_valid_coverage_counts_free_cells_and_the_walls_around_them():
    counted = mask("..... .#... .....")
    occupied = mask("####. #.##. ####.")
    # F is one cell and its surface the eight around it; the known column 0 holds three of them.
    assert metrics.valid_coverage(mask("#.... #.... #...."), counted, occupied) == pytest.approx(3 / 9)


def test_the_surface_does_not_hold_the_inside_of_solids():
    occupied = mask("#### #### #### ....")
    assert (
        metrics.surface(occupied, mask(".... .... .... ####")).tolist()
        == mask(".... .... #### ....").tolist()
    )


def test_iou_of_a_perfect_map_is_one_and_solid_interiors_do_not_count():
    occupied = mask("##### ##### ..... .....")
    sensed = mask("..... ..... ..... #####") | mask("..... ..... ##### .....")
    believed = mask("..... ##### ..... .....")
    assert metrics.occupied_iou(believed, occupied, sensed) == 1.0


def test_iou_forgives_one_cell_and_not_two():
    occupied, sensed = mask("#... .... .... ...."), mask(".... #... .... ....")
    assert metrics.occupied_iou(mask(".... .#.. .... ...."), occupied, sensed) == 1.0
    assert metrics.occupied_iou(mask(".... .... #... ...."), occupied, sensed) == 0.0


def test_iou_counts_hits_on_either_side():
    occupied = mask("######## ........")
    sensed = mask("........ ########")
    # B has 2 cells and both hit; of the 8 cells of S the first 3 are within a cell of B.
    assert metrics.occupied_iou(mask("##...... ........"), occupied, sensed) == pytest.approx(
        (2 + 3) / (2 + 8)
    )


def test_iou_falls_for_ghost_walls():
    occupied, sensed = mask("#..... ......"), mask("...... ##....")
    assert metrics.occupied_iou(mask("#....# ......"), occupied, sensed) == pytest.approx((1 + 1) / (2 + 1))


def test_iou_of_nothing_is_one():
    nothing = np.zeros((3, 3), bool)
    assert metrics.occupied_iou(nothing, nothing, nothing) == 1.0


def test_f1_has_precision_and_recall_within_a_cell():
    occupied = mask("####....")
    assert metrics.occupied_f1(occupied, occupied) == 1.0
    # 2 of the 3 believed cells are within a cell of a true one, 2 of the 4 true ones within a cell of a
    # believed one.
    assert metrics.occupied_f1(mask("...##..#"), occupied) == pytest.approx(
        2 * (2 / 3) * (2 / 4) / (2 / 3 + 2 / 4)
    )
    assert metrics.occupied_f1(mask("........"), occupied) == 0.0
    assert metrics.occupied_f1(mask("........"), mask("........")) == 1.0
    assert metrics.occupied_f1(mask("...##..#"), occupied, tolerance=0) == pytest.approx(
        2 * (1 / 3) * (1 / 4) / (1 / 3 + 1 / 4)
    )


def test_overlap_is_what_two_saw_of_what_one_saw():
    seen = [pack_bits(mask(text)) for text in ("###.......", ".##.......", "..##......")]
    assert metrics.overlap(seen) == 0.5
    assert metrics.overlap(seen[:1]) == 0.0
    assert metrics.overlap([np.zeros((2, 1), np.uint64)]) == 0.0


def test_path_lengths_add_up_the_steps_of_each_robot():
    track = np.array([[(0, 0, 9), (0, 0, 0)], [(3, 4, 0), (0, 0, 0)], [(3, 5, 1), (0, 0, 0)]], float)
    assert metrics.path_lengths(track).tolist() == [6.0, 0.0]


def test_balance_is_the_spread_of_the_shares():
    assert metrics.balance(np.array([0.2, 0.4])) == pytest.approx(0.1)
    assert metrics.path_balance(np.array([10.0, 30.0])) == pytest.approx(0.5)
    assert metrics.path_balance(np.zeros(3)) == 0.0


def test_overlap_of_maps_and_balance_are_what_explore_bench_prints():
    """Its script: np.std of the robots' rates, and their sum less 1, a rate being known cells over cells
    that are not 205."""
    truth = np.array([[0, 254, 254, 254, 205], [0, 254, 254, 254, 205]])
    scans = np.array([[[100, 0, 0, -1, -1], [-1, 0, 0, 0, -1]], [[-1, -1, 0, 0, -1], [-1, 0, 0, 0, -1]]])
    rates = [(scan != -1).sum() / (truth != 205).sum() for scan in scans]
    shares = [metrics.known_coverage(scan != -1, truth != 205) for scan in scans]
    assert shares == rates == [6 / 8, 5 / 8]
    assert metrics.overlap_of_maps(shares) == np.sum(np.array(rates)) - 1 == 3 / 8
    assert metrics.balance(shares) == np.std(np.array(rates)) == 1 / 16


def test_cells_known_beyond_the_truth_do_not_count_as_they_do_for_explore_bench():
    assert metrics.known_coverage(mask("####"), mask("##..")) == 1.0


def test_instant_overlap_is_the_mean_of_marvels_ratio_over_decisions():
    assert metrics.instant_overlap([100, 50, 0], [50, 50, 0]) == pytest.approx((0.5 + 1.0 + 0.0) / 3)
    assert metrics.instant_overlap([], []) == 0.0


def test_jain_index_tells_how_evenly_work_is_shared():
    assert metrics.jain_index([5.0, 5.0, 5.0, 5.0]) == pytest.approx(1.0)
    assert metrics.jain_index([5.0, 0.0, 0.0, 0.0]) == pytest.approx(0.25)
    assert metrics.jain_index([0.0, 0.0]) == 1.0


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


def test_f1_does_not_ask_for_what_cannot_be_seen():
    occupied, wanted = mask("#### #### ...."), mask(".... #### ....")
    believed = mask(".... #### ....")
    assert metrics.occupied_f1(believed, occupied, tolerance=0) < 1.0
    assert metrics.occupied_f1(believed, occupied, tolerance=0, wanted=wanted) == 1.0


def test_free_error_rate_is_the_share_of_free_cells_that_are_walls():
    assert metrics.free_error_rate(mask("####"), mask("...#")) == 0.25
    assert metrics.free_error_rate(mask("...."), mask("...#")) == 0.0


LINKS = np.array(
    [
        [[1, 1, 0, 0], [1, 1, 1, 0], [0, 1, 1, 1], [0, 0, 1, 1]],  # a chain
        [[1, 1, 0, 0], [1, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]],  # two together, two alone
        [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]],  # nobody reaches anybody
        [[1, 1, 0, 0], [0, 1, 1, 0], [0, 0, 1, 1], [0, 0, 0, 1]],  # a chain of which each link goes one way
    ],
    bool,
)


def test_a_team_is_connected_while_all_are_one_cluster():
    assert metrics.largest_clusters(LINKS).tolist() == [4, 2, 1, 4]
    assert metrics.connected_share(LINKS) == 0.5
    assert metrics.largest_cluster_share(LINKS) == pytest.approx((4 + 2 + 1 + 4) / 16)
    assert metrics.connected_share(LINKS[:0]) == metrics.largest_cluster_share(LINKS[:0]) == 1.0


def test_bytes_are_told_by_robot_and_second():
    assert metrics.bytes_per_robot_second([600, 0, 300], 10.0) == 30.0
    assert metrics.bytes_per_robot_second([600], 0.0) == 0.0


def test_sharing_lags_by_what_the_last_robot_needs_to_know_what_the_team_knows():
    times, team = [0.0, 10.0, 20.0, 30.0], [0.5, 0.99, 1.0, 1.0]
    own = np.array([[0.5, 0.4], [0.99, 0.5], [1.0, 0.8], [1.0, 0.99]])
    assert metrics.sharing_lag(times, own, team) == 20.0
    assert metrics.sharing_lag(times, own[:3], team[:3]) is None


def drive(generator, steps=60):
    """A wandering track of poses (steps, 3)."""
    theta = np.cumsum(generator.normal(0.0, 0.2, steps))
    ways = 0.1 * np.stack([np.cos(theta), np.sin(theta)], axis=1)
    return np.column_stack([np.cumsum(ways, axis=0), theta])


@given(st.floats(-3.0, 3.0), st.floats(-50.0, 50.0), st.integers(0, 2**32 - 1))
def test_a_track_in_another_frame_has_no_error_once_aligned(theta, x, seed):
    true = drive(np.random.default_rng(seed))
    believed = metrics.moved(true, np.array([x, -0.5 * x, theta]))
    assert metrics.absolute_error(believed, true) == pytest.approx(0.0, abs=1e-9)
    assert metrics.relative_error(believed, true, 10) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert metrics.moved(believed, metrics.best_transform(believed, true))[:, :2] == pytest.approx(
        true[:, :2], abs=1e-9
    )


def test_absolute_error_is_the_root_mean_square_of_what_alignment_leaves():
    true = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [4.0, 0.0, 0.0]])
    believed = true + np.array([[0.0, 3.0, 0.0]])
    assert metrics.absolute_error(believed, true, is_aligned=False) == 3.0
    assert metrics.absolute_error(believed, true) == pytest.approx(0.0, abs=1e-12)
    stretched = true * np.array([1.5, 1.0, 1.0])
    # Aligned at the middle, the ends are 1 m off: sqrt((1 + 0 + 1) / 3). Scale is not taken out.
    assert metrics.absolute_error(stretched, true) == pytest.approx(np.sqrt(2 / 3))


def test_relative_error_is_that_of_the_motions():
    true = np.array([[0.0, 0.0, np.pi / 2], [0.0, 1.0, np.pi / 2], [0.0, 2.0, np.pi / 2]])
    believed = np.array([[0.0, 0.0, 0.0], [1.1, 0.0, 0.1], [2.2, 0.11, 0.1]])
    translation, rotation = metrics.relative_error(believed, true, 1)
    first, second = (
        (0.1, 0.0),
        (1.1 * np.cos(0.1) + 0.11 * np.sin(0.1) - 1.0, 0.11 * np.cos(0.1) - 1.1 * np.sin(0.1)),
    )
    assert translation == pytest.approx(np.sqrt((np.dot(first, first) + np.dot(second, second)) / 2))
    assert rotation == pytest.approx(0.05)
    assert metrics.relative_error(believed, true, 3) is None


def test_the_best_transform_is_no_worse_than_any_other():
    generator = np.random.default_rng(3)
    true = drive(generator)
    believed = metrics.moved(true, np.array([1.0, 2.0, 0.7])) + generator.normal(0.0, 0.05, true.shape)
    best = metrics.best_transform(believed, true)
    least = metrics.absolute_error(believed, true)
    for change in np.vstack([np.eye(3), -np.eye(3)]) * 1e-3:
        assert metrics.absolute_error(metrics.moved(believed, best + change), true, is_aligned=False) > least


def test_merges_are_correct_within_the_tolerances_of_m_explores_test():
    """EXPECT_NEAR(angle, found, 1e-2), and 2 cells for the translation."""
    assert merges.is_correct(*merges.transform_error((0.1, 0.0, 0.009), (0.0, 0.0, 0.0)), resolution=0.05)
    assert not merges.is_correct(*merges.transform_error((0.11, 0.0, 0.0), (0.0, 0.0, 0.0)), resolution=0.05)
    assert not merges.is_correct(*merges.transform_error((0.0, 0.0, 0.011), (0.0, 0.0, 0.0)), resolution=0.05)
    assert merges.transform_error((0.0, 0.0, np.pi - 0.001), (0.0, 0.0, 0.001 - np.pi)) == pytest.approx(
        (0.0, 0.002)
    )


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


def test_collisions_are_told_by_kilometre_and_episode():
    assert metrics.collisions_per_km(3, [1000.0, 500.0]) == 2.0
    assert metrics.collisions_per_km(0, [0.0]) is None
    assert metrics.collisions_per_episode([0, 1, 2]) == 1.0
    assert metrics.collisions_per_episode([]) is None


def test_memory_is_told_in_megabytes():
    assert 20.0 < metrics.peak_megabytes() < 1e6


def test_decision_times_are_told_in_milliseconds():
    assert metrics.decision_percentiles([0.001, 0.002, 0.003]) == {"p50": 2.0, "p95": 2.9}
    assert metrics.decision_percentiles([]) == {"p50": None, "p95": None}


@given(masks, masks, masks)
def test_shares_stay_between_zero_and_one(first, second, third):
    assert 0.0 <= metrics.free_coverage(first, second) <= 1.0
    assert 0.0 <= metrics.valid_coverage(first, second & ~third, third) <= 1.0
    assert 0.0 <= metrics.occupied_f1(first, second) <= 1.0
    assert 0.0 <= metrics.occupied_iou(first, second, third & ~second) <= 1.0


@given(masks, masks)
def test_f1_does_not_care_which_map_is_the_truth(first, second):
    assert metrics.occupied_f1(first, second) == pytest.approx(metrics.occupied_f1(second, first))


@given(st.lists(masks, min_size=1, max_size=4))
def test_overlap_is_that_of_the_counts(seen):
    times = np.sum(seen, axis=0)
    expected = (times >= 2).sum() / max((times >= 1).sum(), 1)
    assert metrics.overlap([pack_bits(own) for own in seen]) == pytest.approx(expected)
