"""Logs of the CARMEN robot navigation toolkit: text, one message per line, plain or gzipped.

FLASER and ROBOTLASER1 (scans), ODOM (odometry) and PARAM (the pose of the laser) are read, and LASER_READING (scans)
of GMapping. The line of a scan has its odometry, too. GridFastSLAM, which is recognised by its NEFF lines, replaces it
in scans and in the first ODOM after each; in its logs odometry is the sum of the motions from ODOM to ODOM without
those first ones, and a scan has the stamp of the ODOM before it.

A header states the field of view, the step from beam to beam and the number of beams, two of which suffice.
If they contradict each other, the number of beams is certain, and the field of view is believed.
"""

import gzip
import math
import zlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.files.beams import (
    WHOLE_TURN,
    Beams,
    check_metres,
    from_right_to_left,
    marked,
    on_one_grid,
    symmetric_scans,
)
from lidarium.mapping.files.guarded_reading import read_lines, reading
from lidarium.mapping.files.laser_logs import LaserLog, made_usable
from lidarium.mapping.files.odometry_faults import axes_of
from lidarium.mapping.files.trajectories import interpolated
from lidarium.mapping.geometry.rigid import composed, relative

SICK_BEAMS = {
    101: (100.0, 1.0),
    180: (180.0, 1.0),
    181: (180.0, 1.0),
    201: (100.0, 0.5),
    360: (180.0, 0.5),
    361: (180.0, 0.5),
    400: (100.0, 0.25),
    401: (100.0, 0.25),
}
"""Field of view and step [degrees] of a SICK LMS by its number of beams."""


@dataclass(frozen=True, slots=True)
class _FieldOfView:
    """Statements on a laser whose scans have no angles.

    Attributes
    ----------
    wanted : float or None
        Field of view that the user gives [rad].
    stated, step : float or None
        Field of view and step by the parameters of the log [rad].
    """

    wanted: float | None = None
    stated: float | None = None
    step: float | None = None

    def beams(self, count: int) -> Beams:
        """Return the directions of a number of beams: the user's, the log's, a SICK's, or half a turn."""
        if self.wanted is not None:
            return _spread(self.wanted, count)
        if self.stated is not None and self.step is not None and _agrees(self.stated, self.step, count):
            return Beams(-0.5 * self.stated, self.step)
        if count in SICK_BEAMS:
            view, step = (math.radians(angle) for angle in SICK_BEAMS[count])
            return Beams(-0.5 * view, step)
        if self.stated is not None:
            return _spread(self.stated, count)
        return _spread(
            math.pi,
            count,
            f"scans of {count} beams, as no SICK has, without a field of view: 180 degrees are assumed; "
            "--field-of-view says another",
        )


def _stated_beams(start: float, view: float, step: float, count: int) -> Beams:
    """Return the directions that a header states.

    Parameters
    ----------
    start, view, step : float
        Direction of the first beam, field of view, and angle from beam to beam [rad]; negative steps are
        those of a laser that is mounted upside down.
    """
    if view == 0.0 or abs(view) > 1.01 * WHOLE_TURN or _agrees(abs(view), abs(step), count):
        return Beams(start, step)
    is_circle = abs(abs(view) - WHOLE_TURN) < 1e-3
    size = abs(view) / (count if is_circle else max(count - 1, 1))
    return Beams(
        start,
        math.copysign(size, view),
        f"steps of {step:g} rad contradict {count} beams over {view:g} rad: {size:.6g} rad are assumed",
    )


def _agrees(view: float, step: float, count: int) -> bool:
    """Return whether a number of beams at a step cover a field of view, its last beam counted or not."""
    return step > 0.0 and abs((count - 0.5) * step - view) < step


def _spread(view: float, count: int, remark: str = "") -> Beams:
    return Beams(-0.5 * view, view / max(count - 1, 1), remark)


_QUIET = (
    *("#", "NEFF", "PARAM", "SYNC", "MARKER", "RLASER", "REMISSION", "TRUEPOS"),
    *("ODO_UPDATE", "SM_UPDATE", "FRAME", "RESAMPLE"),
)
"""Messages that hold nothing that is needed here."""


@dataclass(slots=True, eq=False)
class _Scan:
    """A line with a scan; without beams if the line has no angles."""

    ranges: list[float] | NDArray[np.float32]
    stamp: float
    robot_pose: list[float]
    laser_pose: list[float]
    beams: Beams | None
    max_range: float
    has_angles: bool = True
    is_raw: bool = False
    """Whether its odometry is as measured also in a log of GridFastSLAM."""


