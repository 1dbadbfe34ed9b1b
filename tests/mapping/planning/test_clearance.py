"""Clearance against brute force, and kept up to date against computed anew."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lidarium.mapping.kernels.llvm import BLOCK
from lidarium.mapping.planning.clearance import (
    ClearanceField,
    _is_within,
    _recompute,
    changed_cells,
    clearance,
    grown_window,
    list_cells,
    room_for_cells,
    update_around,
)

RESOLUTION = 0.025


def by_brute_force(occupied, resolution, maximum):
    rows, columns = np.indices(occupied.shape)
    nearest = np.full(occupied.shape, maximum)
    for row, column in np.argwhere(occupied):
        up = np.maximum(np.abs(rows - row) - 0.5, 0.0)
        right = np.maximum(np.abs(columns - column) - 0.5, 0.0)
        nearest = np.minimum(nearest, np.hypot(up, right) * resolution)
    return nearest


@settings(max_examples=40)
@given(
    seed=st.integers(0, 10**6),
    rows=st.integers(1, 50),
    columns=st.integers(1, 50),
    share=st.sampled_from([0.0, 0.001, 0.02, 0.3, 1.0]),
    maximum=st.sampled_from([0.0125, 0.1, 0.33, 0.6]),
)
def test_clearance_is_the_distance_to_the_nearest_occupied_square(seed, rows, columns, share, maximum):
    occupied = np.random.default_rng(seed).random((rows, columns)) < share
    found = clearance(occupied, RESOLUTION, maximum)
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, by_brute_force(occupied, RESOLUTION, maximum), atol=1e-6)


@settings(max_examples=30)
@given(seed=st.integers(0, 10**6), edits=st.integers(1, 8))
def test_updates_of_windows_agree_with_a_field_made_anew(seed, edits):
    random = np.random.default_rng(seed)
    belief = np.zeros((90, 110), np.int8)
    field = ClearanceField(belief.shape, RESOLUTION, 0.3)
    for _ in range(edits):
        row, column = random.integers(0, 80), random.integers(0, 100)
        height, width = random.integers(1, 60, size=2)
        window = (row, min(row + height, 90), column, min(column + width, 110))
        part = belief[window[0] : window[1], window[2] : window[3]]
        share = random.choice([0.001, 0.01, 0.2])
        part[random.random(part.shape) < share] = 5  # mostly additions
        if random.random() < 0.5:
            part[random.random(part.shape) < 0.3] = -5
        field.update(belief, window)
    anew = ClearanceField(belief.shape, RESOLUTION, 0.3)
    anew.update(belief)
    np.testing.assert_array_equal(field.closeness, anew.closeness)
    np.testing.assert_array_equal(field.metres(), clearance(belief > 0, RESOLUTION, 0.3))


@settings(max_examples=40)
@given(
    seed=st.integers(0, 10**6),
    shape=st.sampled_from([(30, 40), (70, 64), (50, 97), (20, 200), (45, 256)]),
    maximum=st.sampled_from([0.1, 0.6, 1.7, 2.2]),
)
def test_cells_that_come_and_go_at_the_border_and_within_leave_the_distance_to_those_that_are_there(
    seed, shape, maximum
):
    random = np.random.default_rng(seed)
    belief = np.full(shape, -1, np.int8)
    field = ClearanceField(shape, RESOLUTION, maximum)
    for _ in range(4):
        places = random.integers(0, shape, (12, 2))
        places[:4] *= random.integers(0, 2, (4, 2))
        places[4:8] = np.where(random.random((4, 2)) < 0.5, np.array(shape) - 1, places[4:8])
        belief[places[:, 0], places[:, 1]] = random.choice([-1, 1], 12)
        occupied = np.argwhere(belief > 0)
        gone = occupied[random.random(len(occupied)) < 0.3]
        belief[gone[:, 0], gone[:, 1]] = -1
        field.update(belief)
        np.testing.assert_allclose(field.metres(), by_brute_force(belief > 0, RESOLUTION, maximum), atol=1e-6)


def test_update_reports_whether_anything_became_occupied_or_free():
    belief = np.full((50, 50), -3, np.int8)
    field = ClearanceField(belief.shape, RESOLUTION)
    assert not field.update(belief)
    belief[20, 20] = 1
    assert field.update(belief, (10, 30, 10, 30))
    assert not field.update(belief, (10, 30, 10, 30))
    assert field.at((20, 20)) == 0.0
    assert field.at((20, 22)) == pytest.approx(1.5 * RESOLUTION)


def test_a_window_beyond_the_grid_is_clipped():
    belief = np.ones((20, 20), np.int8)
    field = ClearanceField(belief.shape, RESOLUTION)
    assert field.update(belief, (-10, 100, -10, 100))
    assert (field.metres() == 0.0).all()


def test_bad_input_is_named():
    with pytest.raises(ValueError, match="maximum is 0"):
        ClearanceField((10, 10), RESOLUTION, 0.0)
    with pytest.raises(ValueError, match="maximum is 5"):
        ClearanceField((10, 10), RESOLUTION, 5.0)
    with pytest.raises(ValueError, match="resolution is -1"):
        ClearanceField((10, 10), -1.0)
    with pytest.raises(ValueError, match="shape"):
        ClearanceField((10, 10), RESOLUTION).update(np.zeros((5, 5), np.int8))
    with pytest.raises(ValueError, match="grid"):
        clearance(np.zeros(4, bool), RESOLUTION)


COARSE = 0.05
ALL = (0, 999, 0, 999)


def field_of(belief):
    field = ClearanceField(belief.shape, COARSE, 0.3)
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


def plain(belief, limit):
    """Closeness by its definition: the limit less the least square of half cells to an occupied square."""
    rows, columns = np.indices(belief.shape)
    squares = np.full(belief.shape, limit)
    for row, column in np.argwhere(belief > 0):
        up, right = (np.maximum(2 * np.abs(a - b) - 1, 0) for a, b in ((rows, row), (columns, column)))
        squares = np.minimum(squares, up**2 + right**2)
    return limit - squares


@pytest.mark.parametrize("shape", [(1, 1), (9, 20), (30, 64), (25, 150)])
@pytest.mark.parametrize("share", [0.0, 0.01, 0.2])
def test_stale_rows_of_a_block_are_computed_and_others_left(shape, share):
    generator = np.random.default_rng(4)
    belief = np.where(generator.random(shape) < share, 9, -5).astype(np.int8)
    field = ClearanceField(shape, 0.05, 0.3)
    expected = plain(belief, field.limit)
    stale = generator.random(shape[0]) < 0.7
    for column in range(0, shape[1], 64):
        closeness = np.full(shape, 7, np.uint16)
        _recompute(belief, closeness, field.limit, field.stamp.shape[0] // 2, 0, stale, column)
        block = slice(column, min(column + 64, shape[1]))
        np.testing.assert_array_equal(closeness[stale, block], expected[stale, block])
        closeness[stale, block] = 7
        assert (closeness == 7).all()


def test_sixty_four_columns_lie_within_the_grid_and_hold_those_that_are_wanted():
    assert [_is_within(column, 200) for column in (-64, -63, 0, 100, 136, 150, 199, 200)] == [
        -1,
        0,
        0,
        100,
        136,
        136,
        136,
        -1,
    ]
    assert _is_within(0, 63) == -1
