"""Crops of a map equal what numpy cuts, pools and turns, at every place, heading and scale."""

import math
import os
import subprocess
import sys

import numpy as np
import pytest
from cropped_maps import crop, pooled_levels, random_map
from hypothesis import given, settings
from hypothesis import strategies as st

from lidarium.mapping.grids.map_crops import crop_levels, turn_by_cells
from lidarium.mapping.grids.occupancy import FREE, OCCUPIED, UNKNOWN, three_levels


def levels_around(log_odds, row, column, scale, half):
    """Levels of 2 * half pooled cells a side around the corner of pooled cells that is nearest to a corner
    of cells."""
    padding = 2 * half + 400
    around = np.pad(pooled_levels(log_odds, scale), padding, constant_values=UNKNOWN)
    row, column = (
        min(max(math.floor(value / scale + 0.5), -300 - half), 300 + half) + padding for value in (row, column)
    )
    return around[row - half : row + half, column - half : column + half]


def turned(log_odds, row, column, heading, scale, cells):
    """The crop by whole numbers of half steps of 2**-15 cells: each centre is looked up in the pooled cell
    in which it lies."""
    half = cells
    pooled = levels_around(log_odds, row, column, scale, half)
    step_x, step_y = round(math.cos(heading) * 2**15), round(math.sin(heading) * 2**15)
    left, forward = np.meshgrid(*[2 * np.arange(cells, dtype=np.int64) + 1 - cells] * 2, indexing="ij")
    x, y = forward * step_x - left * step_y, forward * step_y + left * step_x
    return pooled[(y >> 16) + half, (x >> 16) + half]


@given(row=st.integers(-40, 80), column=st.integers(-40, 170), half=st.integers(1, 32), seed=st.integers(0, 99))
@settings(max_examples=100)
def test_a_crop_is_what_numpy_cuts_out_unknown_outside(row, column, half, seed):
    log_odds = np.random.default_rng(seed).integers(-3, 4, (40, 128)).astype(np.int8)
    cut = np.full((2 * half, 2 * half), 99, np.uint8)
    crop_levels(log_odds, row, column, cut)
    padded = np.pad(log_odds, 200)
    expected = three_levels(padded[200 + row - half : 200 + row + half, 200 + column - half : 200 + column + half])
    assert np.array_equal(cut, expected)


@given(
    row=st.integers(-60, 100),
    column=st.integers(-60, 190),
    heading=st.floats(-4.0, 4.0),
    scales=st.lists(st.integers(1, 9), min_size=1, max_size=3),
    half=st.integers(1, 40),
    seed=st.integers(0, 99),
)
@settings(max_examples=300)
def test_a_turned_crop_is_what_numpy_pools_and_looks_up(row, column, heading, scales, half, seed):
    log_odds = random_map(seed)
    crops = crop(log_odds, row, column, heading, scales, 2 * half)
    for k, scale in enumerate(scales):
        assert np.array_equal(crops[k], turned(log_odds, row, column, heading, scale, 2 * half))


@pytest.mark.parametrize("heading", np.linspace(-math.pi, math.pi, 25))
@pytest.mark.parametrize(("cells", "scales"), [(64, (1, 4)), (50, (2, 3, 8)), (128, (6,))])
def test_a_turned_crop_is_right_all_around_within_a_large_map(heading, cells, scales):
    log_odds = random_map(3, 600, 640)
    crops = crop(log_odds, 310, 301, heading, scales, cells)
    for k, scale in enumerate(scales):
        assert np.array_equal(crops[k], turned(log_odds, 310, 301, heading, scale, cells))


@given(
    row=st.integers(-10, 50),
    column=st.integers(-10, 140),
    quarters=st.integers(-2, 2),
    scale=st.sampled_from([1, 2, 3, 4, 5, 6, 8, 16]),
    half=st.integers(1, 33),
    seed=st.integers(0, 99),
)
@settings(max_examples=200)
def test_along_the_axes_a_crop_is_the_cells_around_the_corner_turned_by_quarters(
    row, column, quarters, scale, half, seed
):
    log_odds = random_map(seed)
    crops = crop(log_odds, row, column, quarters * math.pi / 2.0, [scale], 2 * half)
    assert np.array_equal(crops[0], np.rot90(levels_around(log_odds, row, column, scale, half), quarters))


def test_ahead_is_to_the_right_and_left_is_up_at_any_heading():
    for heading in np.linspace(-math.pi, math.pi, 25):
        log_odds = np.full((192, 192), -20, np.int8)
        ahead_left = 30.0 * np.array([math.cos(heading), math.sin(heading)]) + 12.0 * np.array(
            [-math.sin(heading), math.cos(heading)]
        )
        column, row = (int(value) for value in np.floor(96.0 + ahead_left))
        log_odds[row - 1 : row + 2, column - 1 : column + 2] = 20
        fine, coarse = crop(log_odds, 96, 96, heading, [1, 2], 96)
        for levels, scale in ((fine, 1), (coarse, 2)):
            places = np.argwhere(levels == OCCUPIED).mean(axis=0) + 0.5 - 48
            assert places == pytest.approx([12.0 / scale, 30.0 / scale], abs=1.5)


def test_one_occupied_cell_makes_its_whole_group_occupied_and_one_unknown_cell_makes_it_unknown():
    log_odds = np.full((64, 64), -5, np.int8)
    log_odds[33, 34], log_odds[29, 30], log_odds[40, 40], log_odds[41, 41] = 1, 0, 0, 1
    levels = crop(log_odds, 32, 32, 0.0, [4], 8)[0]
    assert levels[4, 4] == OCCUPIED
    assert levels[3, 3] == UNKNOWN
    assert levels[6, 6] == OCCUPIED
    assert (levels == FREE).sum() == 61


def test_far_from_the_map_all_is_unknown():
    log_odds = np.full((64, 64), -5, np.int8)
    for row, column in ((-5000, 32), (32, -5000), (5000, 5000), (32, 5000)):
        assert (crop(log_odds, row, column, 0.3, [1, 4], 32) == UNKNOWN).all()


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
