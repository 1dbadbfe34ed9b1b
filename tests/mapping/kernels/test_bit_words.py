"""Words of bits against their plain definitions."""

import numba
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba.extending import intrinsic

from lidarium.mapping.kernels import bit_words
from lidarium.mapping.kernels.bit_words import first_bit, last_bit, running_xor
from lidarium.mapping.kernels.compilation import kernel
from lidarium.mapping.kernels.in_python import plain

words = st.integers(0, 2**64 - 1)


@kernel
def apply_to(word):
    return running_xor(word), first_bit(word), last_bit(word)


@given(words)
def test_each_bit_is_the_exclusive_or_of_all_up_to_it(word):
    assert int(apply_to(np.uint64(word))[0]) == plain.running_xor(word)


@given(words.filter(bool))
def test_the_first_and_the_last_bit_are_found(word):
    assert apply_to(np.uint64(word))[1:] == (plain.first_bit(word), word.bit_length() - 1)


@pytest.mark.parametrize("word", [0, 1, 2**63, 2**64 - 1, 0x5555555555555555, 0x8000000000000001])
def test_processors_without_the_instruction_give_the_same(word, monkeypatch):
    monkeypatch.setattr(bit_words, "CAN_MULTIPLY_WITHOUT_CARRY", False)
    run = intrinsic(bit_words._running_xor)
    assert numba.njit(lambda value: run(value))(np.uint64(word)) == plain.running_xor(word)
