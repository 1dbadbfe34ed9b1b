"""Maps of map_server as floors."""

import math

import numpy as np
import pytest
from imported_floors import connectivity, free_of, room, write_map

from lidarium.envs.floors.importers import load_file


def test_of_a_ros_map_the_largest_free_area_is_free_and_unknown_is_solid(tmp_path):
    floor = load_file(write_map(tmp_path, room(), origin=[1.0, -2.0, 0.0]))
    assert floor.name == "map"
    assert floor.bounds == pytest.approx((1.1, -1.9, 3.9, -0.1))
    free = free_of(floor, 0.1)
    # In the picture row 0 is the top: the closet is up left, so the last rows lack it.
    assert free.sum() == 18 * 28 - 25 - 4
    assert floor.starts.shape == (0, 3)


def test_a_ros_map_is_turned_by_the_yaw_of_its_origin(tmp_path):
    straight = load_file(write_map(tmp_path, room()))
    quarter = load_file(write_map(tmp_path, room(), origin=[0.0, 0.0, math.pi / 2]))
    np.testing.assert_allclose(
        quarter.bounds,
        (-straight.bounds[3], straight.bounds[0], -straight.bounds[1], straight.bounds[2]),
        atol=1e-6,
    )
    x, y = 2.55, 1.35
    solid = quarter.raster(0.1, 0.0, 1.0)
    column, row = (int((value - low) / 0.1) for value, low in zip((-y, x), solid.origin, strict=True))
    assert not solid.solid[row, column]


def test_walls_of_one_pixel_stay_closed_when_a_map_is_turned(tmp_path):
    for yaw in (0.1, 0.3, math.pi / 4, -2.0):
        floor = load_file(write_map(tmp_path, room(), origin=[0.0, 0.0, yaw]))
        area = free_of(floor, 0.025).sum() * 0.025**2
        assert area == pytest.approx((18 * 28 - 25 - 4) * 0.01, rel=0.03)


SLAM_MAPS = ["radish_intel", "willow_garage_2010", "linorobot_house", "intel_lab_bwi"]


@pytest.mark.parametrize("name", SLAM_MAPS)
def test_maps_made_by_robots_become_one_connected_floor(shared_data, name):
    free = free_of(load_file(shared_data / "slam_maps" / f"{name}.yaml"), 0.025)
    assert connectivity(free) > 0.999
    assert free.sum() * 0.025**2 > 25.0
