"""Regions of a map: their shapes, and the doors between them."""

import math

import numpy as np
import pytest
from drawn_maps import RESOLUTION, about_middle, apartment, blank, moved, noisy, room

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import FREE, OCCUPIED, UNKNOWN
from lidarium.mapping.merging.described_map import resampled
from lidarium.mapping.merging.regions.graph import (
    BINS,
    QUARTER,
    _direction_histogram,
    _find_doors,
    _joined,
    _region_axes,
    _Slopes,
    _wall_slopes,
    find_regions,
    likely_rotations,
)
from lidarium.mapping.merging.regions.segmentation import NONE, RegionSettings, find_meetings

SETTINGS = RegionSettings()


def suite():
    """Return two rooms beside each other above a corridor, with three doors.

    The rooms have 3 by 2.5 m and 4 by 2.5 m, the corridor 7.15 by 1.5 m.
    """
    levels = blank()
    room(levels, 20, 10, 30, 143)
    room(levels, 53, 10, 50, 60)
    room(levels, 53, 73, 50, 80)
    levels[50:53, 30:48] = FREE
    levels[50:53, 100:116] = FREE
    levels[70:86, 70:73] = FREE
    return levels


def test_rooms_have_their_shapes_and_doors_their_places():
    found = find_regions(suite(), RESOLUTION, SETTINGS)
    assert len(found) == 3
    by_area = np.argsort(found.areas)
    np.testing.assert_allclose(found.areas[by_area], (7.5, 10.0, 10.725), atol=0.3)
    for region, extents in zip(by_area, ((3.0, 2.5), (4.0, 2.5), (7.15, 1.5)), strict=True):
        off = (found.axes[region] + 0.5) % (math.pi / 2) - 0.5
        along = found.extents[region] if abs(off) < 0.2 and found.axes[region] < 0.5 else found.extents[region][::-1]
        np.testing.assert_allclose(along, extents, atol=0.12)
        assert abs(off) < math.radians(2.0)
    west, east, corridor = by_area.tolist()
    np.testing.assert_allclose(found.centres[west], (2.0, 3.9), atol=0.1)
    assert found.adjacency == {
        west: sorted((east, corridor)),
        east: sorted((west, corridor)),
        corridor: sorted((west, east)),
    }
    assert found.door_counts.tolist() == [2, 2, 2]
    doors = {tuple(pair): k for k, pair in enumerate(found.doors.regions.tolist())}
    for pair, place, width, direction in (
        ((west, corridor), (1.95, 2.575), 0.9, 1.0),
        ((east, corridor), (5.4, 2.575), 0.8, 1.0),
        ((west, east), (3.575, 3.9), 0.8, 0.0),
    ):
        k = doors[tuple(sorted(pair))]
        np.testing.assert_allclose(found.doors.places[k], place, atol=0.12)
        assert found.doors.widths[k] == pytest.approx(width, abs=0.08)
        assert abs(math.sin(found.doors.normals[k])) == pytest.approx(direction, abs=0.1)


@pytest.mark.parametrize("theta", [0.4, 1.3, 2.9])
def test_regions_and_doors_move_with_the_map(theta):
    still = find_regions(suite(), RESOLUTION, SETTINGS)
    there = about_middle(theta, suite(), shift=(0.7, -0.4))
    found = find_regions(noisy(moved(suite(), there), 3, 0.05), RESOLUTION, SETTINGS)
    assert len(found) == len(still)
    nearest = [int(np.hypot(*(found.centres - place).T).argmin()) for place in there.apply(still.centres)]
    assert sorted(nearest) == list(range(len(still)))
    np.testing.assert_allclose(found.areas[nearest], still.areas, rtol=0.08)
    turn = (found.axes[nearest] - still.axes - theta + 0.5) % (math.pi / 2) - 0.5
    assert np.abs(turn).max() < math.radians(2.0)
    np.testing.assert_allclose(np.sort(found.doors.widths), np.sort(still.doors.widths), atol=0.15)
    for place in there.apply(still.doors.places):
        # A door may lie anywhere in the depth of its wall, and cells are turned.
        assert np.hypot(*(found.doors.places - place).T).min() < 0.2


