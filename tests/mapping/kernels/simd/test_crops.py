"""Blocks of a turned crop."""

import numpy as np
import pytest
from both_forms import assert_forms_agree
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from lidarium.mapping.kernels.simd import crops
from lidarium.mapping.kernels.simd.crops import COLUMNS, PLACES, ROWS, SIDE

pytestmark = pytest.mark.skipif(not crops.CAN_LOOK_UP_IN_REGISTERS, reason="this processor has no AVX-512 VBMI")

maps = arrays(np.int8, (ROWS, COLUMNS))
indices = arrays(np.uint8, 64, elements=st.integers(0, 16 * 11 + 10))


@given(maps, indices)
def test_cells_are_picked_by_their_indices(log_odds, where):
    crop = np.zeros((SIDE, 11), np.uint8)
    levels = assert_forms_agree(crops.write_block, log_odds, COLUMNS, where, crop, 11)[3]
    assert np.array_equal(levels[:, :SIDE].ravel() < 127, log_odds.ravel()[where] > 0)


@given(maps, indices, arrays(np.uint16, ROWS))
def test_cells_beyond_the_map_are_unknown(log_odds, where, inside):
    crop = np.zeros((SIDE, SIDE), np.uint8)
    assert_forms_agree(crops.write_border, log_odds, COLUMNS, inside, where, crop, SIDE)


@given(st.integers(0, 4 << PLACES), st.integers(0, 4 << PLACES), arrays(np.int32, (2, 64)))
def test_an_index_is_sixteen_times_the_row_and_the_column(x, y, offsets):
    offsets = (offsets % (6 << PLACES)).astype(np.int32)
    written = assert_forms_agree(crops.write_indices, x, y, 0, offsets, np.zeros(64, np.uint8))[2]
    columns, rows = (offsets[0].astype(int) + x) >> PLACES, (offsets[1].astype(int) + y) >> PLACES
    assert np.array_equal(written, COLUMNS * rows + columns)
