"""Pictures show walls without the specks that noise leaves in them, and everything else as the map has it."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from lidarium.mapping.grids.occupancy import FREE, OCCUPIED, UNKNOWN
from lidarium.mapping.grids.speckle_filter import LARGEST_COMPONENT, without_small_components

LEVELS = arrays(
    np.uint8,
    array_shapes(min_dims=2, max_dims=2, min_side=1, max_side=24),
    elements=st.sampled_from([OCCUPIED, UNKNOWN, FREE]),
)


def wall():
    """Return a thick wall with free space below and the unknown above it."""
    levels = np.full((20, 30), FREE, np.uint8)
    levels[8:13] = OCCUPIED
    levels[13:] = UNKNOWN
    return levels


def test_a_free_cell_within_a_wall_is_closed():
    levels = wall()
    levels[10, 7] = FREE
    np.testing.assert_array_equal(without_small_components(levels), wall())


def test_free_cells_that_touch_at_corners_alone_are_specks_of_their_own():
    levels = wall()
    levels[9:12, 4:20] = np.where(np.indices((3, 16)).sum(axis=0) % 2, np.uint8(FREE), levels[9:12, 4:20])
    np.testing.assert_array_equal(without_small_components(levels), wall())


def test_what_is_larger_than_a_speck_stays_open():
    levels = wall()
    levels[10, 5 : 5 + LARGEST_COMPONENT + 1] = FREE
    np.testing.assert_array_equal(without_small_components(levels), levels)


def test_a_gap_that_the_floor_reaches_stays_open():
    levels = wall()
    levels[8:10, 5] = FREE
    np.testing.assert_array_equal(without_small_components(levels), levels)


def test_what_was_glimpsed_far_from_walls_stays_free():
    levels = np.full((9, 9), UNKNOWN, np.uint8)
    levels[4, 4] = FREE
    np.testing.assert_array_equal(without_small_components(levels), levels)


@given(LEVELS)
def test_only_free_cells_change_and_only_to_walls_and_no_speck_is_left(levels):
    before = levels.copy()
    closed = without_small_components(levels)
    np.testing.assert_array_equal(levels, before)
    changed = closed != levels
    assert (levels[changed] == FREE).all()
    assert (closed[changed] == OCCUPIED).all()
    np.testing.assert_array_equal(without_small_components(closed), closed)
