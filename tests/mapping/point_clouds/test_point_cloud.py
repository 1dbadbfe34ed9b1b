"""Parts of a cloud are as long as it."""

import numpy as np
import pytest
from small_clouds import cloud

from lidarium.mapping.point_clouds.point_cloud import PointCloud


def test_a_cloud_whose_parts_differ_in_length_is_refused():
    with pytest.raises(ValueError, match=r"weights of points have shape \(2,\)"):
        cloud((0, 0, 0), weights=np.ones(2))
    with pytest.raises(ValueError, match=r"want \(2, 3\)"):
        PointCloud(np.zeros((2, 2), np.float32))
