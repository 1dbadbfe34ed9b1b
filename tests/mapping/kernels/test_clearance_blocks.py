"""Blocks of steps and squared distances against their plain definitions."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from lidarium.mapping.kernels import clearance_blocks
from lidarium.mapping.kernels.compilation import kernel
from lidarium.mapping.kernels.in_python import plain

numbers = arrays(np.uint16, 64, elements=st.integers(0, 3))


@kernel
def squares_at(steps, far, cap, result):
    return clearance_blocks.write_squares(steps, far, cap, result)


@kernel
def count_at(log_odds, stride, rows, steps, largest, fewest, width):
    clearance_blocks.count_rows(log_odds, stride, rows, steps, largest, fewest, width)


@kernel
def least_at(numbers, costs, low, high, cap, result):
    clearance_blocks.write_least_sums(numbers, costs, low, high, cap, result)


@kernel
def compare_at(log_odds, block, other, number):
    differ = clearance_blocks.cells_that_differ(log_odds, block, number)
    same = clearance_blocks.same_cells(block, other)
    clearance_blocks.raise_block(block, other)
    return differ, same


@given(arrays(np.uint16, 64, elements=st.integers(0, 91)), st.integers(1, 91))
def test_steps_become_squared_half_cells_up_to_a_cap(steps, far):
    cap, result = max((2 * far - 1) ** 2 - 3, 1), np.zeros(64, np.uint16)
    assert squares_at(steps.ctypes.data, far, cap, result.ctypes.data) == steps.min()
    assert np.array_equal(result, plain.squares_of(steps, far, cap))


@given(arrays(np.int8, (7, 70), elements=st.integers(-1, 1)), st.booleans(), st.integers(1, 9))
def test_rows_since_the_last_occupied_cell_are_counted_either_way(log_odds, is_back, largest):
    steps, fewest = np.full(64, largest, np.uint16), np.full((7, 64), 3, np.uint16)
    order = slice(None, None, -1) if is_back else slice(None)
    begin, sign = (6, -1) if is_back else (0, 1)
    counted = plain.count_rows(log_odds[order, 2:66], steps, largest)
    expected = np.minimum(3, counted)
    log_odds_at, fewest_at = log_odds[begin, 2:].ctypes.data, fewest[begin].ctypes.data
    count_at(log_odds_at, sign * 70, 7, steps.ctypes.data, largest, fewest_at, sign * 128)
    assert np.array_equal(fewest[order], expected)
    assert np.array_equal(steps, counted[-1])


@given(
    arrays(np.uint16, 70, elements=st.integers(0, 900)),
    arrays(np.uint16, 6, elements=st.integers(0, 900)),
    st.integers(1, 6),
    st.integers(0, 2000),
)
def test_the_least_sum_is_subtracted_from_a_cap(numbers, costs, count, cap):
    result = np.zeros(64, np.uint16)
    least_at(numbers.ctypes.data, costs.ctypes.data, 0, count, cap, result.ctypes.data)
    assert np.array_equal(result, plain.least_sums(numbers, costs[:count], cap))


@given(arrays(np.int8, 64, elements=st.integers(-1, 1)), numbers, numbers, st.integers(0, 3))
def test_blocks_are_compared_and_raised(log_odds, block, other, number):
    expected = plain.bits_of((log_odds > 0) ^ (block == number)), plain.same_cells(block, other)
    raised = np.maximum(block, other)
    found = compare_at(log_odds.ctypes.data, block.ctypes.data, other.ctypes.data, number)
    assert (int(found[0]), int(found[1])) == expected
    assert np.array_equal(block, raised)
