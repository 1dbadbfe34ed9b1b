"""Points of depth images lie where the pinhole says."""

import math

import cv2
import numpy as np
import pytest
from small_clouds import cloud

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.point_clouds.cameras import (
    BASE_FROM_OPTICAL,
    TUM_UNITS,
    Intrinsics,
    base_from_camera,
    map_from_base,
    moved,
    points_of_depth,
    read_depth_image,
    read_pose,
)
from lidarium.mapping.point_clouds.cloud_files import read_cloud

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


PINHOLE_OF_DEPTH_IMAGES = Intrinsics(100.0, 100.0, 1.0, 0.5)


@pytest.mark.parametrize("suffix", ["pgm", "png"])
def test_depth_images_become_points_of_the_map(suffix, tmp_path):
    image = np.array([[0, 1000, 65535], [2000, 0, 0]], np.uint16)
    path = tmp_path / f"a.{suffix}"
    cv2.imwrite(str(path), image)
    optical = [[0.0, -0.005, 1.0], [-0.02, 0.01, 2.0]]
    assert read_cloud(path, intrinsics=PINHOLE_OF_DEPTH_IMAGES).points == pytest.approx(np.array(optical))
    assert read_depth_image(path, PINHOLE_OF_DEPTH_IMAGES, TUM_UNITS).points[:, 2].tolist() == pytest.approx([0.2, 0.4])
    (tmp_path / "pose.txt").write_text("0 0 1 5\n-1 0 0 0\n0 -1 0 1\n0 0 0 1\n")
    on_map = read_cloud(path, intrinsics=PINHOLE_OF_DEPTH_IMAGES, pose=tmp_path / "pose.txt").points
    assert on_map == pytest.approx(np.array([[6.0, 0.0, 1.005], [7.0, 0.02, 0.99]]), abs=1e-6)


def test_millimetres_are_read_with_their_scale(tmp_path):
    (tmp_path / "a.xyz").write_text("0 0 0\n6000 1 2\n")
    assert read_cloud(tmp_path / "a.xyz", scale=0.001).points[1].tolist() == pytest.approx([6.0, 0.001, 0.002])
    with pytest.raises(ValueError, match="scale of"):
        read_cloud(tmp_path / "a.xyz", scale=0.0)


def test_depth_images_of_the_wrong_type_are_refused(tmp_path):
    for name, image in {"a.png": np.ones((2, 2), np.uint8), "b.png": np.ones((2, 2, 3), np.uint16)}.items():
        cv2.imwrite(str(tmp_path / name), image)
        with pytest.raises(ValueError, match="want a depth image, one channel of uint16"):
            read_cloud(tmp_path / name, intrinsics=PINHOLE_OF_DEPTH_IMAGES)
    cv2.imwrite(str(tmp_path / "c.png"), np.zeros((2, 2), np.uint16))
    with pytest.raises(ValueError, match=r"c\.png holds no points"):
        read_cloud(tmp_path / "c.png", intrinsics=PINHOLE_OF_DEPTH_IMAGES)
    with pytest.raises(ValueError, match="want the intrinsics"):
        read_cloud(tmp_path / "c.png")


@pytest.mark.parametrize("text", ["1 0 0\n0 1 0\n", "1 0 0 0\n0 1 0 0\n0 0 -1 0\n0 0 0 1\n", "a b c d\n"])
def test_poses_that_are_no_motion_are_refused(text, tmp_path):
    (tmp_path / "pose.txt").write_text(text)
    with pytest.raises(ValueError, match=r"pose\.txt is not a pose"):
        read_pose(tmp_path / "pose.txt")
