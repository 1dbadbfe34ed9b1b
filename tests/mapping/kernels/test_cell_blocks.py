"""Blocks of 64 cells told apart by their signs."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from lidarium.mapping.kernels.cell_blocks import negative_cells, positive_cells, sum_blocks
from lidarium.mapping.kernels.clearance_blocks import count_rows, write_squares
from lidarium.mapping.kernels.compilation import kernel


@kernel
def signs_at(address):
    return negative_cells(address), positive_cells(address)


@kernel
def sum_at(first, second, result):
    sum_blocks(first, second, result)


@kernel
def squares_at(steps, far, cap, result):
    return write_squares(steps, far, cap, result)


@kernel
def count_at(log_odds, stride, rows, steps, largest, fewest, width):
    count_rows(log_odds, stride, rows, steps, largest, fewest, width)


def bits_of(cells):
    return sum(1 << k for k in np.flatnonzero(cells).tolist())


@given(arrays(np.int8, 67), st.integers(0, 3))
def test_the_signs_of_a_block_are_told_wherever_it_lies(cells, offset):
    block = cells[offset : offset + 64]
    negative, positive = signs_at(block.ctypes.data)
    assert int(negative) == bits_of(block < 0)
    assert int(positive) == bits_of(block > 0)


@given(arrays(np.int8, 64), arrays(np.int8, 64), arrays(np.int8, 64), st.booleans())
def test_blocks_are_summed_without_running_over_also_into_one_of_them(first, second, result, is_same):
    expected = np.clip(first.astype(int) + second, -127, 127)
    target = first if is_same else result
    sum_at(first.ctypes.data, second.ctypes.data, target.ctypes.data)
    assert np.array_equal(target, expected)


@given(arrays(np.uint16, 64, elements=st.integers(0, 91)), st.integers(1, 91))
def test_steps_become_squared_half_cells_up_to_a_cap(steps, far):
    cap, result = max((2 * far - 1) ** 2 - 3, 1), np.zeros(64, np.uint16)
    assert squares_at(steps.ctypes.data, far, cap, result.ctypes.data) == steps.min()
    squares = np.minimum(np.maximum(2 * steps.astype(int) - 1, 0) ** 2, cap)
    assert np.array_equal(result, np.where(steps < far, squares, cap))


@given(arrays(np.int8, (7, 70), elements=st.integers(-1, 1)), st.booleans(), st.integers(1, 9))
def test_rows_since_the_last_occupied_cell_are_counted_either_way(log_odds, is_back, largest):
    steps, fewest = np.full(64, largest, np.uint16), np.full((7, 64), 3, np.uint16)
    rows = range(6, -1, -1) if is_back else range(7)
    begin = log_odds[rows[0], 2:].ctypes.data
    sign = -1 if is_back else 1
    count_at(begin, sign * 70, 7, steps.ctypes.data, largest, fewest[rows[0]].ctypes.data, sign * 128)
    counted, expected = np.full(64, largest), np.full((7, 64), 3)
    for row in rows:
        counted = np.where(log_odds[row, 2:66] > 0, 0, np.minimum(counted + 1, largest))
        expected[row] = np.minimum(expected[row], counted)
    assert np.array_equal(fewest, expected)
    assert np.array_equal(steps, counted)