@dataclass(slots=True, eq=False)
class _Content:
    """The content of the lines of a log.

    A scan comes with the number of ODOM lines before it. `is_in_time`: whether beams are in the order of time.
    """

    scans: list[tuple[_Scan, int]] = field(default_factory=list)
    odometry: list[tuple[list[float], float]] = field(default_factory=list)
    parameters: dict[str, str] = field(default_factory=dict)
    is_corrected: bool = False
    is_in_time: bool = True
    skipped: Counter[str] = field(default_factory=Counter)
    remarks: Counter[str] = field(default_factory=Counter)


def _read_line(line: str, content: _Content) -> None:
    """Add the content of a line to the content; a damaged line is counted."""
    words = line.split()
    if not words or words[0].startswith("#"):
        return
    try:
        match words[0]:
            case "FLASER":
                content.scans.append((_flaser(words), len(content.odometry)))
            case "ROBOTLASER1":
                content.scans.append((_robotlaser(words), len(content.odometry)))
            case "LASER_READING":
                content.scans.append((_laser_reading(words), len(content.odometry)))
            case "ODOM":
                content.odometry.append((_numbers(words[1:4], 3), float(words[7] if len(words) > 9 else words[-1])))
            case "PARAM" if len(words) > 2:
                content.parameters[words[1]] = words[2]
            case "NEFF":
                content.is_corrected = True
            case kind if kind not in _QUIET:
                content.skipped[f"{kind[:30]} lines"] += 1
    except (ValueError, IndexError, OverflowError):
        content.skipped[f"damaged {words[0]} lines"] += 1


def _numbers(words: list[str], count: int) -> list[float]:
    values = list(map(float, words))
    if len(values) != count or not all(map(math.isfinite, values)):
        raise ValueError(f"{words} are not {count} numbers")
    return values


def _flaser(words: list[str]) -> _Scan:
    """Read a ``FLASER`` line, of which old logs lack the last two values.

    It is ``FLASER n ranges laser_pose robot_pose stamp host logger_stamp``. Some programs write the number of
    remissions behind the ranges, and the remissions, as in ``ROBOTLASER1``: poses and stamp end at the host.
    """
    ranges, tail = _ranges(words)
    host = next((k for k, word in enumerate(tail) if not _is_number(word)), len(tail))
    if host > 7 and tail[0].isdigit() and host == 8 + int(tail[0]):
        tail = tail[1 + int(tail[0]) :]
    laser_pose, robot_pose = _numbers(tail[:3], 3), _numbers(tail[3:6], 3)
    return _Scan(ranges, float(tail[6]), robot_pose, laser_pose, None, math.nan, has_angles=False)


def _laser_reading(words: list[str]) -> _Scan:
    """Read a line of GMapping: ``LASER_READING n ranges x y theta stamp``, the pose by odometry."""
    ranges, tail = _ranges(words)
    pose = _numbers(tail[:3], 3)
    return _Scan(ranges, float(tail[3]), pose, pose, None, math.nan, has_angles=False, is_raw=True)


def _ranges(words: list[str]) -> tuple[list[float], list[str]]:
    """Return the ranges, whose number is the second word, and the words behind them."""
    beams = int(words[1])
    ranges = list(map(float, words[2 : 2 + beams]))
    if beams < 1 or len(ranges) != beams:
        raise ValueError("too few ranges")
    return ranges, words[2 + beams :]


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _robotlaser(words: list[str]) -> _Scan:
    """Read the values of a robot-laser message.

    They are type, start, field of view, step, longest range, accuracy, mode, n, ranges, m, remissions, laser,
    robot, and the rest.

    These are five numbers on the drive, the stamp, the host and the logger's stamp.
    """
    start, view, step, max_range = _numbers(words[2:6], 4)
    beams = int(words[8])
    ranges = list(map(float, words[9 : 9 + beams]))
    remissions = int(words[9 + beams])
    tail = words[10 + beams + remissions :]
    if beams < 1 or len(ranges) != beams:
        raise ValueError("too few ranges")
    directions = _stated_beams(start, view, step, beams)
    laser_pose, robot_pose = _numbers(tail[:3], 3), _numbers(tail[3:6], 3)
    return _Scan(ranges, float(tail[11]), robot_pose, laser_pose, directions, max_range)


def _parameter(content: _Content, name: str) -> float | None:
    """Return a parameter of the log; None if it has none, or no number."""
    try:
        value = float(content.parameters[name])
    except (KeyError, ValueError):
        return None
    return value if math.isfinite(value) else None


