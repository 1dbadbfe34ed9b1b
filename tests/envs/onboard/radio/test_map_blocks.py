"""Blocks of maps that differ."""

import numpy as np
import pytest

from lidarium.envs.onboard.radio.exchange import BLOCK, differing_blocks


@pytest.mark.parametrize("seed", range(4))
def test_blocks_that_differ_bring_a_copy_up_to_date(seed):
    generator = np.random.default_rng(seed)
    copy = np.zeros((40, 192), np.int8)
    copy[10:20, 30:150] = generator.integers(-5, 6, (10, 120))
    held = copy.copy()
    for _ in range(6):
        held[generator.integers(40), generator.integers(192)] += 1
    held[12] = 0  # a correction has emptied what the receiver still holds
    blocks, cells = differing_blocks(held, copy)
    wanted = np.flatnonzero((held.reshape(-1, BLOCK) != copy.reshape(-1, BLOCK)).any(axis=1))
    assert blocks.tolist() == wanted.tolist()
    copy.reshape(-1, BLOCK)[blocks] = cells
    assert np.array_equal(copy, held)


def test_maps_that_are_the_same_have_no_blocks():
    for held in (np.zeros((4, 64), np.int8), np.ones((4, 128), np.int8)):
        blocks, cells = differing_blocks(held, held.copy())
        assert blocks.shape == (0,)
        assert cells.shape == (0, BLOCK)
