"""Parts of a cloud are as long as it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from small_clouds import cloud

from lidarium.mapping.point_clouds.point_cloud import PointCloud, thinned


def test_a_cloud_whose_parts_differ_in_length_is_refused():
    with pytest.raises(ValueError, match=r"weights of points have shape \(2,\)"):
        cloud((0, 0, 0), weights=np.ones(2))
    with pytest.raises(ValueError, match=r"want \(2, 3\)"):
        PointCloud(np.zeros((2, 2), np.float32))


@given(
    arrays.arrays(np.int8, st.tuples(st.integers(1, 60), st.just(3))),
    st.sampled_from([0.5, 1.0, 3.0]),
)
def test_voxels_leave_means_and_weights(cells, edge):
    points = cells.astype(np.float32) / 8
    found = thinned(PointCloud(points), edge)
    _, first, labels, counts = np.unique(
        np.floor(points / edge), axis=0, return_index=True, return_inverse=True, return_counts=True
    )
    order = np.argsort(first)
    means = [points[labels.reshape(-1) == place].mean(axis=0) for place in order]
    assert found.weights.tolist() == counts[order].tolist()
    assert np.abs(found.points - means).max() < 1e-4


def test_voxels_add_weights_and_refuse_what_is_too_far():
    twice = thinned(cloud((0.1, 0, 0), (0.4, 0, 0), weights=np.array([1, 3])), 1.0)
    assert twice.weights.tolist() == [4.0]
    assert twice.points[0, 0] == pytest.approx((0.1 + 1.2) / 4)
    with pytest.raises(ValueError, match="voxels"):
        thinned(cloud((1e9, 0, 0)), 0.01)
    with pytest.raises(ValueError, match="edge"):
        thinned(cloud((1, 0, 0)), 0.0)
