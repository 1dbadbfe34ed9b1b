"""Boxes of a generated floor, and all of them turned."""

import math

import numpy as np
import pytest

from lidarium.envs.floors.floor import Floor
from lidarium.envs.floors.generation.buildings import BuildingSettings, generate_building
from lidarium.envs.floors.generation.solids import rotated, solid_of
from lidarium.envs.floors.measures import measure_building


def test_rotation_turns_the_floor_and_keeps_its_figures():
    straight = generate_building(4, BuildingSettings(kind="apartment"))
    turned = generate_building(4, BuildingSettings(kind="apartment", rotation=0.5))
    before, after = measure_building(straight), measure_building(turned)
    assert (after.loops, after.rooms) == (before.loops, before.rooms)
    assert after.area_m2 == pytest.approx(before.area_m2, rel=0.03)
    assert np.allclose(turned.starts[:, 2] - straight.starts[:, 2], 0.5, atol=1e-3) or np.allclose(
        np.cos(turned.starts[:, 2] - straight.starts[:, 2]), math.cos(0.5), atol=1e-3
    )


def test_a_box_stands_on_its_rectangle():
    box = solid_of((1.0, 2.0, 3.00004, 4.0), 1.5)
    assert box.polygon.tolist() == [[1.0, 2.0], [3.0, 2.0], [3.0, 4.0], [1.0, 4.0]]
    assert (box.z_low, box.z_high) == (0.0, 1.5)


def test_corners_that_open_are_filled_and_the_floor_lies_in_the_first_quadrant():
    straight = Floor(
        "hall", (0.0, 0.0, 4.0, 2.0), (solid_of((0.0, 0.0, 4.0, 0.1)),), starts=np.array([[1.0, 1.0, 3.0]])
    )
    turned = rotated(straight, 0.5)
    width, height = 4.0 * math.cos(0.5) + 2.0 * math.sin(0.5), 4.0 * math.sin(0.5) + 2.0 * math.cos(0.5)
    assert turned.bounds == pytest.approx((0.0, 0.0, width, height), abs=1e-3)
    assert len(turned.solids) == 1 + 4
    free = float((turned.raster(0.025, 0.2, 0.2).solid == 0).sum()) * 0.025**2
    assert free == pytest.approx(4.0 * 1.9, rel=0.02)
    assert turned.starts[0, 2] == pytest.approx(3.5 - 2.0 * math.pi, abs=1e-3)
    assert rotated(straight, 0.0) is straight
