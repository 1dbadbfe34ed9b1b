"""Blocks of a rotated crop are those looked up cell by cell."""

import os
import subprocess
import sys

import numpy as np
from cropped_maps import crop, random_map
from hypothesis import given, settings
from hypothesis import strategies as st

from lidarium.mapping.grids.map_crops import turn_by_cells


@given(
    row=st.integers(-60, 100),
    column=st.integers(-60, 190),
    heading=st.floats(-4.0, 4.0),
    scales=st.lists(st.integers(1, 9), min_size=1, max_size=3),
    blocks=st.integers(1, 10),
    seed=st.integers(0, 99),
)
@settings(max_examples=200)
def test_crops_of_whole_blocks_are_those_looked_up_cell_by_cell(row, column, heading, scales, blocks, seed):
    log_odds = random_map(seed)
    crops = crop(log_odds, row, column, heading, scales, 8 * blocks)
    by_cells = crop(log_odds, row, column, heading, scales, 8 * blocks, turn_by_cells)
    assert np.array_equal(crops, by_cells)


def test_a_processor_that_cannot_look_up_in_registers_turns_the_same_crops(tmp_path):
    code = (
        "import sys, numpy as np; from lidarium.mapping.grids.map_crops import CAN_LOOK_UP_IN_REGISTERS, "
        "crop_turned;"
        "cells = np.random.default_rng(4).integers(-1, 2, (100, 128)).astype(np.int8);"
        "crops = np.zeros((1, 64, 64), np.uint8); pools = np.array([(cells.ctypes.data, 100, 128)], "
        "np.int64);"
        "crop_turned(pools, 70.0, 30.0, 0.7, np.array([1]), crops); assert not CAN_LOOK_UP_IN_REGISTERS; "
        "np.save(sys.argv[1], crops)"
    )
    without = {"NUMBA_ENABLE_AVX": "0", "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    subprocess.run(
        [sys.executable, "-c", code, str(tmp_path / "crops.npy")],
        env={**os.environ, **without},
        check=True,
        timeout=120,
    )
    log_odds = np.random.default_rng(4).integers(-1, 2, (100, 128)).astype(np.int8)
    assert np.array_equal(np.load(tmp_path / "crops.npy"), crop(log_odds, 30, 70, 0.7, [1], 64))
