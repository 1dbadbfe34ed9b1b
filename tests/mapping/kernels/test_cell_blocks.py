"""Blocks of 64 cells against their plain definitions."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from lidarium.mapping.kernels import cell_blocks
from lidarium.mapping.kernels.compilation import kernel
from lidarium.mapping.kernels.in_python import plain

words = st.integers(0, 2**64 - 1)
blocks = arrays(np.int8, 64)


@kernel
def update_at(address, seen, hits, steps, bounds):
    return cell_blocks.update_block(address, seen, hits, steps[0], steps[1], bounds[0], bounds[1])


@kernel
def sum_at(first, second, result):
    cell_blocks.sum_blocks(first, second, result)


@kernel
def write_greatest_at(rows, stride, count, least, halvings, result):
    cell_blocks.write_greatest(rows, stride, count, least, halvings, result)


@kernel
def write_levels_at(log_odds, half, whole):
    cell_blocks.write_levels(log_odds, half)
    cell_blocks.write_block_of_levels(log_odds, whole)


@given(blocks, words, words, st.integers(0, 127), st.integers(0, 127), st.integers(-127, 0))
def test_seen_cells_are_lowered_and_hit_ones_raised(block, seen, hits, hit, miss, least):
    bounds = (least, -least)
    expected, changed = plain.update_block(block, seen, hits, (hit, miss), bounds)
    signs = update_at(block.ctypes.data, np.uint64(seen), np.uint64(hits), (hit, miss), bounds)
    assert np.array_equal(block, expected)
    assert int(signs) == changed


@given(blocks, blocks, blocks, st.booleans())
def test_blocks_are_summed_without_overflow_also_into_one_of_them(first, second, result, is_same):
    expected = plain.sum_blocks(first, second)
    target = first if is_same else result
    sum_at(first.ctypes.data, second.ctypes.data, target.ctypes.data)
    assert np.array_equal(target, expected)


@given(arrays(np.int8, (5, 70)), st.integers(1, 5), st.integers(0, 6), st.integers(-128, 127))
def test_the_greatest_of_groups_is_found_over_rows_and_columns(rows, count, halvings, least):
    result = np.zeros(64, np.int8)
    write_greatest_at(rows[0, 3:].ctypes.data, 70, count, least, halvings, result.ctypes.data)
    expected = plain.greatest_of_groups(rows[:count, 3:67], least, halvings)
    assert np.array_equal(result[: len(expected)], expected)


@given(blocks)
def test_log_odds_are_written_as_levels(block):
    half, whole = np.full(64, 9, np.uint8), np.zeros(64, np.uint8)
    write_levels_at(block.ctypes.data, half.ctypes.data, whole.ctypes.data)
    assert np.array_equal(whole, plain.levels_of(block))
    assert np.array_equal(half, np.append(plain.levels_of(block[:32]), np.full(32, 9)))
