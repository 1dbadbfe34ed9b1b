"""Logs of the CARMEN robot navigation toolkit: text, a message a line.

They are plain or gzipped.

Read are FLASER and ROBOTLASER1 (scans), ODOM (odometry) and PARAM (where the laser is). A scan's odometry
stands in its own line. GridFastSLAM, which says so by NEFF lines, puts its own result there, in scans and in
the first ODOM after each; in its logs odometry is the sum of the motions from ODOM to ODOM, without those
first ones, and a scan is stamped with the ODOM before it.
"""

import gzip
import zlib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.files.carmen.directions import give_directions, on_one_grid
from lidarium.mapping.files.carmen.lines import Content, Scan, parameter, read_line
from lidarium.mapping.files.guarded_reading import read_lines, reading
from lidarium.mapping.files.laser_logs import LaserLog, made_usable, symmetric_scans
from lidarium.mapping.files.trajectories import interpolated
from lidarium.mapping.geometry.rigid import composed, relative

REPEATED_M = 1e-4
"""By how much a pose and its copy in another line may differ, in metres and radians."""

SAME_STAMP_S = 1e-6

MOST_LINE_BYTES = 1 << 20
"""Longest line of a log; one of 16,384 ranges has some 150,000 bytes."""


def read_carmen_log(path: Path, field_of_view: float | None = None) -> LaserLog:
    """Read a log.

    Parameters
    ----------
    path : Path
        The file; with ``.gz`` at its end it is unpacked.
    field_of_view : float or None
        Angle between the first and the last beam of FLASER lines [rad], which carry none; else that of the
        log's parameters, or of a SICK with so many beams.

    Returns
    -------
    LaserLog
        The scans in the directions of most. What was left out is counted in ``skipped``.

    Raises
    ------
    FileNotFoundError
        If it is not there.
    ValueError
        If it holds no usable scan.
    """
    path = Path(path)
    content = Content()
    with reading(path, "a CARMEN log"):
        for line in _lines(path, content.skipped):
            read_line(line, content)
        if not content.scans:
            raise ValueError(f"{path} holds no scans; want a CARMEN log with FLASER or ROBOTLASER1 lines")
        give_directions(content, field_of_view)
        return made_usable(_log(path, content), str(path))


def _lines(path: Path, skipped: Counter[str]) -> Iterator[str]:
    """Yield the lines of a file; where it is cut off or damaged, those before."""
    try:
        yield from read_lines(path, MOST_LINE_BYTES)
    except (EOFError, zlib.error, gzip.BadGzipFile):
        skipped["rest of a file that is cut off or damaged"] += 1


def _log(path: Path, content: Content) -> LaserLog:
    kept, beams, ranges, highest = on_one_grid(content)
    try:
        wide, geometry, axis = symmetric_scans(ranges, beams.angle_min, beams.increment, (0.0, highest))
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error
    laser_pose = _mounting(content, kept[0][0]) + np.array([0.0, 0.0, axis])
    stamps = np.array([scan.stamp for scan, _ in kept], np.float64)
    robot_poses = np.array([scan.robot_pose for scan, _ in kept], np.float64)
    readings_stamps = np.array([stamp for _, stamp in content.odometry], np.float64)
    readings = np.array([pose for pose, _ in content.odometry], np.float64).reshape(-1, 3)
    before = np.array([before for _, before in kept], np.int64)
    remarks = tuple(f"{number} x {what}" for what, number in content.remarks.items())
    if not content.is_corrected:
        return LaserLog(
            stamps,
            wide,
            geometry,
            robot_poses,
            laser_pose,
            readings_stamps=readings_stamps,
            readings=readings,
            reading_of_scan=before - 1,
            skipped=dict(content.skipped),
            remarks=remarks,
        )
    chained, is_own = _chained(readings, content.scans)
    if not _has_odometry(before, is_own):
        return LaserLog(
            stamps,
            wide,
            geometry,
            None,
            laser_pose,
            corrected=robot_poses,
            skipped=dict(content.skipped),
            remarks=remarks,
        )
    return LaserLog(
        stamps,
        wide,
        geometry,
        _at_scans(stamps, before, readings_stamps, chained, is_own),
        laser_pose,
        corrected=robot_poses,
        readings_stamps=readings_stamps[is_own],
        readings=chained[is_own],
        reading_of_scan=np.cumsum(np.append(0, is_own))[before] - 1,
        skipped=dict(content.skipped),
        remarks=remarks,
    )


def _has_odometry(before: NDArray[np.int64], is_own: NDArray[np.bool_]) -> bool:
    """Return whether most scans have odometry of their own since the one before.

    ``before`` ODOM lines came before each.
    """
    count = np.cumsum(np.append(0, is_own))[before]
    return bool(len(count) > 0 and count[-1] > 0 and (len(count) < 2 or (np.diff(count) > 0).mean() > 0.5))


def _chained(
    readings: NDArray[np.float64], scans: list[tuple[Scan, int]]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return the sum of the motions between readings, and which are odometry.

    The first reading after a scan is the scan's pose, from which odometry goes on; where that line is
    missing, the scan's own stands for it.
    """
    is_own, previous = np.ones(len(readings), np.bool_), readings[np.maximum(np.arange(len(readings)) - 1, 0)]
    for scan, before in scans:
        if before < len(readings):
            is_own[before] = np.abs(readings[before] - scan.robot_pose).max() >= REPEATED_M
            previous[before] = scan.robot_pose
    chained = np.zeros_like(readings)
    for k in range(1, len(readings)):
        chained[k] = (
            composed(chained[k - 1], relative(previous[k], readings[k])) if is_own[k] else chained[k - 1]
        )
    return chained, is_own


def _at_scans(
    stamps: NDArray[np.float64],
    before: NDArray[np.int64],
    readings_stamps: NDArray[np.float64],
    chained: NDArray[np.float64],
    is_own: NDArray[np.bool_],
) -> NDArray[np.float64]:
    """Return the odometry of scans (n,), of which ``before`` readings came before each, (n, 3) [m, rad].

    A scan has the stamp of the reading before it. Where that line is missing, odometry is interpolated.
    """
    odometry = chained[np.maximum(before - 1, 0)]
    own = np.flatnonzero(is_own)
    late = np.flatnonzero(stamps > readings_stamps[np.maximum(before - 1, 0)] + SAME_STAMP_S)
    for scan in late:
        after = int(np.searchsorted(own, before[scan]))
        if not 0 < after < len(own):
            continue
        ends = own[after - 1 : after + 1]
        if readings_stamps[ends[0]] <= stamps[scan] <= readings_stamps[ends[1]]:
            odometry[scan] = interpolated(readings_stamps[ends], chained[ends], stamps[scan : scan + 1])[0]
    return odometry


def _mounting(content: Content, first: Scan) -> NDArray[np.float64]:
    """Return the laser's pose on the robot.

    It is from the parameters, or, where the first scan's line has two poses, from them.
    """
    if "robot_frontlaser_offset" in content.parameters:
        return np.array([parameter(content, "robot_frontlaser_offset") or 0.0, 0.0, 0.0])
    return relative(np.array(first.robot_pose), np.array(first.laser_pose))
