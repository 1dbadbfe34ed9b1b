"""Blocks of 64 cells of log-odds."""

import numpy as np
from both_forms import assert_forms_agree
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from lidarium.mapping.grids.occupancy import FREE, OCCUPIED, UNKNOWN
from lidarium.mapping.kernels.compilation import kernel
from lidarium.mapping.kernels.simd import cells
from lidarium.mapping.kernels.simd.words import bits_of

words = st.integers(0, 2**64 - 1).map(np.uint64)
blocks = arrays(np.int8, 64)
steps = st.integers(0, 127)


@kernel
def write_maxima(rows, stride, count, minimum, halvings, result):
    cells.max_of_groups(rows, stride, count, minimum, halvings, result)


steps = st.integers(0, 127)


@given(blocks, words, words, steps, steps, st.integers(-127, 0))
def test_seen_cells_are_lowered_and_hit_ones_raised(block, seen, hits, hit, miss, minimum):
    assert_forms_agree(cells.update_block, block, seen, hits, hit, miss, minimum, -minimum)


def test_hit_cells_are_raised_and_others_that_are_seen_lowered_within_bounds():
    old = np.zeros(64, np.int8)
    old[:6] = [-19, 0, 28, 5, -3, 2]
    seen, hits = np.uint64(0b111111), np.uint64(0b001100)
    changed, new = assert_forms_agree(cells.update_block, old, seen, hits, 9, 4, -20, 30)
    assert new[:6].tolist() == [-20, -4, 30, 14, -7, -2]
    assert not new[6:].any()
    # Cells whose sign has changed, zero being one of three.
    assert changed == 0b100010


def test_steps_larger_than_a_byte_do_not_wrap_around():
    old, none, all_cells = np.full(64, 120, np.int8), np.uint64(0), np.uint64(2**64 - 1)
    raised = assert_forms_agree(cells.update_block, old, none, all_cells, 100, 4, -128, 127)[1]
    lowered = assert_forms_agree(cells.update_block, -old, all_cells, none, 100, 100, -128, 127)[1]
    assert (raised == 127).all()
    assert (lowered == -128).all()


@given(arrays(np.int8, (9, 70)), st.integers(1, 9))
def test_blocks_are_summed_without_overflow_in_any_order(grids, count):
    addresses = np.full((9, 3), -1, np.int64)
    addresses[:, 1] = grids.ctypes.data + 70 * np.arange(9)
    total = assert_forms_agree(cells.sum_blocks, [addresses, 8], 24, count, 5, np.zeros(64, np.int8))[-1]
    assert np.array_equal(total, np.clip(grids[:count, 5:69].astype(int).sum(axis=0), -127, 127))


@given(arrays(np.int8, (5, 70)), st.integers(1, 5), st.integers(0, 6), st.integers(-128, 127))
def test_the_maximum_of_groups_is_found_over_rows_and_columns(rows, count, halvings, minimum):
    result, groups = np.zeros(64, np.int8), 64 >> halvings
    cells.max_of_groups(rows.ctypes.data + 3, 70, count, minimum, halvings, result.ctypes.data)
    expected = rows[:count, 3:67].reshape(count, groups, -1).max(axis=(0, 2))
    assert np.array_equal(result[:groups], np.maximum(expected, minimum))
    compiled = np.zeros(64, np.int8)
    write_maxima(rows.ctypes.data + 3, 70, count, minimum, halvings, compiled.ctypes.data)
    assert np.array_equal(compiled[:groups], result[:groups])


@given(blocks)
def test_log_odds_are_written_as_levels(block):
    signs = np.select([block > 0, block < 0], [OCCUPIED, FREE], UNKNOWN)
    whole = np.full(64, 9, np.uint8)
    cells.block_of_levels(block.ctypes.data, whole.ctypes.data)
    half = assert_forms_agree(cells.half_block_of_levels, block, np.full(64, 9, np.uint8))[2]
    assert np.array_equal(whole, signs)
    assert np.array_equal(half, np.append(signs[:32], np.full(32, 9)))


@given(arrays(np.int8, 67), arrays(np.int16, 64), st.integers(0, 3))
def test_the_signs_of_a_block_are_found_at_any_address(log_odds, sums, offset):
    block = log_odds[offset : offset + 64]
    assert assert_forms_agree(cells.negative_cells, [log_odds, offset])[0] == bits_of(block < 0)
    assert assert_forms_agree(cells.positive_cells, [log_odds, offset])[0] == bits_of(block > 0)
    assert assert_forms_agree(cells.sign_bits, sums)[0] == (bits_of(sums < 0), bits_of(sums > 0))


def test_memory_can_be_fetched_ahead_that_is_not_there():
    assert_forms_agree(cells.prefetch, 0)
