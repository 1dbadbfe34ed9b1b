"""Targets of a search, and the tiles near them."""

import math

import numpy as np
import pytest

from lidarium.mapping.planning.search.search_targets import Targets, disc_spans, near_tiles


@pytest.mark.parametrize("reach", [0.0, 0.9, 1.0, 2.5, math.sqrt(8.0), 7.0])
def test_a_disc_holds_the_cells_whose_centres_are_within_reach(reach):
    spans = disc_spans(reach)
    k = len(spans) // 2
    for row in range(-k - 1, k + 2):
        for column in range(-9, 10):
            is_held = abs(row) <= k and abs(column) <= spans[row + k]
            assert is_held == (math.hypot(row, column) <= reach + 1e-6)


def test_no_target_is_within_reach_of_a_tile_that_is_left_out():
    mask = np.random.default_rng(1).random((70, 90)) < 0.001
    for reach in (0.0, 3.0, 20.0):
        targets = Targets.of(mask, reach)
        assert targets.near.shape == (5, 6)
        for row, column in np.argwhere(targets.near == 0):
            cells = np.argwhere(np.ones((16, 16))) + np.array([16 * row, 16 * column])
            gaps = np.linalg.norm(cells[:, None] - np.argwhere(mask)[None], axis=2)
            assert gaps.min() > reach
        assert (targets.near == 0).any() or reach == 20.0


def test_other_values_of_a_mask_are_no_targets():
    mask = np.zeros((40, 40), np.uint8)
    mask[3, 3], mask[30, 30] = 2, 1
    assert Targets.of(mask).near.tolist() == [[0, 0, 0], [0, 1, 0], [0, 0, 0]]


def test_cells_are_targets_from_themselves():
    targets = Targets.at([(0, 0), (17, 33)], (20, 40))
    assert np.argwhere(targets.mask == 1).tolist() == [[0, 0], [17, 33]]
    assert targets.near.tolist() == [[1, 0, 0], [0, 0, 1]]
    assert targets.spans.tolist() == [0]


def test_near_tiles_end_with_the_grid():
    counts = np.zeros((3, 4), np.int32)
    counts[0, 0] = 5
    assert near_tiles(counts, 16.5).tolist() == [[1, 1, 1, 0], [1, 1, 1, 0], [1, 1, 1, 0]]
    assert near_tiles(counts, 0.0).sum() == 1
