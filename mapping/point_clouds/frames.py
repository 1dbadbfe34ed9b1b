"""Frames of sensors, robots and maps: right-handed 4 x 4 matrices that move points from one to another.

``BASE_FROM_OPTICAL`` moves points of a camera's optical frame (x to the right, y down, z forwards) to one as
robots have it (x forwards, y to the left, z up).
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.point_clouds.point_cloud import PointCloud

Matrix = NDArray[np.float64]

BASE_FROM_OPTICAL: Matrix = np.array(
    [[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
)
BASE_FROM_OPTICAL.flags.writeable = False

MOST_SKEW = 1e-3
"""By how much a rotation times its transpose may differ from one: matrices in files are rounded."""


def moved(cloud: PointCloud, motion: ArrayLike) -> PointCloud:
    """Return a cloud in another frame, its normals turned alike.

    Parameters
    ----------
    cloud : PointCloud
        The points.
    motion : (4, 4)
        Moves points of their frame to those of the other.

    Returns
    -------
    PointCloud
        The points there.

    Raises
    ------
    ValueError
        Where the matrix is no rigid motion.
    """
    matrix = checked_motion(motion)
    rotation = matrix[:3, :3].T
    points = cloud.points.astype(np.float64) @ rotation + matrix[:3, 3]
    normals = None if cloud.normals is None else (cloud.normals @ rotation).astype(np.float32)
    return PointCloud(points.astype(np.float32), cloud.weights, normals, cloud.source)


def map_from_base(pose: Transform, height: float = 0.0) -> Matrix:
    """Return the matrix of a robot's pose on a floor at a height [m]."""
    matrix = np.eye(4)
    cosine, sine = np.cos(pose.theta), np.sin(pose.theta)
    matrix[:2, :2] = [[cosine, -sine], [sine, cosine]]
    matrix[:3, 3] = pose.x, pose.y, height
    return matrix


def base_from_camera(x: float, y: float, z: float, pitch: float = 0.0, yaw: float = 0.0) -> Matrix:
    """Return the matrix from a camera's optical frame to the robot that carries it.

    Parameters
    ----------
    x, y, z : float
        Where it is on the robot [m].
    pitch : float
        How far it looks down [rad].
    yaw : float
        How far it is turned to the left [rad].
    """
    (down, along), (turn, ahead) = (np.sin(pitch), np.cos(pitch)), (np.sin(yaw), np.cos(yaw))
    matrix = np.eye(4)
    matrix[:3, :3] = np.array([[ahead, -turn, 0.0], [turn, ahead, 0.0], [0.0, 0.0, 1.0]]) @ np.array(
        [[along, 0.0, down], [0.0, 1.0, 0.0], [-down, 0.0, along]]
    )
    matrix[:3, 3] = x, y, z
    return matrix @ BASE_FROM_OPTICAL


def checked_motion(motion: ArrayLike) -> Matrix:
    """Return a rigid motion as a matrix.

    Raises
    ------
    ValueError
        Where it is no right-handed rotation with a translation.
    """
    matrix = np.asarray(motion, np.float64)
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
        raise ValueError(f"a motion has shape {matrix.shape}; want (4, 4) of finite numbers")
    rotation = matrix[:3, :3]
    is_rigid = np.abs(rotation @ rotation.T - np.eye(3)).max() <= MOST_SKEW and np.linalg.det(rotation) > 0.0
    if not is_rigid or np.abs(matrix[3] - (0.0, 0.0, 0.0, 1.0)).max() > MOST_SKEW:
        raise ValueError(
            f"a motion is {matrix.round(3).tolist()}; want a right-handed rotation, a translation and 0 0 0 1"
        )
    return matrix
