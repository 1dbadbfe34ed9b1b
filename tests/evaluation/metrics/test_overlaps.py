"""How much of what robots saw others saw, too."""

import numpy as np
import pytest
from drawn_masks import mask, masks
from hypothesis import given
from hypothesis import strategies as st

from lidarium.envs.simulation.coverage import pack_bits
from lidarium.evaluation import metrics


def test_overlap_is_what_two_saw_of_what_one_saw():
    seen = [pack_bits(mask(text)) for text in ("###.......", ".##.......", "..##......")]
    assert metrics.overlap(seen) == 0.5
    assert metrics.overlap(seen[:1]) == 0.0
    assert metrics.overlap([np.zeros((2, 1), np.uint64)]) == 0.0


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


def test_instant_overlap_is_the_mean_of_marvels_ratio_over_decisions():
    assert metrics.instant_overlap([100, 50, 0], [50, 50, 0]) == pytest.approx((0.5 + 1.0 + 0.0) / 3)
    assert metrics.instant_overlap([], []) == 0.0


@given(st.lists(masks, min_size=1, max_size=4))
def test_overlap_is_that_of_the_counts(seen):
    times = np.sum(seen, axis=0)
    expected = (times >= 2).sum() / max((times >= 1).sum(), 1)
    assert metrics.overlap([pack_bits(own) for own in seen]) == pytest.approx(expected)
