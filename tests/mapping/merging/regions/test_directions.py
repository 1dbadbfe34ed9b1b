"""Directions of walls, and the rotations under which those of two maps run alike."""

import math

import numpy as np
import pytest
from drawn_maps import about_middle, apartment, blank, moved, room

from lidarium.mapping.grids.occupancy import FREE
from lidarium.mapping.merging.regions.directions import (
    BINS,
    QUARTER,
    Slopes,
    direction_histogram,
    likely_rotations,
    region_axes,
    wall_slopes,
)
from lidarium.mapping.merging.regions.meetings import NONE


def slopes_of(levels):
    free = (levels == FREE).astype(np.uint8)
    return wall_slopes(levels, free, np.where(free > 0, 0, NONE).astype(np.int32))


def histogram_at(*degrees):
    directions = np.radians(np.repeat(degrees, 50))
    return direction_histogram(Slopes(directions, np.zeros(len(directions), np.int32)))


def test_slopes_point_away_from_the_walls_of_a_room():
    levels = room(blank(), 40, 50, 30, 60)
    directions, regions = slopes_of(levels)
    assert (regions == 0).all()
    # Each of the four walls is as many cells long as there are slopes across it, corners aside.
    counts = [
        int((np.abs(np.mod(directions - k * QUARTER + 1.0, 4 * QUARTER) - 1.0) < 0.05).sum())
        for k in range(4)
    ]
    assert counts == pytest.approx([30, 60, 30, 60], abs=10)


@pytest.mark.parametrize("theta", [0.0, 0.3, 1.2])
def test_the_axis_of_a_region_is_that_of_its_walls(theta):
    turned = moved(apartment(), about_middle(theta, apartment()))
    (axis,) = region_axes(slopes_of(turned), 1)
    assert 0.0 <= axis < QUARTER
    assert math.remainder(axis - theta, QUARTER) == pytest.approx(0.0, abs=0.02)


def test_a_region_without_walls_has_the_axis_of_all():
    directions = np.radians([20.0, 110.0, 200.0, 50.0])
    axes = region_axes(Slopes(directions, np.array([0, 0, 0, 2], np.int32)), 3)
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
