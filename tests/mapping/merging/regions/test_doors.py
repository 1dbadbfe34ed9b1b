"""Doors are the gaps at which two regions meet."""

import math

import numpy as np
import pytest

from lidarium.mapping.merging.regions.doors import find_doors
from lidarium.mapping.merging.regions.meetings import NONE, find_meetings

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
    return find_doors(find_meetings(labels, clearance), SIDE)


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
