"""Logs of the CARMEN robot navigation toolkit: text, a message a line.

They are plain or gzipped.

Read are FLASER and ROBOTLASER1 (scans), ODOM (odometry) and PARAM (where the laser is). A scan's odometry
stands in its own line. GridFastSLAM, which says so by NEFF lines, puts its own result there, in scans and in
the first ODOM after each; in its logs odometry is the sum of the motions from ODOM to ODOM, without those
first ones, and a scan is stamped with the ODOM before it.
"""

import gzip
import math
import zlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.files.guarded_reading import read_lines, reading
from lidarium.mapping.files.laser_logs import LaserLog, made_usable, symmetric_scans
from lidarium.mapping.geometry.rigid import composed, relative

_QUIET = ("#", "NEFF", "PARAM", "SYNC", "MARKER", "RLASER", "REMISSION", "TRUEPOS")
"""Messages that hold nothing that is needed here."""

MOST_LINE_BYTES = 1 << 20
"""Longest line of a log; one of 16,384 ranges has some 150,000 bytes."""

SICK_MAX_M = 80.0
"""What a SICK LMS gives from here on is no range but the absence of one [m]."""


@dataclass(slots=True, eq=False)
class _Scan:
    """A line with a scan."""

    ranges: list[float]
    stamp: float
    robot_pose: list[float]
    laser_pose: list[float]
    angle_min: float
    increment: float
    max_range: float


@dataclass(slots=True, eq=False)
class _Content:
    """What the lines of a log say.

    A scan comes with the number of ODOM lines before it.
    """

    scans: list[tuple[_Scan, int]] = field(default_factory=list)
    odometry: list[tuple[list[float], float]] = field(default_factory=list)
    parameters: dict[str, str] = field(default_factory=dict)
    is_corrected: bool = False
    skipped: Counter[str] = field(default_factory=Counter)


def read_carmen_log(path: Path) -> LaserLog:
    """Read a log.

    Parameters
    ----------
    path : Path
        The file; with ``.gz`` at its end it is unpacked.

    Returns
    -------
    LaserLog
        The scans that have as many beams as most. What was left out is counted in ``skipped``.

    Raises
    ------
    FileNotFoundError
        If it is not there.
    ValueError
        If it holds no usable scan.
    """
    path = Path(path)
    content = _Content()
    for line in _lines(path, content.skipped):
        _read_line(line, content)
    if not content.scans:
        raise ValueError(f"{path} holds no scans; want a CARMEN log with FLASER or ROBOTLASER1 lines")
    with reading(path, "a CARMEN log"):
        return made_usable(_log(path, content), str(path))


def _lines(path: Path, skipped: Counter[str]) -> Iterator[str]:
    """Yield the lines of a file; where it is cut off or damaged, those before."""
    try:
        yield from read_lines(path, MOST_LINE_BYTES)
    except (EOFError, zlib.error, gzip.BadGzipFile):
        skipped["rest of a file that is cut off or damaged"] += 1


def _read_line(line: str, content: _Content) -> None:
    words = line.split()
    if not words or words[0].startswith("#"):
        return
    try:
        match words[0]:
            case "FLASER":
                content.scans.append((_flaser(words), len(content.odometry)))
            case "ROBOTLASER1":
                content.scans.append((_robotlaser(words), len(content.odometry)))
            case "ODOM":
                content.odometry.append(
                    (_numbers(words[1:4], 3), float(words[9] if len(words) > 9 else words[-1]))
                )
            case "PARAM" if len(words) > 2:
                content.parameters[words[1]] = words[2]
            case "NEFF":
                content.is_corrected = True
            case kind if kind not in _QUIET:
                content.skipped[f"{kind[:30]} lines"] += 1
    except (ValueError, IndexError, OverflowError):
        content.skipped[f"damaged {words[0]} lines"] += 1


def _numbers(words: list[str], count: int) -> list[float]:
    values = [float(word) for word in words]
    if len(values) != count or not all(math.isfinite(value) for value in values):
        raise ValueError(f"{words} are not {count} numbers")
    return values


def _flaser(words: list[str]) -> _Scan:
    """Read a ``FLASER`` line, of which old logs lack the last two values.

    It is ``FLASER n ranges laser_pose robot_pose stamp host logger_stamp``.
    """
    beams = int(words[1])
    ranges, tail = [float(word) for word in words[2 : 2 + beams]], words[2 + beams :]
    if beams < 1 or len(ranges) != beams:
        raise ValueError("too few ranges")
    if beams in (400, 401):
        angle_min, increment = -math.radians(50.0), math.radians(0.25)
    else:
        angle_min = -0.5 * math.pi
        increment = math.pi / (beams if beams in (180, 360) else max(beams - 1, 1))
    laser_pose, robot_pose = _numbers(tail[:3], 3), _numbers(tail[3:6], 3)
    return _Scan(ranges, float(tail[6]), robot_pose, laser_pose, angle_min, increment, math.nan)


