"""Grids kept as runs of equal cells."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from lidarium.envs.floors.runs import Runs


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
