"""Folders of frames with poses, as of TUM RGB-D and KITTI."""

import imageio.v3 as imageio
import numpy as np
import pytest

from lidarium.mapping.point_clouds.cameras import TUM_UNITS
from lidarium.mapping.point_clouds.cloud_files import read_cloud
from lidarium.mapping.point_clouds.sequences import read_sequence


def tum(folder, times=(1.0, 1.5, 2.0), truth=("1.004 1 2 3 0 0 0 1", "1.51 0 0 0 0 0 0.70710678 0.70710678")):
    (folder / "depth").mkdir(parents=True)
    lines = ["# depth maps", "# timestamp filename"]
    for time in times:
        imageio.imwrite(folder / "depth" / f"{time}.png", np.full((4, 6), 5000, np.uint16))
        lines.append(f"{time} depth/{time}.png")
    (folder / "depth.txt").write_text("\n".join(lines) + "\n")
    (folder / "groundtruth.txt").write_text("\n".join(["# ground truth", *truth]) + "\n")
    return folder


def test_images_of_tum_have_the_pose_of_their_time(tmp_path):
    found = read_sequence(tum(tmp_path / "a"))
    assert [path.name for path in found.files] == ["1.0.png", "1.5.png"]
    assert "1 of 3 images have no pose" in found.remarks[0]
    np.testing.assert_allclose(found.poses[0], [[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]], atol=1e-7)
    # A quarter turn to the left.
    np.testing.assert_allclose(found.poses[1][:3, :3], [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-7)
    cloud = read_cloud(found.files[0], found.scale, (10.0, 10.0, 3.0, 2.0))
    assert found.scale == TUM_UNITS
    np.testing.assert_allclose(cloud.points[:, 2], 1.0)


def kitti(folder, poses=2):
    (folder / "velodyne").mkdir(parents=True)
    scan = np.array([[1.0, 2.0, 3.0, 0.5], [4.0, 5.0, 6.0, 0.1]], np.float32)
    for k in range(2):
        (folder / "velodyne" / f"{k:06d}.bin").write_bytes(scan.tobytes())
    # Camera axes: x right, y down, z ahead; the laser's: x ahead, y left, z up.
    (folder / "calib.txt").write_text("P0: 1 0 0 0 0 1 0 0 0 0 1 0\nTr: 0 -1 0 0 0 0 -1 -0.08 1 0 0 -0.27\n")
    lines = [f"1 0 0 0 0 1 0 0 0 0 1 {2.0 * k}" for k in range(poses)]
    (folder / "poses.txt").write_text("\n".join(lines) + "\n")
    return folder


def test_scans_of_kitti_have_poses_of_the_laser(tmp_path):
    found = read_sequence(kitti(tmp_path / "a"))
    np.testing.assert_allclose(found.poses[0], np.eye(4), atol=1e-12)
    # Two metres ahead are along x.
    np.testing.assert_allclose(found.poses[1][:3, 3], [2.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_array_equal(read_cloud(found.files[0]).points, [[1, 2, 3], [4, 5, 6]])


def test_folders_that_are_none_are_refused(tmp_path):
    with pytest.raises(ValueError, match=r"is a folder without depth\.txt"):
        read_sequence(tmp_path)
    with pytest.raises(ValueError, match=r"no image of .* has a pose"):
        read_sequence(tum(tmp_path / "far", truth=("900 0 0 0 0 0 0 1", "901 0 0 0 0 0 0 1")))
    with pytest.raises(ValueError, match="no rotations"):
        read_sequence(tum(tmp_path / "bad", truth=("1.0 0 0 0 0 0 0 0", "1.5 0 0 0 0 0 0 3")))
    with pytest.raises(ValueError, match="2 scans in velodyne and 3 poses"):
        read_sequence(kitti(tmp_path / "three", poses=3))
    folder = kitti(tmp_path / "no_mount")
    (folder / "calib.txt").write_text("P0: 1 0 0 0 0 1 0 0 0 0 1 0\n")
    with pytest.raises(ValueError, match="no line Tr"):
        read_sequence(folder)
    folder = tum(tmp_path / "broken")
    (folder / "depth.txt").write_text("1.0\n")
    with pytest.raises(ValueError, match=r"depth\.txt"):
        read_sequence(folder)
