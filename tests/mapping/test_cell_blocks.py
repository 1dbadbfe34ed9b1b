"""Blocks of 64 cells told apart by their signs."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from lidarium.mapping.cell_blocks import negative_cells, positive_cells
from lidarium.mapping.kernels import kernel


@kernel
def signs_at(address):
    return negative_cells(address), positive_cells(address)


def bits_of(cells):
    return sum(1 << k for k in np.flatnonzero(cells).tolist())


@given(arrays(np.int8, 67), st.integers(0, 3))
def test_the_signs_of_a_block_are_told_wherever_it_lies(cells, offset):
    block = cells[offset : offset + 64]
    negative, positive = signs_at(block.ctypes.data)
    assert int(negative) == bits_of(block < 0)
    assert int(positive) == bits_of(block > 0)
