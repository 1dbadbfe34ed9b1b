"""Signs of blocks of 64 cells against their plain definitions."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from lidarium.mapping.kernels import sign_blocks
from lidarium.mapping.kernels.compilation import kernel
from lidarium.mapping.kernels.in_python import plain


@kernel
def signs_at(bytes_at, shorts_at):
    below, above = sign_blocks.sign_bits(shorts_at)
    return sign_blocks.negative_cells(bytes_at), sign_blocks.positive_cells(bytes_at), below, above


@given(arrays(np.int8, 67), arrays(np.int16, 64), st.integers(0, 3))
def test_the_signs_of_a_block_are_found_at_any_address(cells, sums, offset):
    block = cells[offset : offset + 64]
    found = [int(word) for word in signs_at(block.ctypes.data, sums.ctypes.data)]
    assert found == [plain.bits_of(cells) for cells in (block < 0, block > 0, sums < 0, sums > 0)]
