"""Trajectories as files and between their stamps.

The format is TUM's: a line of ``stamp x y z qx qy qz qw`` for each pose; ours lie in the plane.
"""

import math
import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.files.guarded_reading import read_lines, reading
from lidarium.mapping.files.output import write_whole
from lidarium.mapping.geometry.rigid import composed, relative

MAX_LINE_BYTES = 1 << 16
"""Longest line of a file of numbers."""

_MAX_STRETCH = 0.1
"""By how much the length of a quaternion may differ from 1: files have one decimal at least."""


def write_tum(path: Path, stamps: NDArray[np.float64], poses: NDArray[np.float64]) -> None:
    """Write stamps (n,) [s] and poses (n, 3), whole or not at all.

    Poses are x, y, theta [m, rad].
    """
    half = 0.5 * poses[:, 2]
    lines = [
        f"{stamp:.6f} {x:.6f} {y:.6f} 0 0 0 {z:.9f} {w:.9f}\n"
        for stamp, x, y, z, w in zip(stamps, poses[:, 0], poses[:, 1], np.sin(half), np.cos(half), strict=True)
    ]
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, "".join(lines).encode())


def read_tum(path: Path) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Read stamps (n,) [s], sorted, and poses x, y, theta (n, 3) [m, rad].

    Coordinates out of the plane are ignored.
    """
    table = read_numbers(path, 8, "a trajectory (stamp x y z qx qy qz qw)")
    table = table[np.argsort(table[:, 0], kind="stable")]
    norms = np.linalg.norm(table[:, 4:8], axis=1)
    if not (np.abs(norms - 1.0) < _MAX_STRETCH).all():
        worst = table[np.abs(norms - 1.0).argmax()]
        raise ValueError(
            f"{path} has the rotation {' '.join(f'{value:g}' for value in worst[4:])} at {worst[0]:g} s; want unit "
            "quaternions qx qy qz qw"
        )
    x, y, z, w = table[:, 4:8].T / norms
    heading = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return table[:, 0].copy(), np.stack([table[:, 1], table[:, 2], heading], axis=1)


def read_numbers(path: Path, columns: int, what: str) -> NDArray[np.float64]:
    """Read a text file of a fixed number of numbers per line, plain or gzipped.

    ``#`` begins a remark.
    """
    path = Path(path)
    lines = read_lines(path, MAX_LINE_BYTES)
    with reading(path, what), warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of a file without numbers, which is reported below
        table = np.loadtxt(lines, np.float64, ndmin=2)
    if table.shape[0] == 0 or table.shape[1] != columns or not np.isfinite(table).all():
        raise ValueError(f"{path} is not {what}: want lines of {columns} numbers, at least one")
    return table


def interpolated(
    stamps: NDArray[np.float64], poses: NDArray[np.float64], times: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return poses (times, 3) interpolated at constant speed.

    The given poses (n, 3) are at stamps (n,). Beyond them, the first or the last pose holds.
    """
    if len(stamps) == 1:
        return np.repeat(poses, len(times), axis=0)
    after = np.clip(np.searchsorted(stamps, times), 1, len(stamps) - 1)
    gap = stamps[after] - stamps[after - 1]
    share = np.clip((times - stamps[after - 1]) / np.where(gap > 0.0, gap, 1.0), 0.0, 1.0)
    return composed(poses[after - 1], relative(poses[after - 1], poses[after]) * share[:, None])


def at_readings(
    poses: NDArray[np.float64], numbers: NDArray[np.int64], readings: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return poses (readings, 3) through known poses, with odometry between them.

    Parameters
    ----------
    poses, numbers : (scans, 3) float64 and (scans,) int64
        Poses that are known, and at which readings; never decreasing.
    readings : (readings, 3) float64
        Odometry. Its error from one known pose to the next is corrected gradually.
    """
    steps = np.arange(len(readings))
    after = (
        np.clip(np.searchsorted(numbers, steps), 1, len(numbers) - 1)
        if len(numbers) > 1
        else np.zeros(len(readings), np.int64)
    )
    before = np.maximum(after - 1, 0)
    starts, ends = np.maximum(numbers[before], 0), np.maximum(numbers[after], 0)
    forward = composed(poses[before], relative(readings[starts], readings))
    backward = composed(poses[after], relative(readings[ends], readings))
    gap = np.maximum(ends - starts, 1)
    share = np.clip((steps - starts) / gap, 0.0, 1.0)
    return composed(forward, relative(forward, backward) * share[:, None])


def last_before(
    stamps: NDArray[np.float64],
    poses: NDArray[np.float64],
    times: NDArray[np.float64],
    tolerance: float = 0.006,
) -> NDArray[np.float64]:
    """Return the pose (times, 3) with the stamp nearest to each time.

    If the nearest stamp is farther than a tolerance [s], the pose with the last stamp before.

    Of poses with one and the same stamp the mean: a clock of few digits does not distinguish them.
    """
    order = np.argsort(stamps, kind="stable")
    known = stamps[order]
    after = (
        np.clip(np.searchsorted(known, times), 1, max(len(known) - 1, 1))
        if len(known) > 1
        else np.zeros(len(times), np.int64)
    )
    before = np.maximum(after - 1, 0)
    nearest = np.where(np.abs(known[after] - times) < np.abs(known[before] - times), after, before)
    chosen = np.where(
        np.abs(known[nearest] - times) <= tolerance, nearest, np.where(known[after] <= times, after, before)
    )
    low, high = np.searchsorted(known, known[chosen], "left"), np.searchsorted(known, known[chosen], "right")
    found = np.empty((len(times), 3))
    for k, (begin, end) in enumerate(zip(low, high, strict=True)):
        group = poses[order[begin:end]]
        found[k] = composed(group[0], relative(group[:1], group).mean(axis=0))
    found[:, 2] = math.pi - (math.pi - found[:, 2]) % (2.0 * math.pi)
    return found