SICK_MAX_M = 80.0
"""From this range on, a SICK LMS reports the absence of a return [m]."""


def _drop_repeated(content: _Content) -> None:
    """Leave out lines without directions that repeat a ROBOTLASER1 line: a logger wrote each scan both ways."""

    def told_at(scan: _Scan) -> int | None:
        return round(scan.stamp / SAME_STAMP_S) if math.isfinite(scan.stamp) else None

    told = {told_at(scan) for scan, _ in content.scans if scan.has_angles} - {None}
    kept = [(scan, before) for scan, before in content.scans if scan.has_angles or told_at(scan) not in told]
    if len(kept) < len(content.scans):
        content.skipped["FLASER lines that repeat ROBOTLASER1 lines"] = len(content.scans) - len(kept)
        content.scans = kept


def _give_directions(content: _Content, field_of_view: float | None) -> None:
    """Give each scan the directions of its beams, from right to left."""
    fov, step = (_parameter(content, f"laser_front_laser_{name}") for name in ("fov", "resolution"))
    view = _FieldOfView(
        field_of_view,
        None if fov is None or not 0.0 < fov <= 360.0 else math.radians(fov),
        None if step is None else math.radians(step),
    )
    assumed = cache(view.beams)
    for scan, _ in content.scans:
        stated = scan.beams or assumed(len(scan.ranges))
        ranges, beams = from_right_to_left(np.array(scan.ranges, np.float32), stated)
        content.is_in_time &= stated.increment > 0.0
        scan.ranges, scan.beams = ranges, beams._replace(remark="")
        for remark in {stated.remark, beams.remark} - {""}:
            content.remarks[remark] += 1


def _on_one_grid(content: _Content) -> tuple[list[tuple[_Scan, int]], Beams, NDArray[np.float32], float]:
    """Return the scans that are kept, the directions of their beams, their ranges, and the longest one.

    Scans whose own line has other directions are resampled; a scan without any that has fewer beams than most is
    damaged.
    """
    count = Counter(len(scan.ranges) for scan, _ in content.scans).most_common(1)[0][0]
    kept = [each for each in content.scans if len(each[0].ranges) == count or each[0].has_angles]
    if len(kept) < len(content.scans):
        content.skipped[f"scans that have not {count} beams as most"] = len(content.scans) - len(kept)
    highest = _max_range(kept)
    scans = [marked(np.array(scan.ranges, np.float32), 0.0, highest) for scan, _ in kept]
    ranges, beams, others = on_one_grid(scans, [scan.beams for scan, _ in kept if scan.beams is not None])
    if others:
        content.is_in_time = False
        content.remarks[f"scans whose beams are not {ranges.shape[1]} as of most are resampled"] = others
    return kept, beams, ranges, highest


def _max_range(scans: list[tuple[_Scan, int]]) -> float:
    """Return the range that means no return [m]."""
    first = scans[0][0]
    if math.isfinite(first.max_range) and first.max_range > 0.0:
        return first.max_range
    known = np.concatenate([scan.ranges for scan, _ in scans]).astype(np.float32)
    known = known[np.isfinite(known)]
    highest = float(known.max()) if known.size and known.max() > 0.0 else 1.0
    return min(highest, SICK_MAX_M)


REPEATED_M = 1e-4
"""By how much a pose and its copy in another line may differ, in metres and radians."""

SAME_STAMP_S = 1e-6

MAX_LINE_BYTES = 1 << 20
"""Longest line of a log; one of 16,384 ranges has some 150,000 bytes."""


def read_carmen_log(path: Path, field_of_view: float | None = None) -> LaserLog:
    """Read a log.

    Parameters
    ----------
    field_of_view : float or None
        Angle between the first and the last beam of FLASER lines [rad], which carry none; else that of the
        log's parameters, or of a SICK with a number of beams.
    """
    path = Path(path)
    content = _Content()
    with reading(path, "a CARMEN log"):
        for line in _lines(path, content.skipped):
            _read_line(line, content)
        if not content.scans:
            raise ValueError(f"{path} holds no scans; want a CARMEN log with FLASER or ROBOTLASER1 lines")
        _drop_repeated(content)
        check_metres(np.concatenate([scan.ranges for scan, _ in content.scans]).astype(np.float32), str(path))
        if field_of_view is not None and all(scan.beams for scan, _ in content.scans):
            raise ValueError(
                f"{path} states the directions of all its beams (ROBOTLASER1), and field_of_view is "
                f"{field_of_view:.4g} rad; leave it out"
            )
        _give_directions(content, field_of_view)
        return made_usable(_log(path, content), str(path))


