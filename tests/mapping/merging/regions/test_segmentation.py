"""Free space that is split into regions at doors."""

import dataclasses
import math

import numpy as np
import pytest
from drawn_maps import RESOLUTION, apartment, blank, room

from lidarium.mapping.grids.occupancy import FREE, OCCUPIED, UNKNOWN
from lidarium.mapping.merging.regions import segmentation
from lidarium.mapping.merging.regions.segmentation import (
    NONE,
    RegionSettings,
    _SplitRule,
    clearance_of,
    find_meetings,
    free_space,
    split_regions,
)

SETTINGS = RegionSettings()


def labelled(levels, settings=SETTINGS):
    free = free_space(levels, round(settings.least_obstacle_m / RESOLUTION))
    return split_regions(clearance_of(free), RESOLUTION, settings)


def plain_flood(clearance, order, rule):
    """Return the basin of each cell as sets that merge, and their number when they began."""
    basins, peaks = {}, {}
    owner = np.full(clearance.shape, NONE)
    count = 0
    for cell in order.tolist():
        row, column = divmod(cell, clearance.shape[1])
        beside = [
            (y, x)
            for y in range(max(row - 1, 0), min(row + 2, clearance.shape[0]))
            for x in range(max(column - 1, 0), min(column + 2, clearance.shape[1]))
            if owner[y, x] != NONE
        ]
        if not beside:
            basins[count], peaks[count] = set(), clearance[row, column]
            own, count = count, count + 1
        else:
            own = owner[max(beside, key=lambda place: clearance[place])]
        owner[row, column] = own
        basins[own].add((row, column))
        for place in beside:
            own, other = owner[row, column], owner[place]
            low, high = sorted((own, other), key=lambda one: peaks[one])
            height = clearance[row, column]
            is_door = (
                height <= rule.half_door and peaks[low] >= rule.least_radius and height <= rule.door_share * peaks[low]
            )
            if own == other or is_door:
                continue
            for y, x in basins[low]:
                owner[y, x] = high
            basins[high] |= basins.pop(low)
    return owner, count


def clutter(seed, shape=(28, 34)):
    """Return free space with a few boxes in it."""
    generator = np.random.default_rng(seed)
    free = np.ones(shape, np.uint8)
    for _ in range(9):
        row, column = generator.integers(0, shape[0]), generator.integers(0, shape[1])
        free[row : row + generator.integers(1, 9), column : column + generator.integers(1, 9)] = 0
    return free


@pytest.mark.parametrize("seed", range(6))
def test_basins_are_those_of_the_plain_watershed(seed):
    clearance = clearance_of(clutter(seed))
    # Distances without ties, so that the order of a cell's neighbours does not matter.
    clearance = np.where(clearance > 0, clearance + np.random.default_rng(seed).random(clearance.shape) / 9, 0)
    clearance = clearance.astype(np.float32)
    rule = _SplitRule(3.0, 0.75, 1.5)
    order = np.argsort(-clearance.ravel(), kind="stable")[: np.count_nonzero(clearance)]
    labels = np.full(clearance.shape, NONE, np.int32)
    parent, peak, areas = (np.zeros(len(order), kind) for kind in (np.int32, np.float32, np.int64))
    count = segmentation._flood(clearance, order, rule, (parent, peak, areas), labels)
    wanted, begun = plain_flood(clearance, order, rule)
    assert count == begun
    for basin in np.unique(wanted[wanted != NONE]):
        (own,) = np.unique(labels[wanted == basin])
        assert (labels == own).sum() == (wanted == basin).sum() == areas[own]


def test_cells_are_sorted_by_their_clearance():
    clearance = clearance_of(clutter(3))
    order = np.empty(np.count_nonzero(clearance), np.int64)
    segmentation._sort(clearance, np.zeros(int(clearance.max() * 8) + 2, np.int64), order)
    levels = (clearance.ravel() * 8).astype(int)
    wanted = np.argsort(-levels, kind="stable")[: len(order)]
    np.testing.assert_array_equal(order, wanted)


@pytest.mark.parametrize("seed", range(3))
def test_meetings_are_all_edges_between_regions(seed):
    labels = np.random.default_rng(seed).integers(-1, 3, (9, 13)).astype(np.int32)
    clearance = np.random.default_rng(seed + 9).random(labels.shape).astype(np.float32)
    wanted = set()
    for row, column in np.ndindex(labels.shape):
        for down, right in ((0, 1), (1, 0)):
            if row + down < 9 and column + right < 13:
                one, other = labels[row, column], labels[row + down, column + right]
                if one != other and NONE not in (one, other):
                    height = min(clearance[row, column], clearance[row + down, column + right])
                    middle = (column + 0.5 + 0.5 * right, row + 0.5 + 0.5 * down)
                    wanted.add((int(one), int(other), float(height), *middle, right, down))
    met = find_meetings(labels, clearance)
    found = {
        (*regions, height, *place, *step)
        for regions, height, place, step in zip(*(part.tolist() for part in met), strict=True)
    }
    assert found == wanted


def test_rooms_are_regions_and_small_obstacles_do_not_split_them():
    levels = room(room(blank(), 20, 20, 60, 60), 20, 83, 60, 80)
    levels[40:58, 80:83] = FREE
    levels[50:54, 48:52] = OCCUPIED
    labels = labelled(levels)
    assert labels.max() == 1
    for columns in (slice(20, 80), slice(84, 163)):
        assert len(np.unique(labels[20:80, columns])) == 1
    assert labels[30, 30] != labels[30, 120]
    assert (labels[levels == UNKNOWN] == NONE).all()


