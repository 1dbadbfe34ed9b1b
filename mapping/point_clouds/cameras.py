"""Depth cameras: pinhole intrinsics, frames of the camera and the robot, depth images as points."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lidarium.mapping.files.guarded_reading import read_text, reading
from lidarium.mapping.files.images import read_image
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.point_clouds.point_cloud import PointCloud


@dataclass(frozen=True, slots=True)
class Intrinsics:
    """Focal lengths and principal point of a pinhole camera.

    Attributes
    ----------
    fx, fy : float
        Focal lengths [pixels].
    cx, cy : float
        Principal point [pixels]; the centre of the first pixel is (0, 0), as ROS and OpenCV have it.
    """

    fx: float
    fy: float
    cx: float
    cy: float

    def __post_init__(self) -> None:
        numbers = (self.fx, self.fy, self.cx, self.cy)
        if not np.isfinite(numbers).all() or self.fx <= 0.0 or self.fy <= 0.0:
            raise ValueError(f"intrinsics fx, fy, cx, cy are {numbers}; want finite numbers, fx and fy above 0")


def points_of_depth(depth: NDArray[np.floating], intrinsics: Intrinsics) -> NDArray[np.float32]:
    """Return the points of a depth image in the camera's optical frame.

    Parameters
    ----------
    depth : (rows, columns) or (1, rows, columns) float
        Depths along the axis [m]; 0, nan and inf are no measurement.

    Returns
    -------
    (points, 3) float32
        x to the right, y down, z along the axis [m], row by row of the image.
    """
    image = np.asarray(depth)
    if image.ndim == 3 and image.shape[0] == 1:
        image = image[0]
    if image.ndim != 2:
        raise ValueError(f"depth has shape {np.shape(depth)}; want (rows, columns) or (1, rows, columns)")
    rows, columns = np.nonzero(np.isfinite(image) & (image > 0.0))
    z = image[rows, columns].astype(np.float64)
    x = (columns - intrinsics.cx) / intrinsics.fx * z
    y = (rows - intrinsics.cy) / intrinsics.fy * z
    return np.stack([x, y, z], axis=1).astype(np.float32)


Matrix = NDArray[np.float64]

BASE_FROM_OPTICAL: Matrix = np.array(
    [[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
)
BASE_FROM_OPTICAL.flags.writeable = False

MAX_SKEW = 1e-3
"""By how much a rotation times its transpose may differ from one: matrices in files are rounded."""


def moved(cloud: PointCloud, motion: ArrayLike) -> PointCloud:
    """Return a cloud in another frame, its normals turned alike.

    Parameters
    ----------
    motion : (4, 4)
        Moves points of their frame to those of the other.
    """
    matrix = _checked_motion(motion)
    rotation = matrix[:3, :3].T
    points = cloud.points.astype(np.float64) @ rotation + matrix[:3, 3]
    normals = None if cloud.normals is None else (cloud.normals @ rotation).astype(np.float32)
    found = points.astype(np.float32), cloud.weights, normals, cloud.source
    # The offset turns with the points.
    return PointCloud(*found, cloud.offset @ rotation, cloud.remarks)


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
        Position on the robot [m].
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


def _checked_motion(motion: ArrayLike) -> Matrix:
    """Return a rigid motion as a matrix."""
    matrix = np.asarray(motion, np.float64)
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
        raise ValueError(f"a motion has shape {matrix.shape}; want (4, 4) of finite numbers")
    rotation = matrix[:3, :3]
    is_rigid = np.abs(rotation @ rotation.T - np.eye(3)).max() <= MAX_SKEW and np.linalg.det(rotation) > 0.0
    if not is_rigid or np.abs(matrix[3] - (0.0, 0.0, 0.0, 1.0)).max() > MAX_SKEW:
        raise ValueError(
            f"a motion is {matrix.round(3).tolist()}; want a right-handed rotation, a translation and 0 0 0 1"
        )
    return matrix


MILLIMETRES = 1e-3
"""Metres of a unit in most depth images."""

TUM_UNITS = 1.0 / 5000.0
"""Metres of a unit in those of TUM's RGB-D benchmark."""

_NO_DEPTH = 65535

_MAX_POSE_BYTES = 65536


def read_depth_image(
    path: Path | str,
    intrinsics: Intrinsics,
    scale: float = MILLIMETRES,
    pose: Path | str | None = None,
) -> PointCloud:
    """Read a depth image.

    Returns
    -------
    PointCloud
        The points, in the optical frame or the map's [m].
    """
    path = Path(path)
    image = read_image(path)
    if image.ndim != 2 or image.dtype != np.uint16:
        channels = 1 if image.ndim == 2 else image.shape[2]
        raise ValueError(f"{path} has {channels} channels of {image.dtype}; want a depth image, one channel of uint16")
    depth = np.where(image == _NO_DEPTH, 0.0, image * scale)
    cloud = PointCloud(points_of_depth(depth, intrinsics), source=str(path))
    return cloud if pose is None else moved(cloud, read_pose(pose))


def read_pose(path: Path | str) -> Matrix:
    """Read a rigid motion: a text file of 4 x 4 numbers.

    Files round their numbers: the nearest rotation is taken.
    """
    path = Path(path)
    text = read_text(path, _MAX_POSE_BYTES)
    with reading(path, "a pose of 4 x 4 numbers"):
        motion = _checked_motion([[float(word) for word in line.split()] for line in text.splitlines() if line.strip()])
    left, _, right = np.linalg.svd(motion[:3, :3])
    motion[:3, :3] = left @ right
    return motion
