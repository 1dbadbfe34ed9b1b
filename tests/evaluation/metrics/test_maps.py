"""How maps agree with the truth."""

import numpy as np
import pytest
from drawn_masks import mask, masks
from hypothesis import given

from lidarium.evaluation import metrics


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


def test_f1_does_not_ask_for_what_cannot_be_seen():
    occupied, wanted = mask("#### #### ...."), mask(".... #### ....")
    believed = mask(".... #### ....")
    assert metrics.occupied_f1(believed, occupied, tolerance=0) < 1.0
    assert metrics.occupied_f1(believed, occupied, tolerance=0, wanted=wanted) == 1.0


def test_free_error_rate_is_the_share_of_free_cells_that_are_walls():
    assert metrics.free_error_rate(mask("####"), mask("...#")) == 0.25
    assert metrics.free_error_rate(mask("...."), mask("...#")) == 0.0


@given(masks, masks)
def test_f1_does_not_care_which_map_is_the_truth(first, second):
    assert metrics.occupied_f1(first, second) == pytest.approx(metrics.occupied_f1(second, first))
