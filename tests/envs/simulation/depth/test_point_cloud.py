"""Points of a depth image on the robot that took it."""

import math

import numpy as np
import pytest

from lidarium.envs.settings.cameras import DepthCamera
from lidarium.envs.simulation.depth.point_cloud import camera_pose, point_cloud


def middle_of(camera, depth):
    """Return the point that the middle pixel of an image shows."""
    image = np.zeros((camera.rows, camera.columns), np.float32)
    image[camera.rows // 2, camera.columns // 2] = depth
    (point,) = point_cloud(image, camera)
    return point


@pytest.mark.parametrize(
    ("mount", "direction"),
    [
        ({}, (1.0, 0.0, 0.0)),
        ({"pan": math.pi / 2}, (0.0, 1.0, 0.0)),
        ({"pitch": math.pi / 2}, (0.0, 0.0, -1.0)),
        ({"pitch": math.pi / 4, "pan": math.pi}, (-math.sqrt(0.5), 0.0, -math.sqrt(0.5))),
    ],
)
def test_the_middle_of_an_image_is_where_the_camera_looks(mount, direction):
    camera = DepthCamera(columns=65, rows=49, forward=0.1, left=0.2, height=0.5, **mount)
    assert middle_of(camera, 2.0) == pytest.approx(np.array([0.1, 0.2, 0.5]) + 2.0 * np.array(direction), abs=1e-5)


def test_a_pose_turns_and_does_not_stretch():
    pose = camera_pose(DepthCamera(pitch=0.3, pan=-0.7))
    assert np.allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3))
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1.0)


def test_the_first_row_is_up_and_the_first_column_to_the_left():
    camera = DepthCamera(columns=8, rows=6)
    cloud = point_cloud(np.ones((1, 6, 8), np.float32), camera).reshape(6, 8, 3)
    assert (np.diff(cloud[:, 0, 2]) < 0.0).all()
    assert (np.diff(cloud[0, :, 1]) < 0.0).all()
    assert point_cloud(np.zeros((6, 8), np.float32), camera).shape == (0, 3)


def test_an_image_of_another_camera_is_refused():
    with pytest.raises(ValueError, match=r"depth has shape \(1, 120, 160\); want the 240 x 320 pixels of this camera"):
        point_cloud(np.ones((1, 120, 160), np.float32), DepthCamera(columns=320, rows=240))
