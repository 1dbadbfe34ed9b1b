"""Points of depth images lie where the pinhole says."""

import numpy as np
import pytest

from lidarium.mapping.point_clouds.intrinsics import Intrinsics, points_of_depth

PINHOLE = Intrinsics(100.0, 50.0, 1.0, 0.0)


def test_points_lie_on_the_rays_of_their_pixels():
    depth = np.array([[2.0, 0.0, np.nan], [1.0, np.inf, 4.0]], np.float32)
    points = points_of_depth(depth, PINHOLE)
    assert points.dtype == np.float32
    assert points.tolist() == [
        pytest.approx([-0.02, 0.0, 2.0]),
        pytest.approx([-0.01, 0.02, 1.0]),
        pytest.approx([0.04, 0.08, 4.0]),
    ]
    assert (points_of_depth(depth[None], PINHOLE) == points).all()


@pytest.mark.parametrize("shape", [(3,), (2, 3, 4), (1, 1, 2, 2)])
def test_an_image_of_another_shape_is_refused(shape):
    with pytest.raises(ValueError, match="depth has shape"):
        points_of_depth(np.zeros(shape), PINHOLE)


@pytest.mark.parametrize("numbers", [(0.0, 1.0, 0.0, 0.0), (1.0, float("nan"), 0.0, 0.0)])
def test_a_pinhole_that_cannot_be_is_refused(numbers):
    with pytest.raises(ValueError, match="intrinsics"):
        Intrinsics(*numbers)
