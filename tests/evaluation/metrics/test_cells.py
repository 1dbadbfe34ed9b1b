"""Shares of cells: coverage, overlap, and maps against the truth."""

import numpy as np
import pytest
from drawn_masks import mask, masks
from hypothesis import given
from hypothesis import strategies as st

from lidarium.envs.simulation.coverage import pack_bits
from lidarium.evaluation.metrics import cells, progress
from lidarium.evaluation.metrics.cells import share


def test_cells_that_are_not_0_count():
    assert share(np.array([[0, 2], [-1, 0]]), np.array([[1, 1], [1, 1]])) == 0.5
    assert share(np.zeros((2, 2), bool), np.ones((2, 2), bool)) == 0.0


def test_of_nothing_all_is_there_unless_something_else_is_asked_for():
    nothing = np.zeros((2, 2), bool)
    assert share(nothing, nothing) == 1.0
    assert share(nothing, nothing, empty=0.0) == 0.0


def test_free_coverage_is_the_sensed_share_of_what_counts():
    counted = mask("##.. ##..")
    assert cells.free_coverage(mask("#.## ...."), counted) == 0.25
    assert cells.free_coverage(counted, counted) == 1.0
    assert cells.free_coverage(mask(".... ...."), np.zeros((2, 4), bool)) == 1.0


def test_own_coverage_gives_the_least_and_the_mean():
    counted = mask("####")
    assert cells.own_coverage(np.stack([mask("##.."), mask("###.")]), counted) == (0.5, 0.625)


def test_known_coverage_counts_walls_as_well():
    assert cells.known_coverage(mask("##.. ..##"), mask("###. ###.")) == 0.5


def test_valid_coverage_counts_free_cells_and_the_walls_around_them():
    counted = mask("..... .#... .....")
    occupied = mask("####. #.##. ####.")
    # F is one cell and its surface the eight around it; the known column 0 holds three of them.
    assert cells.valid_coverage(mask("#.... #.... #...."), counted, occupied) == pytest.approx(3 / 9)


def test_cells_known_beyond_the_truth_do_not_count_as_they_do_for_explore_bench():
    assert cells.known_coverage(mask("####"), mask("##..")) == 1.0


@given(masks, masks, masks)
def test_shares_stay_between_zero_and_one(first, second, third):
    assert 0.0 <= cells.free_coverage(first, second) <= 1.0
    assert 0.0 <= cells.valid_coverage(first, second & ~third, third) <= 1.0
    assert 0.0 <= cells.occupied_f1(first, second) <= 1.0
    assert 0.0 <= cells.occupied_iou(first, second, third & ~second) <= 1.0


def test_overlap_is_what_two_saw_of_what_one_saw():
    seen = [pack_bits(mask(text)) for text in ("###.......", ".##.......", "..##......")]
    assert cells.overlap(seen) == 0.5
    assert cells.overlap(seen[:1]) == 0.0
    assert cells.overlap([np.zeros((2, 1), np.uint64)]) == 0.0


def test_overlap_of_maps_and_balance_are_what_explore_bench_prints():
    """Its script: np.std of the robots' rates, and their sum less 1, a rate being known cells over cells
    that are not 205."""
    truth = np.array([[0, 254, 254, 254, 205], [0, 254, 254, 254, 205]])
    scans = np.array([[[100, 0, 0, -1, -1], [-1, 0, 0, 0, -1]], [[-1, -1, 0, 0, -1], [-1, 0, 0, 0, -1]]])
    rates = [(scan != -1).sum() / (truth != 205).sum() for scan in scans]
    shares = [cells.known_coverage(scan != -1, truth != 205) for scan in scans]
    assert shares == rates == [6 / 8, 5 / 8]
    assert cells.overlap_of_maps(shares) == np.sum(np.array(rates)) - 1 == 3 / 8
    assert progress.balance(shares) == np.std(np.array(rates)) == 1 / 16