def test_a_wide_opening_and_a_corridor_of_one_width_are_one_region():
    opened = room(room(blank(), 20, 20, 60, 60), 20, 83, 60, 80)
    opened[30:70, 80:83] = FREE
    assert labelled(opened).max() == 0
    assert labelled(room(blank(), 60, 10, 20, 170)).max() == 0


def test_a_closet_belongs_to_its_room():
    levels = room(room(blank(), 20, 20, 60, 60), 20, 83, 20, 20)
    levels[24:36, 80:83] = FREE
    assert labelled(levels).max() == 0
    assert labelled(levels, RegionSettings(least_area_m2=0.5)).max() == 1


def test_a_small_region_without_a_neighbour_is_none():
    levels = room(room(blank(), 20, 20, 60, 60), 20, 120, 14, 14)
    labels = labelled(levels)
    assert labels.max() == 0
    assert (labels[20:34, 120:134] == NONE).all()


def test_each_room_of_an_apartment_is_one_region_or_more():
    labels = labelled(apartment())
    middles = [labels[40, 30], labels[30, 100], labels[110, 20], labels[80, 110], labels[120, 150]]
    assert len(set(middles)) == 5
    assert NONE not in middles


@pytest.mark.parametrize(("level", "regions"), [(FREE, 1), (OCCUPIED, 0), (UNKNOWN, 0)])
def test_maps_of_one_level(level, regions):
    assert labelled(np.full((60, 80), level, np.uint8)).max() + 1 == regions
    assert labelled(np.full((1, 1), level, np.uint8)).max() == NONE


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("cell_m", 0.0),
        ("most_cells", 999),
        ("least_obstacle_m", -0.1),
        ("widest_door_m", math.nan),
        ("door_share", 1.01),
        ("least_area_m2", -1.0),
        ("most_regions", 0),
        ("most_doors", 2.5),
        ("scale_share", 0.0),
        ("scale_steps", -1),
        ("candidates", 1001),
        ("apart_angle", "wide"),
        ("likely_rotations", 3),
    ],
)
def test_a_value_that_makes_no_sense_is_named(name, value):
    with pytest.raises(ValueError, match=name):
        RegionSettings(**{name: value})


def test_the_ends_of_the_bounds_are_allowed():
    ends = {"most_cells": 1000, "door_share": 1.0, "scale_steps": 0, "candidates": 1000, "least_area_m2": 0.0}
    assert dataclasses.asdict(RegionSettings(**ends)).items() >= ends.items()


def test_defaults_hold_and_settings_are_values():
    assert RegionSettings() == RegionSettings()
    assert RegionSettings(most_doors=8) != RegionSettings()
    with pytest.raises(dataclasses.FrozenInstanceError):
        RegionSettings().cell_m = 0.1


def by_pairs(labels, clearance):
    found = []
    rows, columns = labels.shape
    for row in range(rows):
        for column in range(columns):
            for down, right in ((0, 1), (1, 0)):
                beside = row + down, column + right
                if beside[0] >= rows or beside[1] >= columns:
                    continue
                pair = labels[row, column], labels[beside]
                if NONE in pair or pair[0] == pair[1]:
                    continue
                middle = (0.5 + column + 0.5 * right, 0.5 + row + 0.5 * down)
                found.append(
                    (
                        *pair,
                        min(clearance[row, column], clearance[beside]),
                        *middle,
                        float(right),
                        float(down),
                    )
                )
    return sorted(found)


@pytest.mark.parametrize("seed", range(8))
def test_edges_are_those_of_all_pairs_of_neighbours(seed):
    generator = np.random.default_rng(seed)
    labels = generator.integers(NONE, 3, (9, 13)).astype(np.int32)
    clearance = generator.random((9, 13)).astype(np.float32)
    met = find_meetings(labels, clearance)
    assert len(met.regions) > 20
    columns = (*met.regions.T, met.clearance, *met.places.T, *met.steps.T)
    assert sorted(zip(*(column.tolist() for column in columns), strict=True)) == by_pairs(labels, clearance)


def test_a_meeting_by_hand():
    labels = np.array([[0, 0, NONE], [1, 0, 2]], np.int32)
    clearance = np.array([[1.0, 2.0, 0.0], [3.0, 4.0, 5.0]], np.float32)
    met = find_meetings(labels, clearance)
    order = np.lexsort(met.places.T)
    assert met.regions[order].tolist() == [[0, 1], [1, 0], [0, 2]]
    assert met.places[order].tolist() == [[0.5, 1.0], [1.0, 1.5], [2.0, 1.5]]
    assert met.steps[order].tolist() == [[0.0, 1.0], [1.0, 0.0], [1.0, 0.0]]
    assert met.clearance[order].tolist() == [1.0, 3.0, 4.0]


@pytest.mark.parametrize("label", [0, NONE])
def test_one_region_meets_nothing(label):
    met = find_meetings(np.full((4, 5), label, np.int32), np.ones((4, 5), np.float32))
    assert met.regions.shape == met.places.shape == met.steps.shape == (0, 2)
    assert len(met.clearance) == 0
