"""Blocks of a turned crop against their plain definition."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from lidarium.mapping.kernels import crop_blocks
from lidarium.mapping.kernels.compilation import kernel
from lidarium.mapping.kernels.crop_blocks import COLUMNS, PLACES, ROWS, SIDE
from lidarium.mapping.kernels.in_python import plain

pytestmark = pytest.mark.skipif(
    not crop_blocks.CAN_LOOK_UP_IN_REGISTERS, reason="this processor has no AVX-512 VBMI"
)

maps = arrays(np.int8, (ROWS, COLUMNS))
places = arrays(np.uint8, 64, elements=st.integers(0, 16 * 11 + 10))


@kernel
def write_at(log_odds, where, crop, side):
    crop_blocks.write_block(log_odds, COLUMNS, where, crop, side)


@kernel
def write_border_at(log_odds, cells, where, crop):
    crop_blocks.write_border(log_odds, COLUMNS, cells, where, crop, SIDE)


@kernel
def places_at(x, y, first, offsets, where):
    crop_blocks.write_places(x, y, first, offsets, where)


@given(maps, places)
def test_cells_are_picked_by_their_places(log_odds, where):
    crop = np.zeros((SIDE, 11), np.uint8)
    write_at(log_odds.ctypes.data, where.ctypes.data, crop.ctypes.data, 11)
    assert np.array_equal(crop[:, :SIDE], plain.crop_block(log_odds, where))


@given(maps, places, arrays(np.uint16, ROWS))
def test_cells_beyond_the_map_are_unknown(log_odds, where, inside):
    crop = np.zeros((SIDE, SIDE), np.uint8)
    write_border_at(log_odds.ctypes.data, inside.ctypes.data, where.ctypes.data, crop.ctypes.data)
    is_inside = np.array([plain.cells_of(int(row), COLUMNS) for row in inside])
    assert np.array_equal(crop, plain.crop_block(np.where(is_inside, log_odds, 0), where))


@given(st.integers(0, 4 << PLACES), st.integers(0, 4 << PLACES), arrays(np.int32, (2, 64)))
def test_places_are_sixteen_times_the_row_and_the_column(x, y, offsets):
    offsets = offsets % (6 << PLACES)
    where = np.zeros(64, np.uint8)
    places_at(x, y, 0, offsets.ctypes.data, where.ctypes.data)
    columns, rows = (offsets[0].astype(int) + x) >> PLACES, (offsets[1].astype(int) + y) >> PLACES
    assert np.array_equal(where, COLUMNS * rows + columns)
