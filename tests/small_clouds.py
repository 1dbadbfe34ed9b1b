"""Clouds of few points, for tests."""

import numpy as np

from lidarium.mapping.point_clouds.point_cloud import PointCloud


def cloud(*points, **more):
    return PointCloud(np.array(points, np.float32).reshape(-1, 3), **more)
