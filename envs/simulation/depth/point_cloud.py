"""Points of a depth image on the robot that took it."""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.settings.cameras import DepthCamera
from lidarium.mapping.point_clouds.cameras import points_of_depth


def camera_pose(camera: DepthCamera) -> NDArray[np.float64]:
    """Return the pose of a camera's optical frame on its robot.

    Returns
    -------
    (4, 4) float64
        Maps points of the optical frame (x to the right, y down, z ahead) into the robot's (x ahead, y to the
        left, z up, the origin below its centre on the ground) [m].
    """
    cp, sp, cy, sy = (
        math.cos(camera.pitch),
        math.sin(camera.pitch),
        math.cos(camera.pan),
        math.sin(camera.pan),
    )
    ahead, left, up = (cy * cp, sy * cp, -sp), (-sy, cy, 0.0), (cy * sp, sy * sp, cp)
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2] = np.negative(left), np.negative(up), ahead
    pose[:3, 3] = camera.forward, camera.left, camera.height
    return pose


def point_cloud(depth: NDArray[np.floating], camera: DepthCamera) -> NDArray[np.float32]:
    """Return the points that an image of a robot's depth camera shows.

    Parameters
    ----------
    depth : (1, rows, columns) or (rows, columns) float
        The image, such as the observation ``depth`` [m].

    Returns
    -------
    (points, 3) float32
        In the robot's frame: x ahead, y to the left, z up from the ground [m].
    """
    if depth.shape[-2:] != (camera.rows, camera.columns):
        raise ValueError(
            f"depth has shape {depth.shape}; want the {camera.rows} x {camera.columns} pixels of this camera"
        )
    pose = camera_pose(camera)
    points = points_of_depth(depth, camera.intrinsics)
    return np.asarray(points @ pose[:3, :3].T + pose[:3, 3], np.float32)