def test_finer_cells_give_the_same_regions():
    fine = np.kron(suite(), np.ones((2, 2), np.uint8))
    coarse, found = (find_regions(levels, side, SETTINGS) for levels, side in ((suite(), 0.05), (fine, 0.025)))
    assert found.resolution == pytest.approx(0.05)
    np.testing.assert_allclose(found.areas, coarse.areas)
    np.testing.assert_allclose(found.doors.places, coarse.doors.places)


def test_large_maps_are_split_in_larger_cells():
    found = find_regions(suite(), RESOLUTION, RegionSettings(most_cells=8000))
    assert found.resolution == pytest.approx(0.1)
    assert len(found) == 3


@pytest.mark.parametrize("count", [1, 2, 3])
def test_joined_cells_are_those_of_resampled_maps(count):
    generator = np.random.default_rng(count)
    levels = generator.choice(np.array([UNKNOWN, FREE], np.uint8), (60, 48))
    levels[generator.random(levels.shape) < 0.05] = OCCUPIED
    np.testing.assert_array_equal(_joined(levels, count), resampled(levels, RESOLUTION, RESOLUTION * count))


@pytest.mark.parametrize("level", [FREE, OCCUPIED, UNKNOWN])
@pytest.mark.parametrize("shape", [(1, 1), (60, 90)])
def test_maps_of_one_level_have_no_doors(level, shape):
    found = find_regions(np.full(shape, level, np.uint8), RESOLUTION, SETTINGS)
    assert len(found) == (level == FREE and shape != (1, 1))
    assert len(found.doors.widths) == 0
    assert found.adjacency == {region: [] for region in range(len(found))}


def test_what_is_known_may_lie_anywhere_in_the_array():
    levels = np.full((400, 500), UNKNOWN, np.uint8)
    levels[150:310, 200:400] = suite()
    found, still = (find_regions(each, RESOLUTION, SETTINGS) for each in (levels, suite()))
    shift = Transform(200 * RESOLUTION, 150 * RESOLUTION, 0.0)
    np.testing.assert_allclose(found.doors.places, shift.apply(still.doors.places))
    np.testing.assert_allclose(found.centres, shift.apply(still.centres))


def test_settings_that_make_no_sense_are_named():
    with pytest.raises(ValueError, match="widest_door_m"):
        RegionSettings(widest_door_m=0.0)
    with pytest.raises(ValueError, match="door_share"):
        RegionSettings(door_share=1.5)


def slopes_of(levels):
    free = (levels == FREE).astype(np.uint8)
    return _wall_slopes(levels, free, np.where(free > 0, 0, NONE).astype(np.int32))


def histogram_at(*degrees):
    directions = np.radians(np.repeat(degrees, 50))
    return _direction_histogram(_Slopes(directions, np.zeros(len(directions), np.int32)))


def test_slopes_point_away_from_the_walls_of_a_room():
    levels = room(blank(), 40, 50, 30, 60)
    directions, regions = slopes_of(levels)
    assert (regions == 0).all()
    # Each of the four walls is as many cells long as there are slopes across it, corners aside.
    counts = [int((np.abs(np.mod(directions - k * QUARTER + 1.0, 4 * QUARTER) - 1.0) < 0.05).sum()) for k in range(4)]
    assert counts == pytest.approx([30, 60, 30, 60], abs=10)


@pytest.mark.parametrize("theta", [0.0, 0.3, 1.2])
def test_the_axis_of_a_region_is_that_of_its_walls(theta):
    turned = moved(apartment(), about_middle(theta, apartment()))
    (axis,) = _region_axes(slopes_of(turned), 1)
    assert 0.0 <= axis < QUARTER
    assert math.remainder(axis - theta, QUARTER) == pytest.approx(0.0, abs=0.02)


def test_a_region_without_walls_has_the_axis_of_all():
    directions = np.radians([20.0, 110.0, 200.0, 50.0])
    axes = _region_axes(_Slopes(directions, np.array([0, 0, 0, 2], np.int32)), 3)
    assert np.degrees(axes[[0, 2]]) == pytest.approx([20.0, 50.0])
    everyone = np.exp(4j * directions).sum()
    assert axes[1] == pytest.approx(np.angle(everyone) / 4.0 % QUARTER)


def test_a_histogram_counts_walls_by_their_direction_within_a_quarter_turn():
    found = histogram_at(10.5, 100.5, 280.5)
    assert found.shape == (BINS,)
    assert int(found.argmax()) == 10
    assert found == pytest.approx(np.roll(histogram_at(0.5), 10) * 3.0)
    assert found.sum() == pytest.approx(150 * np.exp(-0.5 * (np.arange(-45, 45) / 2.0) ** 2).sum())
    # Smoothed around the quarter turn.
    assert histogram_at(0.5)[BINS - 1] == pytest.approx(histogram_at(0.5)[1])


