"""Filters keep the points that they say; voxels keep mean and weight; normals stand across surfaces."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.point_clouds.filters import finite, within_range, without_lonely
from lidarium.mapping.point_clouds.frames import BASE_FROM_OPTICAL, base_from_camera, map_from_base, moved
from lidarium.mapping.point_clouds.normals import with_normals
from lidarium.mapping.point_clouds.point_cloud import PointCloud
from lidarium.mapping.point_clouds.voxels import thinned


def cloud(*points, **more):
    return PointCloud(np.array(points, np.float32).reshape(-1, 3), **more)


def test_a_cloud_whose_parts_differ_in_length_is_refused():
    with pytest.raises(ValueError, match=r"weights of points have shape \(2,\)"):
        cloud((0, 0, 0), weights=np.ones(2))
    with pytest.raises(ValueError, match=r"want \(2, 3\)"):
        PointCloud(np.zeros((2, 2), np.float32))


def test_the_range_gate_counts_from_the_sensor():
    found = within_range(cloud((4, 0, 0), (6, 0, 0), (math.nan, 0, 0)), 4.0, 0.5, origin=(2.0, 0.0, 0.0))
    assert found.points[:, 0].tolist() == [4.0, 6.0]
    assert within_range(cloud((4, 0, 0), (0.1, 0, 0)), 3.0, 0.5).points.size == 0


def test_points_that_are_not_finite_are_dropped_with_what_is_known_of_them():
    found = finite(cloud((0, 0, 0), (math.inf, 0, 0), (0, math.nan, 0), (1, 1, 1), weights=np.arange(4)))
    assert found.weights.tolist() == [0.0, 3.0]


def test_lonely_points_are_dropped():
    points = cloud((0, 0, 0), (0.1, 0, 0), (0.2, 0, 0), (5, 0, 0))
    assert len(without_lonely(points, 0.11)) == 3
    assert without_lonely(points, 0.11, 2).points[:, 0].tolist() == pytest.approx([0.1])
    assert len(without_lonely(points, 0.11, 4)) == 0


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


def test_normals_stand_across_a_plane_to_the_side_of_the_sensor():
    places = np.random.default_rng(0).uniform(-1, 1, (500, 2))
    plane = PointCloud(np.column_stack([places, 0.5 * places[:, 0] - 2.0]).astype(np.float32))
    found = with_normals(plane).normals
    wanted = np.array([-0.5, 0.0, 1.0]) / math.hypot(0.5, 1.0)
    assert np.abs(found - wanted).max() < 1e-3
    with pytest.raises(ValueError, match="three at least"):
        with_normals(cloud((0, 0, 0), (1, 0, 0)))