def test_instant_overlap_is_the_mean_of_marvels_ratio_over_decisions():
    assert cells.instant_overlap([100, 50, 0], [50, 50, 0]) == pytest.approx((0.5 + 1.0 + 0.0) / 3)
    assert cells.instant_overlap([], []) == 0.0


@given(st.lists(masks, min_size=1, max_size=4))
def test_overlap_is_that_of_the_counts(seen):
    times = np.sum(seen, axis=0)
    expected = (times >= 2).sum() / max((times >= 1).sum(), 1)
    assert cells.overlap([pack_bits(own) for own in seen]) == pytest.approx(expected)


def test_the_surface_does_not_hold_the_inside_of_solids():
    occupied = mask("#### #### #### ....")
    assert cells.surface(occupied, mask(".... .... .... ####")).tolist() == mask(".... .... #### ....").tolist()


def test_iou_of_a_perfect_map_is_one_and_solid_interiors_do_not_count():
    occupied = mask("##### ##### ..... .....")
    sensed = mask("..... ..... ..... #####") | mask("..... ..... ##### .....")
    believed = mask("..... ##### ..... .....")
    assert cells.occupied_iou(believed, occupied, sensed) == 1.0


def test_iou_forgives_one_cell_and_not_two():
    occupied, sensed = mask("#... .... .... ...."), mask(".... #... .... ....")
    assert cells.occupied_iou(mask(".... .#.. .... ...."), occupied, sensed) == 1.0
    assert cells.occupied_iou(mask(".... .... #... ...."), occupied, sensed) == 0.0


def test_iou_counts_hits_on_either_side():
    occupied = mask("######## ........")
    sensed = mask("........ ########")
    # B has 2 cells and both hit; of the 8 cells of S the first 3 are within a cell of B.
    assert cells.occupied_iou(mask("##...... ........"), occupied, sensed) == pytest.approx((2 + 3) / (2 + 8))


def test_iou_falls_for_ghost_walls():
    occupied, sensed = mask("#..... ......"), mask("...... ##....")
    assert cells.occupied_iou(mask("#....# ......"), occupied, sensed) == pytest.approx((1 + 1) / (2 + 1))


def test_iou_of_nothing_is_one():
    nothing = np.zeros((3, 3), bool)
    assert cells.occupied_iou(nothing, nothing, nothing) == 1.0


def test_f1_has_precision_and_recall_within_a_cell():
    occupied = mask("####....")
    assert cells.occupied_f1(occupied, occupied) == 1.0
    # 2 of the 3 believed cells are within a cell of a true one, 2 of the 4 true ones within a cell of a
    # believed one.
    assert cells.occupied_f1(mask("...##..#"), occupied) == pytest.approx(2 * (2 / 3) * (2 / 4) / (2 / 3 + 2 / 4))
    assert cells.occupied_f1(mask("........"), occupied) == 0.0
    assert cells.occupied_f1(mask("........"), mask("........")) == 1.0
    assert cells.occupied_f1(mask("...##..#"), occupied, tolerance=0) == pytest.approx(
        2 * (1 / 3) * (1 / 4) / (1 / 3 + 1 / 4)
    )


def test_f1_does_not_ask_for_what_cannot_be_seen():
    occupied, wanted = mask("#### #### ...."), mask(".... #### ....")
    believed = mask(".... #### ....")
    assert cells.occupied_f1(believed, occupied, tolerance=0) < 1.0
    assert cells.occupied_f1(believed, occupied, tolerance=0, wanted=wanted) == 1.0


def test_free_error_rate_is_the_share_of_free_cells_that_are_walls():
    assert cells.free_error_rate(mask("####"), mask("...#")) == 0.25
    assert cells.free_error_rate(mask("...."), mask("...#")) == 0.0


@given(masks, masks)
def test_f1_does_not_care_which_map_is_the_truth(first, second):
    assert cells.occupied_f1(first, second) == pytest.approx(cells.occupied_f1(second, first))
