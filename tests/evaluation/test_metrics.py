import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from lidarium.envs.coverage import pack_bits
from lidarium.evaluation import metrics

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
    assert metrics.surface(occupied, mask(".... .... .... ####")).tolist() == mask(".... .... #### ....").tolist()


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
    assert metrics.occupied_iou(mask("##...... ........"), occupied, sensed) == pytest.approx((2 + 3) / (2 + 8))


def test_iou_falls_for_ghost_walls():
    occupied, sensed = mask("#..... ......"), mask("...... ##....")
    assert metrics.occupied_iou(mask("#....# ......"), occupied, sensed) == pytest.approx((1 + 1) / (2 + 1))


def test_iou_of_nothing_is_one():
    nothing = np.zeros((3, 3), bool)
    assert metrics.occupied_iou(nothing, nothing, nothing) == 1.0


def test_f1_has_precision_and_recall_within_a_cell():
    occupied = mask("####....")
    assert metrics.occupied_f1(occupied, occupied) == 1.0
    # 2 of the 3 believed cells are within a cell of a true one, 2 of the 4 true ones within a cell of a believed one.
    assert metrics.occupied_f1(mask("...##..#"), occupied) == pytest.approx(2 * (2 / 3) * (2 / 4) / (2 / 3 + 2 / 4))
    assert metrics.occupied_f1(mask("........"), occupied) == 0.0
    assert metrics.occupied_f1(mask("........"), mask("........")) == 1.0
    assert metrics.occupied_f1(mask("...##..#"), occupied, tolerance=0) == pytest.approx(2 * (1 / 3) * (1 / 4) / (1 / 3 + 1 / 4))


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