def _robotlaser(words: list[str]) -> _Scan:
    """Read the values of a robot-laser message.

    They are type, start, field of view, step, longest range, accuracy, mode, n, ranges, m, remissions,
    laser, robot, and what follows.

    These are five numbers on the drive, the stamp, the host and the logger's stamp.
    """
    start, _, increment, max_range = _numbers(words[2:6], 4)
    beams = int(words[8])
    ranges = [float(word) for word in words[9 : 9 + beams]]
    remissions = int(words[9 + beams])
    tail = words[10 + beams + remissions :]
    if beams < 1 or len(ranges) != beams:
        raise ValueError("too few ranges")
    return _Scan(
        ranges, float(tail[11]), _numbers(tail[3:6], 3), _numbers(tail[:3], 3), start, increment, max_range
    )


def _scans_of_most_beams(content: _Content) -> list[tuple[_Scan, int]]:
    """Return the scans of the most frequent geometry, and count others as skipped."""
    (beams, increment), _ = Counter(
        (len(scan.ranges), round(scan.increment, 9)) for scan, _ in content.scans
    ).most_common(1)[0]
    kept = [
        (scan, before)
        for scan, before in content.scans
        if (len(scan.ranges), round(scan.increment, 9)) == (beams, increment)
    ]
    if len(kept) < len(content.scans):
        content.skipped[f"scans that have not {beams} beams as most"] = len(content.scans) - len(kept)
    return kept


def _log(path: Path, content: _Content) -> LaserLog:
    kept = _scans_of_most_beams(content)
    first = kept[0][0]
    ranges = np.array([scan.ranges for scan, _ in kept], np.float32)
    highest = _max_range(ranges, first)
    ranges[~(ranges > 0.0)] = np.nan
    with np.errstate(invalid="ignore"):
        ranges[ranges >= highest * (1.0 - 1e-6)] = np.inf
    try:
        wide, geometry = symmetric_scans(ranges, first.angle_min, first.increment, (0.0, highest))
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error
    stamps = np.array([scan.stamp for scan, _ in kept], np.float64)
    robot_poses = np.array([scan.robot_pose for scan, _ in kept], np.float64)
    readings_stamps = np.array([stamp for _, stamp in content.odometry], np.float64)
    readings = np.array([pose for pose, _ in content.odometry], np.float64).reshape(-1, 3)
    before = np.array([before for _, before in kept], np.int64)
    if not content.is_corrected:
        return LaserLog(
            stamps,
            wide,
            geometry,
            robot_poses,
            _mounting(content, first),
            readings_stamps=readings_stamps,
            readings=readings,
            reading_of_scan=before - 1,
            skipped=dict(content.skipped),
        )
    chained, is_own = _chained(readings, np.array([before for _, before in content.scans], np.int64))
    if not _has_odometry(before, is_own):
        return LaserLog(
            stamps,
            wide,
            geometry,
            None,
            _mounting(content, first),
            corrected=robot_poses,
            skipped=dict(content.skipped),
        )
    return LaserLog(
        stamps,
        wide,
        geometry,
        chained[np.maximum(before - 1, 0)],
        _mounting(content, first),
        corrected=robot_poses,
        readings_stamps=readings_stamps[is_own],
        readings=chained[is_own],
        reading_of_scan=np.cumsum(np.append(0, is_own))[before] - 1,
        skipped=dict(content.skipped),
    )


def _has_odometry(before: NDArray[np.int64], is_own: NDArray[np.bool_]) -> bool:
    """Return whether most scans have odometry of their own since the one before.

    ``before`` ODOM lines came before each.
    """
    count = np.cumsum(np.append(0, is_own))[before]
    return bool(len(count) > 0 and count[-1] > 0 and (len(count) < 2 or (np.diff(count) > 0).mean() > 0.5))


def _chained(
    readings: NDArray[np.float64], scans_before: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return the sum of the motions between readings, and which are odometry.

    The first reading after a scan is the scan's pose.
    """
    is_own = np.ones(len(readings), np.bool_)
    is_own[scans_before[scans_before < len(readings)]] = False
    chained = np.zeros_like(readings)
    for k in range(1, len(readings)):
        chained[k] = (
            composed(chained[k - 1], relative(readings[k - 1], readings[k])) if is_own[k] else chained[k - 1]
        )
    return chained, is_own


def _max_range(ranges: NDArray[np.float32], first: _Scan) -> float:
    """Return the range that says that there was no return [m]."""
    if math.isfinite(first.max_range) and first.max_range > 0.0:
        return first.max_range
    known = ranges[np.isfinite(ranges)]
    highest = float(known.max()) if known.size and known.max() > 0.0 else 1.0
    return min(highest, SICK_MAX_M)


def _mounting(content: _Content, first: _Scan) -> NDArray[np.float64]:
    """Return the laser's pose on the robot.

    It is from the parameters, or, where the first scan's line has two poses, from them.
    """
    if "robot_frontlaser_offset" in content.parameters:
        return np.array([_parameter(content, "robot_frontlaser_offset", 0.0), 0.0, 0.0])
    return relative(np.array(first.robot_pose), np.array(first.laser_pose))


def _parameter(content: _Content, name: str, otherwise: float) -> float:
    try:
        value = float(content.parameters[name])
    except (KeyError, ValueError):
        return otherwise
    return value if math.isfinite(value) else otherwise
