"""Depth images as clouds."""

import cv2
import numpy as np
import pytest

from lidarium.mapping.point_clouds.depth_images import TUM_UNITS, read_depth_image, read_pose
from lidarium.mapping.point_clouds.intrinsics import Intrinsics
from lidarium.mapping.point_clouds.reading import read_cloud

PINHOLE = Intrinsics(100.0, 100.0, 1.0, 0.5)


@pytest.mark.parametrize("suffix", ["pgm", "png"])
def test_depth_images_become_points_of_the_map(suffix, tmp_path):
    image = np.array([[0, 1000, 65535], [2000, 0, 0]], np.uint16)
    path = tmp_path / f"a.{suffix}"
    cv2.imwrite(str(path), image)
    optical = [[0.0, -0.005, 1.0], [-0.02, 0.01, 2.0]]
    assert read_cloud(path, intrinsics=PINHOLE).points == pytest.approx(np.array(optical))
    assert read_depth_image(path, PINHOLE, TUM_UNITS).points[:, 2].tolist() == pytest.approx([0.2, 0.4])
    (tmp_path / "pose.txt").write_text("0 0 1 5\n-1 0 0 0\n0 -1 0 1\n0 0 0 1\n")
    on_map = read_cloud(path, intrinsics=PINHOLE, pose=tmp_path / "pose.txt").points
    assert on_map == pytest.approx(np.array([[6.0, 0.0, 1.005], [7.0, 0.02, 0.99]]), abs=1e-6)


def test_millimetres_are_read_with_their_scale(tmp_path):
    (tmp_path / "a.xyz").write_text("0 0 0\n6000 1 2\n")
    assert read_cloud(tmp_path / "a.xyz", scale=0.001).points[1].tolist() == pytest.approx(
        [6.0, 0.001, 0.002]
    )
    with pytest.raises(ValueError, match="scale of"):
        read_cloud(tmp_path / "a.xyz", scale=0.0)


def test_depth_images_of_the_wrong_type_are_refused(tmp_path):
    for name, image in {"a.png": np.ones((2, 2), np.uint8), "b.png": np.ones((2, 2, 3), np.uint16)}.items():
        cv2.imwrite(str(tmp_path / name), image)
        with pytest.raises(ValueError, match="want a depth image, one channel of uint16"):
            read_cloud(tmp_path / name, intrinsics=PINHOLE)
    cv2.imwrite(str(tmp_path / "c.png"), np.zeros((2, 2), np.uint16))
    with pytest.raises(ValueError, match=r"c\.png holds no points"):
        read_cloud(tmp_path / "c.png", intrinsics=PINHOLE)
    with pytest.raises(ValueError, match="want the intrinsics"):
        read_cloud(tmp_path / "c.png")


@pytest.mark.parametrize("text", ["1 0 0\n0 1 0\n", "1 0 0 0\n0 1 0 0\n0 0 -1 0\n0 0 0 1\n", "a b c d\n"])
def test_poses_that_are_no_motion_are_refused(text, tmp_path):
    (tmp_path / "pose.txt").write_text(text)
    with pytest.raises(ValueError, match=r"pose\.txt is not a pose"):
        read_pose(tmp_path / "pose.txt")
