"""Maps of unlike scales: drawn plans, and images of which nobody knows the metres of a pixel."""

import math

import numpy as np
import pytest
from drawn_maps import RESOLUTION, about_middle, apartment, blank, bowed, hall, kept, moved, noisy, room

from lidarium.mapping.grids.occupancy import OCCUPIED
from lidarium.mapping.merging.scaling.scale_search import grown_levels
from lidarium.mapping.merging.scaling.scaled_merge import merge_scaled

SIZE = (700, 700)


def drawn_at(levels, scale, there):
    """Return a map drawn smaller or larger than it is, in a frame of its own; it lies there once grown."""
    return grown_levels(moved(levels, there, SIZE), RESOLUTION / scale, RESOLUTION)


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
