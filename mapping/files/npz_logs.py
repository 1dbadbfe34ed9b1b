"""Logs of our own format.

It is an npz archive with these arrays (times n, beams b), of which the first three have to be there:

- ``ranges`` (n, b): [m]; ``max_range`` or more, or inf: no return; nan: an invalid beam;
- ``angle_min`` (), ``angle_increment`` (): direction of the first beam against the heading, and from beam to
  beam [rad];
- ``stamp`` (n,): when the last beam was taken [s];
- ``pose_odom`` (n, 3): x, y, theta of dead reckoning then, nan if unknown [m, rad];
- ``max_range`` (), ``min_range`` (): [m];
- ``beam_interval`` (): time from beam to beam, 0 for a scan taken at once [s];
- ``laser_pose`` (3,): x, y, theta of the laser on the robot [m, rad];
- ``pose_corrected`` (n, 3): poses that another program found, for comparison only [m, rad];
- ``odometry_stamp`` (m,), ``odometry_pose`` (m, 3): when odometry was read, between scans too, and what it
  was [s, m, rad];
- ``odometry_of_scan`` (n,): number of the last of these before each scan, -1 for none.
"""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.files.beams import check_metres, marked, symmetric_scans
from lidarium.mapping.files.guarded_reading import read_arrays, reading
from lidarium.mapping.files.laser_logs import LaserLog, made_usable
from lidarium.mapping.files.output import write_arrays
from lidarium.mapping.geometry.bounds import shown

_NEEDED = ("ranges", "angle_min", "angle_increment")


def read_npz_log(path: Path) -> LaserLog:
    """Read a log of our own format."""
    path = Path(path)
    arrays = read_arrays(path, "an npz file that can be read")
    if not isinstance(arrays, dict):
        raise ValueError(f"{path} is not an npz file; want the archive of arrays that numpy writes")
    missing = [key for key in _NEEDED if key not in arrays]
    if missing:
        raise ValueError(f"{path} has no array {', '.join(missing)}; a log has {', '.join(_NEEDED)}")
    with reading(path, "a log"):
        return made_usable(_from_arrays(path, arrays), str(path))


def _from_arrays(path: Path, arrays: Mapping[str, NDArray[Any]]) -> LaserLog:
    ranges = np.array(arrays["ranges"], np.float32)
    if ranges.ndim != 2 or ranges.shape[1] == 0:
        raise ValueError(f"{path}: ranges have shape {ranges.shape}; want (scans, beams)")
    scans = len(ranges)
    check_metres(ranges, str(path))
    least, highest = _number(path, arrays, "min_range", 0.0), _number(path, arrays, "max_range", _highest(ranges))
    first, increment = (
        _number(path, arrays, "angle_min", math.nan),
        _number(path, arrays, "angle_increment", math.nan),
    )
    try:
        sweep = symmetric_scans(marked(ranges, least, highest), first, increment, (least, highest))
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error
    stamps = _table(path, arrays, "stamp", (scans,))
    readings_stamps = np.asarray(arrays.get("odometry_stamp", np.zeros(0)), np.float64)
    readings = _table(path, arrays, "odometry_pose", (len(readings_stamps), 3))
    laser_pose = _table(path, arrays, "laser_pose", (3,))
    if laser_pose is not None and not np.isfinite(laser_pose).all():
        raise ValueError(f"{path}: laser_pose is {laser_pose.tolist()}; want x, y, theta, all finite")
    return LaserLog(
        stamps=np.arange(scans, dtype=np.float64) if stamps is None else stamps,
        ranges=sweep.ranges,
        geometry=sweep.geometry,
        odometry=_table(path, arrays, "pose_odom", (scans, 3)),
        laser_pose=(np.zeros(3) if laser_pose is None else laser_pose) + np.array([0.0, 0.0, sweep.axis]),
        beam_interval_s=_number(path, arrays, "beam_interval", 0.0),
        beams_behind=sweep.behind,
        is_in_time=not sweep.is_rolled,
        corrected=_table(path, arrays, "pose_corrected", (scans, 3)),
        readings_stamps=readings_stamps if readings is not None else np.zeros(0),
        readings=readings if readings is not None else np.zeros((0, 3)),
        reading_of_scan=_readings_of_scans(path, arrays, scans, len(readings_stamps)),
    )


def _readings_of_scans(path: Path, arrays: Mapping[str, NDArray[Any]], scans: int, readings: int) -> NDArray[np.int64]:
    table = _table(path, arrays, "odometry_of_scan", (scans,)) if readings else None
    if table is None:
        return np.zeros(0, np.int64)
    if not ((table >= -1) & (table < readings)).all():
        raise ValueError(f"{path}: odometry_of_scan is not within -1 and {readings - 1}, the numbers of odometry_stamp")
    return table.astype(np.int64)


def _highest(ranges: NDArray[np.float32]) -> float:
    known = ranges[np.isfinite(ranges)]
    return float(known.max()) if known.size and known.max() > 0.0 else 1.0


def _number(path: Path, arrays: Mapping[str, NDArray[Any]], key: str, otherwise: float) -> float:
    if key not in arrays:
        return otherwise
    try:
        value = float(arrays[key])
    except (TypeError, ValueError):
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f"{path}: {key} is {shown(arrays[key])}; want a number")
    return value


def _table(
    path: Path, arrays: Mapping[str, NDArray[Any]], key: str, shape: tuple[int, ...]
) -> NDArray[np.float64] | None:
    if key not in arrays:
        return None
    try:
        values = np.array(arrays[key], np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{path}: {key} are no numbers") from error
    if values.shape != shape:
        raise ValueError(f"{path}: {key} has shape {values.shape}; want {shape}")
    return values


def write_npz_log(path: Path, log: LaserLog) -> None:
    """Write a log in our own format, whole or not at all."""
    geometry = log.geometry
    arrays: dict[str, Any] = {
        "ranges": log.ranges,
        "stamp": log.stamps,
        "angle_min": geometry.angle_first,
        "angle_increment": geometry.angle_increment,
        "min_range": geometry.range_min,
        "max_range": geometry.range_max,
        "laser_pose": log.laser_pose,
        "beam_interval": log.beam_interval_s,
        "odometry_stamp": log.readings_stamps,
        "odometry_pose": log.readings,
    }
    if len(log.reading_of_scan):
        arrays["odometry_of_scan"] = log.reading_of_scan
    if log.odometry is not None:
        arrays["pose_odom"] = log.odometry
    if log.corrected is not None:
        arrays["pose_corrected"] = log.corrected
    write_arrays(path, arrays)
