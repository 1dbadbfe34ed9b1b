"""Closeness is updated around the cells that have changed."""

import numpy as np
import pytest

from lidarium.mapping.kernels.llvm import BLOCK
from lidarium.mapping.planning.clearance import ClearanceField
from lidarium.mapping.planning.clearance_updates import (
    changed_cells,
    grown_window,
    list_cells,
    room_for_cells,
    update_around,
)

RESOLUTION = 0.05
ALL = (0, 999, 0, 999)


def field_of(belief):
    field = ClearanceField(belief.shape, RESOLUTION, 0.3)
    field.update(belief)
    return field


@pytest.mark.parametrize("shape", [(20, 30), (50, 150)])
@pytest.mark.parametrize("seed", range(3))
def test_cells_that_came_or_went_are_listed_and_lead_to_a_field_made_anew(shape, seed):
    generator = np.random.default_rng(seed)
    belief = np.where(generator.random(shape) < 0.02, 9, -5).astype(np.int8)
    field = field_of(belief)
    later = belief.copy()
    for _ in range(6):
        row, column = (int(generator.integers(0, side)) for side in shape)
        later[row, column] = -5 if later[row, column] > 0 else 9
    later[generator.random(shape) < 0.1] //= 2  # what stays occupied or free has not changed
    changed = changed_cells(later, field.closeness, field.limit, ALL)
    np.testing.assert_array_equal(changed, np.argwhere((later > 0) != (belief > 0)))
    assert update_around(later, field.closeness, field.limit, field.stamp, changed)
    np.testing.assert_array_equal(field.closeness, field_of(later).closeness)


def test_only_a_window_is_compared():
    belief = np.full((40, 130), -5, np.int8)
    field = field_of(belief)
    belief[5, 10] = belief[5, 100] = belief[30, 100] = 9
    found = changed_cells(belief, field.closeness, field.limit, (0, 20, 64, 128))
    assert found.tolist() == [[5, 100]]


def test_nothing_changes_where_no_cell_has():
    belief = np.full((40, 130), -5, np.int8)
    field = field_of(belief)
    nothing = changed_cells(belief, field.closeness, field.limit, ALL)
    assert len(nothing) == 0
    assert not update_around(belief, field.closeness, field.limit, field.stamp, nothing)


def test_windows_grow_as_far_as_the_grid():
    assert grown_window((5, 9, 7, 8), 3, (20, 30)) == (2, 12, 4, 11)
    assert grown_window((1, 19, 0, 29), 4, (20, 30)) == (0, 20, 0, 30)


def test_lists_of_cells_grow_when_they_are_full():
    listed, count = room_for_cells(), 0
    room = len(listed)
    for row in range(room // BLOCK + 2):
        listed, count = list_cells(listed, count, np.uint64(2**64 - 1), row, 10)
    assert count == (room // BLOCK + 2) * BLOCK
    assert len(listed) > room
    np.testing.assert_array_equal(listed[:count], [(k // BLOCK, 10 + k % BLOCK) for k in range(count)])
    assert list_cells(room_for_cells(), 0, np.uint64(0b1010), 3, 7)[1] == 2
