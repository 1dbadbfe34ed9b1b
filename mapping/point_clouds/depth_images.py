"""Depth images as files: PGM and PNG of 16 bits, with the pose of their camera."""

from pathlib import Path

import numpy as np

from lidarium.mapping.files.guarded_reading import read_text, reading
from lidarium.mapping.files.images import read_image
from lidarium.mapping.point_clouds.frames import Matrix, checked_motion, moved
from lidarium.mapping.point_clouds.intrinsics import Intrinsics, points_of_depth
from lidarium.mapping.point_clouds.point_cloud import PointCloud

MILLIMETRES = 1e-3
"""Metres of a unit in most depth images."""

TUM_UNITS = 1.0 / 5000.0
"""Metres of a unit in those of TUM's RGB-D benchmark."""

_NO_DEPTH = 65535

_MOST_POSE_BYTES = 65536


def read_depth_image(
    path: Path | str,
    intrinsics: Intrinsics,
    scale: float = MILLIMETRES,
    pose: Path | str | None = None,
) -> PointCloud:
    """Read a depth image.

    Parameters
    ----------
    path : Path
        A PGM or PNG of one channel of 16 bits; 0 and 65535 are no measurement.
    intrinsics : Intrinsics
        Of the camera.
    scale : float
        Metres of a unit.
    pose : Path, optional
        A text file of 4 x 4 numbers that move points of the optical frame to the map.

    Returns
    -------
    PointCloud
        The points, in the optical frame or the map's [m].

    Raises
    ------
    FileNotFoundError, ValueError
        Where there is no such file, it is no such image, or has no measurement.
    """
    path = Path(path)
    image = read_image(path)
    if image.ndim != 2 or image.dtype != np.uint16:
        channels = 1 if image.ndim == 2 else image.shape[2]
        raise ValueError(
            f"{path} has {channels} channels of {image.dtype}; want a depth image, one channel of uint16"
        )
    depth = np.where(image == _NO_DEPTH, 0.0, image * scale)
    cloud = PointCloud(points_of_depth(depth, intrinsics), source=str(path))
    return cloud if pose is None else moved(cloud, read_pose(pose))


def read_pose(path: Path | str) -> Matrix:
    """Read a rigid motion: a text file of 4 x 4 numbers.

    Files round their numbers: the nearest rotation is taken.

    Raises
    ------
    FileNotFoundError, ValueError
        Where there is no such file, or it holds no rigid motion.
    """
    path = Path(path)
    text = read_text(path, _MOST_POSE_BYTES)
    with reading(path, "a pose of 4 x 4 numbers"):
        motion = checked_motion(
            [[float(word) for word in line.split()] for line in text.splitlines() if line.strip()]
        )
    left, _, right = np.linalg.svd(motion[:3, :3])
    motion[:3, :3] = left @ right
    return motion
