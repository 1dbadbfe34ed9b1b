"""Frames of cameras, bases and maps."""

import math

import numpy as np
import pytest
from small_clouds import cloud

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.point_clouds.frames import BASE_FROM_OPTICAL, base_from_camera, map_from_base, moved


def test_frames_are_right_handed_and_look_where_they_say():
    ahead = cloud((0, 0, 2), normals=[[0, 0, -1]])
    assert np.linalg.det(BASE_FROM_OPTICAL) == pytest.approx(1.0)
    on_base = moved(ahead, base_from_camera(0.1, 0.0, 0.5, pitch=math.pi / 6))
    across, down = 2 * math.cos(math.pi / 6), 2 * math.sin(math.pi / 6)
    assert on_base.points[0] == pytest.approx([0.1 + across, 0.0, 0.5 - down], abs=1e-6)
    on_map = moved(on_base, map_from_base(Transform(1.0, 2.0, math.pi / 2)))
    assert on_map.points[0] == pytest.approx([1.0, 2.0 + 0.1 + across, 0.5 - down], abs=1e-6)
    assert on_map.normals[0] == pytest.approx([0.0, -across / 2, down / 2], abs=1e-6)


def test_motions_that_are_not_rigid_are_refused():
    for wrong in (np.diag([1, 1, -1, 1]), np.diag([2, 2, 2, 1]), np.eye(3)):
        with pytest.raises(ValueError, match="a motion"):
            moved(cloud((0, 0, 0)), wrong)