def test_rotations_are_those_under_which_walls_run_alike():
    turn = 30.0
    found = np.degrees(likely_rotations(histogram_at(40.5), histogram_at(40.5 - turn), 72))
    # Four rotations, each with its neighbours 5 degrees away where these are likely too.
    away = np.abs(np.mod(found - turn + 45.0, 90.0) - 45.0)
    assert away.max() <= 5.0 + 1e-6
    assert sorted({round(value) for value in found[away < 1e-6]}) == [30, 120, 210, 300]


def test_where_walls_run_in_all_directions_every_rotation_is_tried():
    everywhere = np.ones(BINS)
    for histogram in (everywhere, np.zeros(BINS)):
        found = likely_rotations(histogram, everywhere, 36)
        assert np.degrees(found) == pytest.approx(np.arange(0.0, 360.0, 10.0))


SIDE = 0.1


def clearance_in(gaps, labels):
    """Clearance by hand: that of cells in a gap grows to its middle; elsewhere it is large."""
    clearance = np.full(labels.shape, 9.0, np.float32)
    for row, column, length, is_column in gaps:
        steps = np.minimum(np.arange(length), np.arange(length)[::-1]) + 1.0
        if is_column:
            clearance[row : row + length, column : column + 2] = steps[:, None]
        else:
            clearance[row : row + 2, column : column + length] = steps
    return clearance


def two_rooms(*gaps):
    """Two regions beside each other with a wall at columns 10 and 11, but for gaps (row, length)."""
    labels = np.full((30, 22), NONE, np.int32)
    labels[1:-1, 1:10], labels[1:-1, 12:-1] = 0, 1
    for row, length in gaps:
        labels[row : row + length, 10], labels[row : row + length, 11] = 0, 1
    return labels, clearance_in([(row, 10, length, True) for row, length in gaps], labels)


def doors_of(labels, clearance):
    return _find_doors(find_meetings(labels, clearance), SIDE)


def test_a_door_has_its_middle_width_and_the_direction_through_it():
    doors = doors_of(*two_rooms((5, 7)))
    assert doors.regions.tolist() == [[0, 1]]
    assert doors.places[0] == pytest.approx([1.1, 0.85])
    assert doors.normals[0] == pytest.approx(0.0)
    # The middle cell of seven is 4 cells from what is not free, seen from the middle of that cell.
    assert doors.widths[0] == pytest.approx((2.0 * 4.0 - 0.5) * SIDE)


def test_two_regions_may_have_several_doors():
    doors = doors_of(*two_rooms((3, 5), (18, 9)))
    assert doors.regions.tolist() == [[0, 1], [0, 1]]
    order = np.argsort(doors.places[:, 1])
    assert doors.places[order, 1] == pytest.approx([0.55, 2.25])
    assert doors.widths[order] == pytest.approx([0.55, 0.95])


def test_the_direction_leads_from_the_first_region_to_the_second():
    labels, clearance = two_rooms((5, 7))
    swapped = np.where(labels == 0, 1, np.where(labels == 1, 0, NONE)).astype(np.int32)
    doors = doors_of(swapped, clearance)
    assert doors.regions.tolist() == [[0, 1]]
    assert abs(doors.normals[0]) == pytest.approx(math.pi)
    upright = doors_of(labels.T.copy(), clearance.T.copy())
    assert upright.normals[0] == pytest.approx(math.pi / 2)
    assert upright.places[0] == pytest.approx([0.85, 1.1])


def test_doors_are_listed_by_their_regions():
    labels = np.full((10, 30), NONE, np.int32)
    labels[:, :10], labels[:, 10:20], labels[:, 20:] = 2, 0, 1
    doors = doors_of(labels, np.ones(labels.shape, np.float32))
    assert doors.regions.tolist() == [[0, 1], [0, 2]]
    assert doors.normals.tolist() == pytest.approx([0.0, math.pi])


def test_regions_that_do_not_meet_have_no_door():
    doors = doors_of(*two_rooms())
    assert doors.regions.shape == doors.places.shape == (0, 2)
    assert doors.normals.shape == doors.widths.shape == (0,)
