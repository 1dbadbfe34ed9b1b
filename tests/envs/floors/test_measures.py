"""Figures of a building are measured on it."""

import numpy as np
import pytest

from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.floors.generation.furniture import place
from lidarium.envs.floors.measures import measure_building


def test_a_ring_around_a_block_is_one_loop_and_a_table_in_it_none():
    block = place("wardrobe", 0.0, 0.0, 0.0)[0].polygon
    walls = Floor("ring", (-3.0, -3.0, 3.0, 3.0), (type(place("box", 0.0, 0.0, 0.0)[0])(block),))
    assert measure_building(walls).loops == 1
    furnished = Floor("table", (-3.0, -3.0, 3.0, 3.0), place("box", 0.0, 0.0, 0.0))
    assert measure_building(furnished).loops == 0
    assert measure_building(furnished).clutter > 0.0


def wall(x, y, width, height, **given):
    return Solid(np.array([[x, y], [x + width, y], [x + width, y + height], [x, y + height]]), **given)


def test_a_door_parts_two_rooms_and_a_wide_opening_does_not():
    for gap, rooms in ((0.9, 2), (1.8, 1)):
        half = (4.0 - gap) / 2
        walls = (wall(3.9, 0.0, 0.2, half), wall(3.9, 4.0 - half, 0.2, half))
        found = measure_building(Floor("two", (0.0, 0.0, 8.0, 4.0), walls))
        assert (found.rooms, found.loops) == (rooms, 0)
        assert found.area_m2 == pytest.approx(32.0 - 0.4 * half, rel=0.03)


def test_clutter_is_what_furniture_covers():
    floor = Floor("one", (0.0, 0.0, 4.0, 4.0), (wall(1.0, 1.0, 2.0, 1.0, z_high=0.5),))
    assert measure_building(floor).clutter == pytest.approx(2.0 / 16.0, rel=0.05)
    assert measure_building(Floor("none", (0.0, 0.0, 4.0, 4.0))).clutter == 0.0


def test_a_floor_without_room_is_refused():
    with pytest.raises(ValueError, match=r"floor 'narrow' has no room for a robot of radius 0\.3 m"):
        measure_building(Floor("narrow", (0.0, 0.0, 0.4, 5.0)))
