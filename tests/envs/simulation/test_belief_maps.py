"""What is taken out of a map is noted where pooled maps and planning look for changes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lidarium.envs.simulation.beliefs import blank, wipe
from lidarium.mapping.grids.pooled_maps import pool_touched, touch, untouched

SHAPE = (96, 128)


def drawn(seed, low=10, high=60):
    generator = np.random.default_rng(seed)
    log_odds = np.zeros(SHAPE, np.int8)
    log_odds[low:high, 20:100] = generator.integers(-9, 9, (high - low, 80))
    return log_odds


def pooled(log_odds, scale, touched, before=None):
    result = np.zeros((-(-SHAPE[0] // scale), -(-SHAPE[1] // scale)), np.int8) if before is None else before
    pool_touched(log_odds, touched, scale, result)
    return np.sign(result)


def empty_window():
    return np.array([SHAPE[0], 0, SHAPE[1], 0], np.int64)


def everywhere():
    touched = untouched(*SHAPE)
    touch(touched, (0, SHAPE[0]), (0, SHAPE[1] // 64))
    return touched


@pytest.mark.parametrize("scale", [2, 4, 5])
@given(st.integers(0, 2**32 - 1), st.integers(0, 60), st.integers(0, 100), st.integers(1, 30), st.integers(1, 28))
def test_a_mask_is_made_unknown_and_noted(scale, seed, row, column, rows, columns):
    log_odds = drawn(seed)
    before, kept = log_odds.copy(), pooled(log_odds, scale, everywhere())
    where = np.random.default_rng(seed).random((rows, columns)) < 0.3
    touched, window = untouched(*SHAPE), empty_window()
    blank(log_odds, where, (row, column), touched, window)
    whole = np.zeros(SHAPE, bool)
    whole[row : row + rows, column : column + columns] = where
    assert (log_odds == np.where(whole, 0, before)).all()
    changed = np.argwhere(log_odds != before)
    assert ((changed >= window[[0, 2]]) & (changed < window[[1, 3]])).all()
    assert (pooled(log_odds, scale, touched, kept) == pooled(log_odds, scale, everywhere())).all()


@pytest.mark.parametrize("scale", [2, 4, 5])
def test_a_map_that_is_wiped_is_blank_and_noted_as_far_as_it_was_not(scale):
    log_odds = drawn(0)
    kept = pooled(log_odds, scale, everywhere())
    touched, window = untouched(*SHAPE), empty_window()
    wipe(log_odds, touched, window)
    assert not log_odds.any()
    assert window.tolist() == [10, 60, 0, 128]
    assert (pooled(log_odds, scale, touched, kept) == pooled(log_odds, scale, everywhere())).all()


def test_nothing_is_noted_where_nothing_changes():
    touched, window = untouched(*SHAPE), empty_window()
    wipe(np.zeros(SHAPE, np.int8), touched, window)
    blank(drawn(1), np.zeros((4, 4), bool), (0, 0), touched, window)
    assert not touched.any()
    assert window.tolist() == empty_window().tolist()
