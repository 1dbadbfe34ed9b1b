"""Words of bits."""

import numpy as np
import pytest
from both_forms import assert_forms_agree
from hypothesis import given
from hypothesis import strategies as st
from numba import types

from lidarium.mapping.kernels.llvm import llvm_overload
from lidarium.mapping.kernels.simd import words
from lidarium.mapping.kernels.simd.words import (
    bits_of,
    cells_of,
    first_bit,
    free_cells,
    last_bit,
    near_cells,
    running_xor,
)


def test_words_have_a_bit_for_each_cell_the_first_lowest():
    cells = np.zeros(64, np.bool_)
    cells[[0, 3, 63]] = True
    assert bits_of(cells) == 1 + 8 + 2**63
    np.testing.assert_array_equal(cells_of(bits_of(cells)), cells)
    assert cells_of(0b101, 3).tolist() == [True, False, True]


@given(st.integers(1, 2**64 - 1))
def test_the_first_and_the_last_bit_are_found(word):
    assert assert_forms_agree(first_bit, np.uint64(word))[0] == (word & -word).bit_length() - 1
    assert last_bit(np.uint64(word)) == word.bit_length() - 1


def test_free_and_near_cells_have_a_bit_each():
    generator = np.random.default_rng(0)
    levels = generator.integers(-20, 21, 64).astype(np.int8)
    closeness = generator.integers(0, 2**16, 64).astype(np.uint16)
    assert assert_forms_agree(free_cells, levels)[0] == bits_of(levels < 0)
    for limit in (-1, 0, int(closeness[3]), 2**16 - 1):
        assert assert_forms_agree(near_cells, closeness, limit)[0] == bits_of(closeness <= limit)


@given(st.integers(0, 2**64 - 1))
def test_each_bit_is_the_exclusive_or_of_all_up_to_it(word):
    assert_forms_agree(running_xor, np.uint64(word))


def test_between_two_bits_all_bits_are_set_but_the_second():
    assert running_xor(np.uint64(0b100100)) == 0b11100
    assert running_xor(np.uint64(1 << 62)) == 3 << 62
    assert running_xor(np.uint64(0)) == 0


def by_shifts(word):
    return running_xor(word)


llvm_overload(by_shifts, types.uint64, types.uint64)(words._running_xor_by_shifts)


@pytest.mark.parametrize("word", [0, 1, 2**63, 2**64 - 1, 0x5555555555555555, 0x8000000000000001])
def test_processors_without_the_instruction_give_the_same(word):
    assert_forms_agree(by_shifts, np.uint64(word))
