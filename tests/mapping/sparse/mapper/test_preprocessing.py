"""What cannot be points goes, the others are gathered in voxels."""

import numpy as np
import pytest

from lidarium.mapping.sparse.mapper.preprocessing import usable_points, voxels_of


def test_far_points_and_such_as_are_not_finite_go():
    points = np.array([[1.0, 0, 0], [np.nan, 0, 0], [0, np.inf, 0], [5.0, 0, 0], [0, 0, 4.0]], np.float32)
    assert usable_points(points, 4.0).tolist() == [[1.0, 0.0, 0.0], [0.0, 0.0, 4.0]]
    assert len(usable_points(points)) == 3


@pytest.mark.parametrize(
    ("points", "range_m", "message"),
    [
        (np.empty((0, 3)), None, "no points"),
        (np.full((5, 3), np.nan), None, "none of the 5 points"),
        (np.zeros((5, 2)), None, r"shape \(5, 2\)"),
        (np.random.default_rng(0).uniform(0, 6000, (100, 3)), None, "millimetres"),
        (np.random.default_rng(0).uniform(800, 6000, (100, 3)), 4.0, "points in metres"),
    ],
)
def test_a_cloud_that_cannot_be_mapped_is_refused(points, range_m, message):
    with pytest.raises(ValueError, match=message):
        usable_points(points, range_m)


def test_voxels_are_the_means_of_their_points():
    points = np.random.default_rng(0).uniform(-1.0, 1.0, (2000, 3))
    voxels = voxels_of(points, 0.25)
    assert voxels.weights.sum() == len(points)
    for voxel in range(0, len(voxels.means), 50):
        own = points[voxels.labels == voxel]
        assert len(own) == voxels.weights[voxel]
        np.testing.assert_allclose(own.mean(axis=0), voxels.means[voxel])
        assert np.ptp(own, axis=0).max() <= 0.25
    assert (np.diff([np.argmax(voxels.labels == k) for k in range(len(voxels.means))]) > 0).all()


def test_voxels_of_no_size_are_the_points():
    points = np.ones((3, 3))
    assert voxels_of(points, 0.0).means is points
