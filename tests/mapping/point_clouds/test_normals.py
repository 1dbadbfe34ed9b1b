"""Normals stand across surfaces."""

import math

import numpy as np
import pytest
from small_clouds import cloud

from lidarium.mapping.point_clouds.normals import with_normals
from lidarium.mapping.point_clouds.point_cloud import PointCloud


def test_normals_stand_across_a_plane_to_the_side_of_the_sensor():
    places = np.random.default_rng(0).uniform(-1, 1, (500, 2))
    plane = PointCloud(np.column_stack([places, 0.5 * places[:, 0] - 2.0]).astype(np.float32))
    found = with_normals(plane).normals
    wanted = np.array([-0.5, 0.0, 1.0]) / math.hypot(0.5, 1.0)
    assert np.abs(found - wanted).max() < 1e-3
    with pytest.raises(ValueError, match="three at least"):
        with_normals(cloud((0, 0, 0), (1, 0, 0)))
