"""What of a floor was sensed, and what of it maps know."""

import numpy as np
import pytest
from drawn_masks import mask, masks
from hypothesis import given

from lidarium.evaluation import metrics


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


def test_cells_known_beyond_the_truth_do_not_count_as_they_do_for_explore_bench():
    assert metrics.known_coverage(mask("####"), mask("##..")) == 1.0


@given(masks, masks, masks)
def test_shares_stay_between_zero_and_one(first, second, third):
    assert 0.0 <= metrics.free_coverage(first, second) <= 1.0
    assert 0.0 <= metrics.valid_coverage(first, second & ~third, third) <= 1.0
    assert 0.0 <= metrics.occupied_f1(first, second) <= 1.0
    assert 0.0 <= metrics.occupied_iou(first, second, third & ~second) <= 1.0
