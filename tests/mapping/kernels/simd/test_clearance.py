"""Blocks of steps and squared distances."""

import numpy as np
from both_forms import assert_forms_agree
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from lidarium.mapping.kernels.simd import clearance
from lidarium.mapping.kernels.simd.words import bits_of

numbers = arrays(np.uint16, 64, elements=st.integers(0, 3))


@given(arrays(np.uint16, 64, elements=st.integers(0, 91)), st.integers(1, 91))
def test_steps_become_squared_half_cells_up_to_a_cap(steps, far):
    cap, result = max((2 * far - 1) ** 2 - 3, 1), np.zeros(64, np.uint16)
    fewest, _, squares = assert_forms_agree(clearance.write_squares, steps, far, cap, result)
    assert fewest == steps.min()
    for step, square in zip(steps.tolist(), squares.tolist(), strict=True):
        assert square == (min(max(2 * step - 1, 0) ** 2, cap) if step < far else cap)


@given(arrays(np.int8, (7, 70), elements=st.integers(-1, 1)), st.booleans(), st.integers(1, 9))
def test_rows_since_the_last_occupied_cell_are_counted_either_way(log_odds, is_back, maximum):
    steps, minima = np.full(64, maximum, np.uint16), np.full((7, 64), 3, np.uint16)
    begin, sign = (6, -1) if is_back else (0, 1)
    source, target = [log_odds, 70 * begin + 2], [minima, 128 * begin]
    arguments = source, 70 * sign, 7, steps, maximum, target, 128 * sign
    counted = assert_forms_agree(clearance.count_rows, *arguments)[2]
    for column in range(64):
        rows = np.flatnonzero(log_odds[::sign, column + 2] > 0)
        assert counted[column] == (min(6 - rows[-1], maximum) if rows.size else maximum)


@given(
    arrays(np.uint16, 70, elements=st.integers(0, 900)),
    arrays(np.uint16, 6, elements=st.integers(0, 900)),
    st.integers(1, 6),
    st.integers(0, 2000),
)
def test_the_smallest_sum_is_subtracted_from_a_cap(numbers, costs, count, cap):
    result = np.zeros(64, np.uint16)
    written = assert_forms_agree(clearance.write_min_sums, numbers, costs, 0, count, cap, result)[3]
    sums = [int(numbers[7 + k]) + int(costs[k]) for k in range(count)]
    assert written[7] == max(cap - min(sums), 0)


@given(arrays(np.int8, 64, elements=st.integers(-1, 1)), numbers, numbers, st.integers(0, 3))
def test_blocks_are_compared_and_raised(log_odds, block, other, number):
    differ = assert_forms_agree(clearance.cells_that_differ, log_odds, block, number)[0]
    assert differ == bits_of((log_odds > 0) ^ (block == number))
    assert assert_forms_agree(clearance.same_cells, block, other)[0] == bits_of((block == other) & (block > 0))
    raised = np.maximum(block, other)
    clearance.raise_block(block.ctypes.data, other.ctypes.data)
    assert np.array_equal(block, raised)
