"""Maps that are joined by what their regions and doors propose."""

import math
from dataclasses import replace

import numpy as np
import pytest
from drawn_maps import RESOLUTION, about_middle, apartment, blank, hall, kept, moved, noisy, room

from lidarium.mapping.grids.occupancy import FREE, OCCUPIED, UNKNOWN
from lidarium.mapping.merging.correlation import CorrelationSettings
from lidarium.mapping.merging.merger import merge_maps
from lidarium.mapping.merging.pair import described, merge_pair
from lidarium.mapping.merging.scaling import merge_scaled
from lidarium.mapping.merging.settings import STRUCTURES, MergeSettings, merge_settings

ALONE = MergeSettings(structure="regions", correlation=CorrelationSettings(rotations=0))
"""Regions without the search of all rotations and translations."""


def joined(a, b, settings):
    return merge_pair(*(described(levels, RESOLUTION, settings) for levels in (a, b)), settings)


@pytest.mark.parametrize("theta", [0.25, 1.9])
def test_parts_of_a_floor_are_joined_by_regions_alone(theta):
    there = about_middle(theta, hall(), (480, 480))
    west = kept(hall(), slice(0, 180), slice(0, 260))
    east = moved(kept(hall(), slice(0, 180), slice(130, 402)), there, (480, 480))
    result = joined(noisy(west, 1), noisy(east, 2), ALONE)
    assert result.is_accepted, result.reason
    assert result.found_by == "regions"
    assert result.matches == 0
    distance, angle = result.a_from_b.difference(there.inverse(), there.apply((9.5, 4.0)))
    assert distance < 0.05
    assert angle < math.radians(0.5)


def test_strangers_are_refused_whatever_proposes():
    stranger = room(room(blank(), 20, 20, 80, 60), 20, 83, 50, 90)
    stranger[30:46, 80:83] = FREE
    for structure in STRUCTURES:
        result = joined(apartment(), stranger, MergeSettings(structure=structure))
        assert not result.is_accepted


def test_regions_are_asked_where_corners_say_nothing():
    there = about_middle(0.5, apartment())
    known = MergeSettings(structure="all", correlation=CorrelationSettings(rotations=0))
    without = replace(known, alignment=replace(known.alignment, least_inliers=200))
    maps = apartment(), noisy(moved(apartment(), there), 4)
    assert joined(*maps, known).found_by == "corners"
    assert joined(*maps, without).found_by == "regions"
    assert not joined(*maps, replace(without, structure="corners")).is_accepted


@pytest.mark.parametrize("level", [FREE, OCCUPIED, UNKNOWN])
@pytest.mark.parametrize("shape", [(1, 1), (60, 90)])
def test_maps_of_one_level_are_refused_with_a_reason(level, shape):
    bare = np.full(shape, level, np.uint8)
    for structure in ("regions", "all"):
        settings = MergeSettings(structure=structure)
        merged = merge_maps({"a": (bare, RESOLUTION), "b": (apartment(), RESOLUTION)}, settings)
        (result,) = merged.pairs.values()
        assert not result.is_accepted
        assert "too few" in result.reason
        scaled = merge_scaled({"a": (bare, RESOLUTION), "b": (apartment(), RESOLUTION)}, settings)
        (result,) = scaled.merged.pairs.values()
        assert not result.is_accepted


def test_a_scale_is_found_by_regions_alone():
    truth = about_middle(0.6, hall(), (480, 480))
    maps = {"seen": (hall(), RESOLUTION), "plan": (moved(hall(), truth, (480, 480)), RESOLUTION / 1.25)}
    for structure in ("regions", "all"):
        scaled = merge_scaled(maps, MergeSettings(structure=structure))
        (result,) = scaled.merged.pairs.values()
        assert result.is_accepted
        assert scaled.scale == pytest.approx(1.25, rel=0.01)
        distance, angle = result.a_from_b.difference(truth.inverse(), truth.apply((9.0, 4.0)))
        assert distance < 0.15
        assert angle < math.radians(1.0)


def test_unknown_structures_are_named_and_discs_need_corners():
    with pytest.raises(ValueError, match="structure of merging is 'rooms'; want one of corners, regions, all"):
        MergeSettings(structure="rooms")
    with pytest.raises(ValueError, match="disc test needs matched corners"):
        replace(merge_settings("thesis"), structure="regions")


def test_maps_described_without_regions_are_named():
    a, b = (described(levels, RESOLUTION, MergeSettings()) for levels in (apartment(), hall()))
    with pytest.raises(ValueError, match="described without its regions"):
        merge_pair(a, b, ALONE)
