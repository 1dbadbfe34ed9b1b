"""Grids kept as runs of equal cells."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from lidarium.envs.floors.raster import LATTICE, Raster, Runs, cells_within, frame_of, rectangles_of, sampled


@given(
    arrays(
        st.sampled_from([np.bool_, np.uint8, np.uint16]),
        array_shapes(min_dims=2, max_dims=2, max_side=12),
        elements=st.integers(0, 1),
    )
)
def test_a_grid_is_unpacked_as_it_was(grid):
    runs = Runs.of(grid)
    found = runs.grid()
    assert found.dtype == grid.dtype
    np.testing.assert_array_equal(found, grid)
    assert (runs.values[1:] != runs.values[:-1]).all()
    np.testing.assert_array_equal(runs.counts(), np.bincount(grid.ravel().astype(np.int64)))


def test_what_was_unpacked_cannot_be_written():
    with pytest.raises(ValueError, match="read-only"):
        Runs.of(np.zeros((2, 3), np.uint8)).grid()[0, 0] = 1


def test_a_mask_of_large_areas_takes_little():
    mask = np.zeros((500, 800), np.bool_)
    mask[100:400, 200:700] = True
    assert Runs.of(mask).nbytes < mask.nbytes / 100


@pytest.mark.parametrize("resolution", [0.025, 0.05, 0.1, 0.2])
def test_a_frame_has_a_cell_beyond_the_bounds_on_all_sides_and_lies_on_the_lattice(resolution):
    for bounds in ((0.0, 0.0, 3.0, 2.0), (-1.23, 0.31, 4.56, 7.89), (0.3, 0.3, 0.6, 0.6)):
        (x, y), (rows, columns) = frame_of(bounds, resolution)
        for corner in (x, y):
            assert corner == round(corner / LATTICE) / round(1.0 / LATTICE)
        assert x <= bounds[0] - resolution + 1e-9
        assert y <= bounds[1] - resolution + 1e-9
        assert x + columns * resolution >= bounds[2] + resolution - 1e-9
        assert y + rows * resolution >= bounds[3] + resolution - 1e-9
        assert rows % 8 == columns % 8 == 0


def test_cells_whose_centre_is_within_are_within():
    rows, columns = cells_within((0.1, 0.2, 0.45, 0.4), (0.0, 0.0), 0.1)
    assert (rows, columns) == (slice(2, 4), slice(1, 5))


def test_cells_are_those_under_each_centre_and_solid_beyond_the_image():
    cells = Raster(np.array([[0, 1], [0, 0]], np.uint8), (0.0, 0.0), 0.2)
    found = sampled(cells, (-0.1, 0.0), 0.1, (slice(0, 5), slice(0, 6)))
    assert found.tolist() == [
        [1, 0, 0, 1, 1, 1],
        [1, 0, 0, 1, 1, 1],
        [1, 0, 0, 0, 0, 1],
        [1, 0, 0, 0, 0, 1],
        [1, 1, 1, 1, 1, 1],
    ]


def test_equal_runs_below_each_other_are_one_rectangle():
    assert rectangles_of(np.ones((3, 4), bool)).tolist() == [[0, 0, 3, 4]]
    assert rectangles_of(np.zeros((3, 4), bool)).shape == (0, 4)
    assert rectangles_of(np.zeros((0, 4), bool)).shape == (0, 4)


def test_what_is_kept_of_a_raster_counts_as_its_memory():
    raster = Raster(np.zeros((4, 4), np.uint8), (0.0, 0.0), 0.1)
    assert raster.nbytes == 16
    raster.kept[("a",)] = Runs.of(np.zeros((4, 4), np.uint8))
    assert raster.nbytes == 16 + 1 + 4


def test_rectangles_cover_each_cell_once():
    generator = np.random.default_rng(1)
    for _ in range(20):
        solid = generator.integers(0, 3, (13, 17)) > 0
        counts = np.zeros(solid.shape, int)
        for first_row, first_column, row, column in rectangles_of(solid):
            counts[first_row:row, first_column:column] += 1
        assert (counts == solid).all()
