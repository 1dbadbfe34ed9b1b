"""Folders of frames with poses: RGB-D sequences as of TUM, and laser scans as of KITTI."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.files.guarded_reading import MAX_FILE_BYTES, read_text, reading
from lidarium.mapping.geometry.rigid_motions import inverse_of
from lidarium.mapping.point_clouds.cameras import TUM_UNITS
from lidarium.mapping.point_clouds.columns import text_columns

DEPTHS, TRUTH = "depth.txt", "groundtruth.txt"
SCANS, POSES, CALIBRATION = "velodyne", "poses.txt", "calib.txt"

APART_S = 0.02
"""Largest difference of time between an image and its pose, as TUM's tools have it [s]."""


@dataclass(frozen=True, eq=False, slots=True)
class Sequence:
    """Frames of a folder: files, poses (N, 4, 4), metres of a unit (None for the default of a file), and remarks."""

    files: tuple[Path, ...]
    poses: NDArray[np.float64]
    scale: float | None
    remarks: tuple[str, ...] = ()


def read_sequence(folder: Path) -> Sequence:
    """Read the names of the frames of a folder, and their poses."""
    if (folder / DEPTHS).is_file():
        return _tum(folder)
    if (folder / SCANS).is_dir():
        return _kitti(folder)
    raise ValueError(
        f"{folder} is a folder without {DEPTHS} (TUM RGB-D) and without {SCANS}/ (KITTI); want one of them, or files"
    )


def _tum(folder: Path) -> Sequence:
    """Return depth images, each with the pose of the nearest time."""
    images = [line.split() for line in read_text(folder / DEPTHS, MAX_FILE_BYTES).splitlines() if line[:1] != "#"]
    with reading(folder / DEPTHS, "lines of a time and a file"):
        times = np.array([float(words[0]) for words in images if words])
        names = [words[1] for words in images if words]
    with reading(folder / TRUTH, "lines of a time, x, y, z and a quaternion x, y, z, w"):
        rows = text_columns(read_text(folder / TRUTH, MAX_FILE_BYTES).encode(), range(8))
    rows = rows[np.argsort(rows[:, 0], kind="stable")]
    if len(times) == 0:
        raise ValueError(f"{folder / DEPTHS} names no image; want lines of a time and a file")
    after = np.clip(np.searchsorted(rows[:, 0], times), 1, max(len(rows) - 1, 1))
    near = np.stack([after - 1, np.minimum(after, len(rows) - 1)], axis=1)
    gaps = np.abs(rows[near, 0] - times[:, None])
    chosen, has_pose = near[np.arange(len(times)), gaps.argmin(axis=1)], gaps.min(axis=1) <= APART_S
    if not has_pose.any():
        raise ValueError(
            f"no image of {folder / DEPTHS} has a pose in {TRUTH} within {APART_S} s; want times of the same clock"
        )
    remarks: tuple[str, ...] = ()
    if not has_pose.all():
        remarks = (f"{folder}: {np.count_nonzero(~has_pose)} of {len(times)} images have no pose and are left out",)
    files = tuple(folder / name for name, is_taken in zip(names, has_pose, strict=True) if is_taken)
    return Sequence(files, _poses_of(rows[chosen[has_pose], 1:], folder / TRUTH), TUM_UNITS, remarks)


def _poses_of(rows: NDArray[np.float64], path: Path) -> NDArray[np.float64]:
    """Return poses (N, 4, 4) of positions and quaternions x, y, z, w (N, 7)."""
    lengths = np.linalg.norm(rows[:, 3:], axis=1)
    if not (np.isfinite(rows).all() and (np.abs(lengths - 1.0) < 0.01).all()):
        raise ValueError(f"{path} holds quaternions that are no rotations; want unit ones, x, y, z, w")
    x, y, z, w = (rows[:, 3:] / lengths[:, None]).T
    poses = np.zeros((len(rows), 4, 4))
    poses[:, 0, :3] = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], axis=1)
    poses[:, 1, :3] = np.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], axis=1)
    poses[:, 2, :3] = np.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], axis=1)
    poses[:, :3, 3], poses[:, 3, 3] = rows[:, :3], 1.0
    return poses


def _kitti(folder: Path) -> Sequence:
    """Return laser scans with their poses in the frame of the first scan."""
    files = tuple(sorted((folder / SCANS).glob("*.bin")))
    motions = _motions(read_text(folder / POSES, MAX_FILE_BYTES), folder / POSES)
    if len(files) != len(motions):
        raise ValueError(
            f"{folder} has {len(files)} scans in {SCANS} and {len(motions)} poses in {POSES}; want as many"
        )
    lines = read_text(folder / CALIBRATION, MAX_FILE_BYTES).splitlines()
    named = next((line.partition(":")[2] for line in lines if line.partition(":")[0].strip() == "Tr"), None)
    if named is None:
        raise ValueError(f"{folder / CALIBRATION} has no line Tr, the pose of the laser in the camera's frame")
    mount = _motions(named, folder / CALIBRATION)[0]
    return Sequence(files, inverse_of(mount) @ motions @ mount, None)


def _motions(text: str, path: Path) -> NDArray[np.float64]:
    """Return motions (N, 4, 4) of lines of 3 x 4 numbers."""
    with reading(path, "lines of 12 numbers"):
        rows = text_columns(text.encode(), range(12)).reshape(-1, 3, 4)
    motions = np.concatenate([rows, np.broadcast_to([[[0.0, 0.0, 0.0, 1.0]]], (len(rows), 1, 4))], axis=1)
    left, _, right = np.linalg.svd(motions[:, :3, :3])
    if not (np.isfinite(motions).all() and (np.abs(left @ right - motions[:, :3, :3]) < 0.01).all()):
        raise ValueError(f"{path} holds matrices that are no rigid motions; want rotations and translations")
    motions[:, :3, :3] = left @ right
    return motions
