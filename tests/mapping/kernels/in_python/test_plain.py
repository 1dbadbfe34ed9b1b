"""Plain definitions say what each vector operation does, on cases worked out by hand."""

import numpy as np

from lidarium.mapping.kernels.in_python.plain import (
    bits_of,
    cells_of,
    first_bit,
    greatest_of_groups,
    levels_of,
    running_xor,
    sum_blocks,
    update_block,
)
from lidarium.mapping.kernels.vectors import LEVELS


def test_words_have_a_bit_for_each_cell_the_first_lowest():
    cells = np.zeros(64, np.bool_)
    cells[[0, 3, 63]] = True
    assert bits_of(cells) == 1 + 8 + 2**63
    np.testing.assert_array_equal(cells_of(bits_of(cells)), cells)
    assert cells_of(0b101, 3).tolist() == [True, False, True]
    assert first_bit(0b1011000) == 3


def test_between_two_bits_all_bits_are_set_but_the_second():
    assert running_xor(0b100100) == 0b11100
    assert running_xor(1 << 62) == 3 << 62
    assert running_xor(0) == 0


def test_hit_cells_are_raised_and_others_that_are_seen_lowered_within_bounds():
    old = np.zeros(64, np.int8)
    old[:6] = [-19, 0, 28, 5, -3, 2]
    new, changed = update_block(old, 0b111111, 0b001100, (9, 4), (-20, 30))
    assert new[:6].tolist() == [-20, -4, 30, 14, -7, -2]
    assert not new[6:].any()
    # Cells whose sign has changed, zero being one of three.
    assert changed == 0b100010


def test_steps_larger_than_a_byte_do_not_wrap_around():
    old = np.full(64, 120, np.int8)
    assert (update_block(old, 0, 2**64 - 1, (100, 4), (-128, 127))[0] == 127).all()
    assert (update_block(-old, 2**64 - 1, 0, (100, 100), (-128, 127))[0] == -128).all()


def test_sums_are_clipped_alike_on_both_sides():
    first = np.array([100, -100, 5], np.int8)
    assert sum_blocks(first, first).tolist() == [127, -127, 10]


def test_the_greatest_is_of_all_rows_and_of_a_group_of_columns():
    rows = np.array([[-5, -9, 3, 0], [-7, -6, 1, 2]], np.int8)
    assert greatest_of_groups(rows, -128, 1).tolist() == [-5, 3]
    assert greatest_of_groups(rows, 0, 1).tolist() == [0, 3]


def test_signs_are_levels():
    occupied, unknown, free = LEVELS
    assert levels_of(np.array([5, 0, -5], np.int8)).tolist() == [occupied, unknown, free]
