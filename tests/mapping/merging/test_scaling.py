"""Maps of unlike scales: drawn plans, and images of which nobody knows the metres of a pixel."""

import math
from dataclasses import replace

import numpy as np
import pytest
from drawn_maps import RESOLUTION, about_middle, apartment, blank, bowed, hall, kept, moved, noisy, room

from lidarium.mapping.grids.occupancy import OCCUPIED
from lidarium.mapping.merging.described_map import describe_map
from lidarium.mapping.merging.regions.segmentation import RegionSettings
from lidarium.mapping.merging.scaling import (
    ScaleSettings,
    _grown_levels,
    _placements,
    _region_placements,
    _wall_axis,
    merge_scaled,
)

SIZE = (700, 700)


def drawn_at(levels, scale, there):
    """Return a map drawn smaller or larger than it is, in a frame of its own; it lies there once grown."""
    return _grown_levels(moved(levels, there, SIZE), RESOLUTION / scale, RESOLUTION)


@pytest.mark.parametrize("scale", [0.7, 1.0, 1.6])
def test_the_scale_of_a_plan_is_found(scale):
    floor = hall()
    there = about_middle(1.9, floor, SIZE)
    seen = noisy(bowed(kept(floor, slice(0, 180), slice(0, 300)), 0.1), 1)
    plan = drawn_at(floor, scale, there)
    found = merge_scaled({"seen": (seen, RESOLUTION), "plan": (plan, RESOLUTION)})
    (result,) = found.merged.pairs.values()
    assert result.is_accepted
    assert result.found_by == "scale"
    assert found.scale == pytest.approx(scale, rel=0.02)
    # Where the plan's points lie: an error of the scale moves its corner, which is far away.
    rows, columns = np.nonzero(plan == OCCUPIED)
    points = np.column_stack([columns, rows]) * RESOLUTION
    gaps = result.a_from_b.apply(found.scale * points) - there.inverse().apply(scale * points)
    assert np.median(np.hypot(*gaps.T)) < 0.2
    assert abs(math.remainder(result.a_from_b.theta + there.theta, math.tau)) < math.radians(1.0)
    assert len(found.merged.groups()) == 1


def test_strangers_fit_at_no_scale():
    other = room(room(blank(220, 300), 20, 20, 60, 70), 20, 95, 90, 150)
    found = merge_scaled({"hall": (hall(), RESOLUTION), "other": (other, RESOLUTION)})
    (result,) = found.merged.pairs.values()
    assert not result.is_accepted
    assert "no sure scale" in result.reason
    assert len(found.merged.groups()) == 2


def test_a_square_room_fits_a_plan_at_many_scales_and_is_refused():
    square = room(blank(), 20, 20, 60, 60)
    found = merge_scaled({"hall": (hall(), RESOLUTION), "square": (square, RESOLUTION)})
    (result,) = found.merged.pairs.values()
    assert not result.is_accepted


def test_maps_without_walls_are_refused():
    found = merge_scaled({"hall": (hall(), RESOLUTION), "nothing": (blank(), RESOLUTION)})
    (result,) = found.merged.pairs.values()
    assert not result.is_accepted
    assert "no walls" in result.reason


def test_a_scale_is_sought_between_two_maps_only():
    with pytest.raises(ValueError, match="two maps; 3 are given"):
        merge_scaled({name: (apartment(), RESOLUTION) for name in "abc"})
    with pytest.raises(ValueError, match="map 'a'"):
        merge_scaled({"a": (apartment(), 0.0), "b": (apartment(), RESOLUTION)})


REGIONS, SCALING = RegionSettings(), ScaleSettings()


def placed(theta=-0.4, scale=1.3, regions=REGIONS, scaling=SCALING):
    """Placements of a plan of the apartment that is turned and drawn too small, and where it truly lies."""
    there = about_middle(theta, apartment(), (400, 400))
    plan = _grown_levels(moved(apartment(), there, (400, 400)), RESOLUTION / scale, RESOLUTION)
    maps = (describe_map(levels, RESOLUTION) for levels in (apartment(), plan))
    return _region_placements(*maps, regions, scaling), there.inverse()


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
    assert _region_placements(a, b, REGIONS, SCALING) == []


QUICK = ScaleSettings(slants=0, candidates=8)


def test_the_axis_of_walls_is_that_of_the_turned_map():
    for theta in (0.0, 0.3, -0.6):
        turned = moved(apartment(), about_middle(theta, apartment()))
        described = describe_map(turned, RESOLUTION)
        assert math.remainder(_wall_axis(described) - theta, math.pi / 2.0) == pytest.approx(0.0, abs=0.03)


def test_placements_hold_the_true_one_first():
    floor, scale = apartment(), 1.3
    there = about_middle(-0.4, floor, (400, 400))
    plan = _grown_levels(moved(floor, there, (400, 400)), RESOLUTION / scale, RESOLUTION)
    best = _placements(describe_map(floor, RESOLUTION), describe_map(plan, RESOLUTION), QUICK)[0]
    assert best.scale == pytest.approx(scale, rel=0.04)
    distance, angle = best.a_from_b.difference(there.inverse(), (10.0, 10.0))
    assert distance < 0.6
    assert angle < math.radians(3.0)


@pytest.mark.parametrize("scale", [0.4, 1.0, 2.5])
def test_walls_stay_where_they_are_when_cells_change(scale):
    levels = _grown_levels(apartment(), RESOLUTION * scale, RESOLUTION)
    rows, columns = np.nonzero(apartment() == OCCUPIED)
    x, y = (columns + 0.5) * scale, (rows + 0.5) * scale
    inside = (y < levels.shape[0]) & (x < levels.shape[1])
    assert (levels[y[inside].astype(int), x[inside].astype(int)] == OCCUPIED).mean() > 0.99


@pytest.mark.parametrize(
    "wrong", [{"least": 0.0}, {"most": 0.5}, {"step": 0.0}, {"candidates": 0}, {"confidence": 2.0}]
)
def test_settings_that_make_no_sense_are_refused(wrong):
    with pytest.raises(ValueError, match="want"):
        replace(QUICK, **wrong)


def test_scales_are_a_ladder_from_the_least_to_the_most():
    scales = ScaleSettings(least=0.5, most=2.0, step=0.1).scales
    assert scales[0] == 0.5
    assert 1.8 < scales[-1] <= 2.0
    np.testing.assert_allclose(np.diff(np.log(scales)), 0.1)
