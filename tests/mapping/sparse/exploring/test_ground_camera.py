"""Pixels of a depth camera that show the ground."""

import math

import numpy as np
import pytest

from lidarium.mapping.sparse.exploring.ground_camera import ground_pixels
from tests.ground_views import depth_image, looking

WALL = np.array([[[2.0, -3.0, 0.0], [2.2, 3.0, 2.0]]])


def test_the_camera_knows_between_which_distances_it_sees_the_ground():
    camera = looking(pitch=0.0, rows=60)
    lowest = math.atan(29.5 / camera.intrinsics.fy)
    assert camera.nearest_m == pytest.approx(0.5 / math.tan(lowest))
    assert camera.farthest_m == pytest.approx(math.sqrt(4.0**2 - 0.5**2))
    assert looking(pitch=1.2).farthest_m == pytest.approx(0.5 / math.tan(1.2 - lowest))
    assert looking(pitch=0.3, pan=0.7).bearing == pytest.approx(0.7)
    assert camera.half_angle == pytest.approx(math.radians(29.0))


def test_a_camera_that_sees_no_ground_is_refused_with_the_cure():
    with pytest.raises(ValueError, match=r"sees the ground only from inf m on.*a larger pitch"):
        looking(pitch=-0.6)
    with pytest.raises(ValueError, match=r"at a height of 2 m .* beyond its range of 2\.5 m"):
        looking(pitch=0.0, height=2.0, range_m=2.5)


def test_pixels_show_ground_where_their_points_lie_on_it_within_range():
    camera = looking()
    depth = depth_image(camera, (0.0, 0.0, 0.0), WALL)
    shown = ground_pixels(depth, camera.numbers)
    pinhole = camera.intrinsics
    for row, column in np.argwhere(depth > 0.0)[::37]:
        point = depth[row, column] * np.array(
            [(column - pinhole.cx) / pinhole.fx, (row - pinhole.cy) / pinhole.fy, 1.0]
        )
        height = (camera.pose[:3, :3] @ point + camera.pose[:3, 3])[2]
        is_ground = abs(height) < 1e-3 and np.linalg.norm(point) <= 4.0
        assert shown[row, column] == is_ground or (0.0 < height < 0.05)
    assert shown.any()
    assert not ground_pixels(np.zeros_like(depth), camera.numbers).any()
