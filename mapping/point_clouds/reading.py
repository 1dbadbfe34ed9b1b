"""Clouds from files of any known kind, by their names and what they begin with."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from lidarium.mapping.files.guarded_arrays import read_arrays
from lidarium.mapping.files.guarded_reading import open_guarded, read_bytes, reading
from lidarium.mapping.point_clouds.depth_images import MILLIMETRES, read_depth_image
from lidarium.mapping.point_clouds.intrinsics import Intrinsics
from lidarium.mapping.point_clouds.pcd import parse_pcd
from lidarium.mapping.point_clouds.ply import parse_ply
from lidarium.mapping.point_clouds.point_cloud import PointCloud
from lidarium.mapping.point_clouds.text_clouds import parse_obj, parse_xyz

LARGEST_EXTENT = 1000.0
"""Largest extent that is taken for metres [m]."""

KINDS = {
    ".pcd": "PCD",
    ".ply": "PLY",
    ".obj": "OBJ",
    ".xyz": "XYZ",
    ".txt": "XYZ",
    ".npz": "NPZ",
    ".pgm": "PGM",
    ".png": "PNG",
}
"""What a file is by the end of its name."""

_PARSERS: dict[str, Callable[[bytes, str], PointCloud]] = {
    "PCD": parse_pcd,
    "PLY": parse_ply,
    "OBJ": parse_obj,
    "XYZ": parse_xyz,
}
_BEGINNINGS = {
    b"# .PCD": "PCD",
    b"VERSION": "PCD",
    b"ply": "PLY",
    b"P5": "PGM",
    b"\x89PNG": "PNG",
    b"PK": "NPZ",
}
_COORDINATES = "xyz"


def read_cloud(
    path: Path | str,
    scale: float | None = None,
    intrinsics: Intrinsics | None = None,
    pose: Path | str | None = None,
) -> PointCloud:
    """Read a cloud.

    Parameters
    ----------
    path : Path
        A PCD, PLY, OBJ, XYZ or NPZ file (an array ``xyz``), or a depth image (PGM, PNG).
    scale : float, optional
        Metres of a unit; by default 1, and 0.001 of depth images.
    intrinsics : Intrinsics, optional
        Of the camera; depth images need them.
    pose : Path, optional
        A text file of 4 x 4 numbers, the pose of a depth image.

    Returns
    -------
    PointCloud
        Its points [m], all of them finite.

    Raises
    ------
    FileNotFoundError
        Where there is no such file.
    ValueError
        Where it is of another kind than its name says, truncated, without points, or has such as are not
        finite; where its points can be no metres.
    """
    path = Path(path)
    kind = kind_of(path)
    if scale is not None and not 0.0 < scale < np.inf:
        raise ValueError(f"scale of {path} is {scale}; want a number above 0")
    if kind in ("PGM", "PNG"):
        if intrinsics is None:
            raise ValueError(f"{path} is a depth image; want the intrinsics of its camera")
        return checked_cloud(read_depth_image(path, intrinsics, scale or MILLIMETRES, pose))
    if kind == "NPZ":
        cloud = _read_npz(path)
    else:
        with reading(path, f"a whole {kind} file"):
            cloud = _PARSERS[kind](read_bytes(path), str(path))
    if scale is not None:
        cloud = PointCloud(cloud.points * np.float32(scale), cloud.weights, cloud.normals, cloud.source)
    return checked_cloud(cloud)


def kind_of(path: Path) -> str:
    """Return what kind a file is by its name and beginning, which have to agree.

    Raises
    ------
    FileNotFoundError, ValueError
        Where there is no such file, neither tells, or they differ.
    """
    with open_guarded(path) as file:
        begin = file.read(16)
    named = KINDS.get(path.suffix.lower())
    found = next((kind for start, kind in _BEGINNINGS.items() if begin.startswith(start)), None)
    if found is not None and named not in (None, found):
        raise ValueError(f"{path} is named as {named} and holds {found}; want a name that tells")
    kind = found or named
    if kind is None:
        raise ValueError(f"{path} is no cloud that is known; want {', '.join(sorted(KINDS))}")
    return kind


def checked_cloud(cloud: PointCloud) -> PointCloud:
    """Return a cloud that has points, all of them finite and near in metres.

    Raises
    ------
    ValueError
        Where it has not; the message names its source.
    """
    points = cloud.points
    if len(points) == 0:
        raise ValueError(f"{cloud.source} holds no points")
    lost = int((~np.isfinite(points).all(axis=1)).sum())
    if lost:
        raise ValueError(f"{cloud.source} holds {lost:,} points of nan or inf; want finite coordinates")
    extent = float((points.max(axis=0).astype(np.float64) - points.min(axis=0)).max())
    if extent > LARGEST_EXTENT:
        raise ValueError(
            f"{cloud.source} extends over {extent:,.0f} m, so that its units are hardly metres; for "
            "millimetres give scale 0.001"
        )
    return cloud


def _read_npz(path: Path) -> PointCloud:
    """Read the array ``xyz`` of an NPZ file."""
    arrays = read_arrays(path, "a whole NPZ file")
    if not isinstance(arrays, dict) or _COORDINATES not in arrays:
        raise ValueError(f"{path} holds no array {_COORDINATES}; want points of shape (N, 3)")
    with reading(path, "a cloud"):
        return PointCloud(arrays[_COORDINATES].astype(np.float32), source=str(path))