def _lines(path: Path, skipped: Counter[str]) -> Iterator[str]:
    """Yield the lines of a file; if it is cut off or damaged, those before."""
    try:
        yield from read_lines(path, MAX_LINE_BYTES)
    except (EOFError, zlib.error, gzip.BadGzipFile):
        skipped["rest of a file that is cut off or damaged"] += 1


def _log(path: Path, content: _Content) -> LaserLog:
    kept, beams, ranges, highest = _on_one_grid(content)
    try:
        sweep = symmetric_scans(ranges, beams.angle_min, beams.increment, (0.0, highest))
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error
    stamps = np.array([scan.stamp for scan, _ in kept], np.float64)
    robot_poses = np.array([scan.robot_pose for scan, _ in kept], np.float64)
    laser_pose = _mounting(content, kept[0][0], robot_poses) + np.array([0.0, 0.0, sweep.axis])
    readings_stamps = np.array([stamp for _, stamp in content.odometry], np.float64)
    readings = np.array([pose for pose, _ in content.odometry], np.float64).reshape(-1, 3)
    before = np.array([before for _, before in kept], np.int64)
    log = LaserLog(
        stamps,
        sweep.ranges,
        sweep.geometry,
        robot_poses,
        laser_pose,
        beams_behind=sweep.behind,
        is_in_time=content.is_in_time and not sweep.is_rolled,
        skipped=dict(content.skipped),
        remarks=tuple(f"{number} x {what}" for what, number in content.remarks.items()),
    )
    if not content.is_corrected or kept[0][0].is_raw:
        return replace(log, readings_stamps=readings_stamps, readings=readings, reading_of_scan=before - 1)
    log = replace(log, odometry=None, corrected=robot_poses)
    chained, is_own = _chained(readings, content.scans)
    if not _has_odometry(before, is_own):
        return log
    return replace(
        log,
        odometry=_at_scans(stamps, before, readings_stamps, chained, is_own),
        readings_stamps=readings_stamps[is_own],
        readings=chained[is_own],
        reading_of_scan=np.cumsum(np.append(0, is_own))[before] - 1,
    )


def _has_odometry(before: NDArray[np.int64], is_own: NDArray[np.bool_]) -> bool:
    """Return whether most scans have odometry of their own since the one before.

    ``before`` ODOM lines came before each.
    """
    count = np.cumsum(np.append(0, is_own))[before]
    return bool(len(count) > 0 and count[-1] > 0 and (len(count) < 2 or (np.diff(count) > 0).mean() > 0.5))


def _chained(
    readings: NDArray[np.float64], scans: list[tuple[_Scan, int]]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return the sum of the motions between readings, and which are odometry.

    The first reading after a scan is the scan's pose, from which odometry goes on; if that line is missing, the
    scan's own stands for it.
    """
    is_own, previous = np.ones(len(readings), np.bool_), readings[np.maximum(np.arange(len(readings)) - 1, 0)]
    for scan, before in scans:
        if before < len(readings):
            is_own[before] = np.abs(readings[before] - scan.robot_pose).max() >= REPEATED_M
            previous[before] = scan.robot_pose
    chained = np.zeros_like(readings)
    for k in range(1, len(readings)):
        chained[k] = composed(chained[k - 1], relative(previous[k], readings[k])) if is_own[k] else chained[k - 1]
    return chained, is_own


def _at_scans(
    stamps: NDArray[np.float64],
    before: NDArray[np.int64],
    readings_stamps: NDArray[np.float64],
    chained: NDArray[np.float64],
    is_own: NDArray[np.bool_],
) -> NDArray[np.float64]:
    """Return the odometry of scans (n,), of which ``before`` readings came before each, (n, 3) [m, rad].

    A scan has the stamp of the reading before it. If that line is missing, odometry is interpolated.
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


def _mounting(content: _Content, first: _Scan, robot_poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the laser's pose on the robot.

    It is from the parameters, or, if the first scan's line has two poses, from them, in the axes that all poses of the
    robot show.
    """
    if "robot_frontlaser_offset" in content.parameters:
        return np.array([_parameter(content, "robot_frontlaser_offset") or 0.0, 0.0, 0.0])
    poses, axes = np.array([first.robot_pose, first.laser_pose], np.float64), axes_of(robot_poses)
    robot, laser = poses if axes is None else axes.corrected(poses)
    return relative(robot, laser)
