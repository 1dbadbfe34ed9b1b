"""Regions of like shapes say where a map lies that has to grow."""

import math

import numpy as np
import pytest
from drawn_maps import RESOLUTION, about_middle, apartment, blank, moved, room

from lidarium.mapping.merging.description.described_map import describe_map
from lidarium.mapping.merging.regions.settings import RegionSettings
from lidarium.mapping.merging.scaling.region_placements import region_placements
from lidarium.mapping.merging.scaling.scale_search import ScaleSettings, grown_levels

REGIONS, SCALING = RegionSettings(), ScaleSettings()


def placed(theta=-0.4, scale=1.3, regions=REGIONS, scaling=SCALING):
    """Placements of a plan of the apartment that is turned and drawn too small, and where it truly lies."""
    there = about_middle(theta, apartment(), (400, 400))
    plan = grown_levels(moved(apartment(), there, (400, 400)), RESOLUTION / scale, RESOLUTION)
    maps = (describe_map(levels, RESOLUTION) for levels in (apartment(), plan))
    return region_placements(*maps, regions, scaling), there.inverse()


@pytest.mark.parametrize(("theta", "scale"), [(-0.4, 1.3), (2.0, 0.8)])
def test_the_true_placement_is_found_and_most_speaks_for_it(theta, scale):
    found, truth = placed(theta, scale)
    best = found[0]
    assert best.scale == pytest.approx(scale, rel=0.05)
    distance, angle = best.a_from_b.difference(truth, (10.0, 10.0))
    assert distance < 0.8
    assert angle < math.radians(4.0)
    values = [placement.value_m for placement in found]
    assert values == sorted(values, reverse=True)
    assert values[0] > 1.5 * values[1]


def test_placements_are_so_many_and_apart():
    few, _ = placed(regions=RegionSettings(candidates=5))
    assert len(few) == 5
    assert [each.value_m for each in few] == [each.value_m for each in placed()[0][:5]]
    middle = np.array([10.0, 10.0])
    for first in range(5):
        for second in range(first):
            one, other = few[first].a_from_b, few[second].a_from_b
            turn = abs(math.remainder(one.theta - other.theta, math.tau))
            gap = np.hypot(*(one.apply(middle) - other.apply(middle)))
            assert gap > 0.1 or turn > SCALING.slant


def test_maps_grow_no_more_than_they_may():
    scaling = ScaleSettings(least=0.9, most=1.1)
    found, _ = placed(scaling=scaling)
    assert found
    assert all(0.9 <= each.scale <= 1.1 for each in found)


def test_maps_without_like_regions_lie_nowhere():
    corridor = room(blank(), 40, 20, 14, 170)
    hall = room(blank(), 10, 10, 130, 130)
    a, b = (describe_map(levels, RESOLUTION) for levels in (corridor, hall))
    assert region_placements(a, b, REGIONS, SCALING) == []
