"""Recorded scans with odometry: content of a log, and a format of our own.

A log is made fit for use.

The format is an npz archive with these arrays (times n, beams b), of which the first three have to be there:

========================  =========
======================================================================================= ranges
(n, b)     [m]; ``max_range`` or more, or inf: no return; nan: an invalid beam angle_min,                ()
direction of the first beam against the robot's heading, and from beam to beam [rad] angle_increment stamp
(n,)       when the last beam was taken [s] pose_odom                 (n, 3)     x, y, theta of dead reckoning
then [m, rad]; nan where unknown max_range, min_range      ()         [m] beam_interval             ()
time from beam to beam [s]; 0 for a scan taken at once laser_pose                (3,)       x, y, theta of the
laser on the robot [m, rad] pose_corrected            (n, 3)     poses that another program found, for
comparison only [m, rad] odometry_stamp            (m,)       when odometry was read, between scans too [s]
odometry_pose             (m, 3)     what it was [m, rad] odometry_of_scan          (n,)       number of the
last of these before each scan, -1 for none
========================  =========
=======================================================================================
"""

import io
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.files.guarded_arrays import read_arrays
from lidarium.mapping.files.guarded_reading import reading
from lidarium.mapping.files.output import write_whole
from lidarium.mapping.geometry.bounds import shown
from lidarium.mapping.grids.scan_geometry import MOST_BEAMS, ScanGeometry

MOST_REACH_M = 10_000.0
"""Longest range of a laser that a log may tell of [m]."""

MOST_POSE_M = 1e8
"""Farthest that a log may lead [m]."""

_NEEDED = ("ranges", "angle_min", "angle_increment")


@dataclass(frozen=True, slots=True, eq=False)
class LaserLog:
    """Recorded scans in the order of time.

    Attributes
    ----------
    stamps : (scans,) float64
        When the last beam was taken, never decreasing [s].
    ranges : (scans, beams) float32
        Scans [m]; inf for no return, nan for an invalid beam.
    geometry : ScanGeometry
        Which way the beams look.
    odometry : (scans, 3) float64 or None
        x, y, theta of the robot by dead reckoning [m, rad]; None where the log has none.
    laser_pose : (3,) float64
        x, y, theta of the laser on the robot [m, rad].
    beam_interval_s : float
        Time from beam to beam; 0 for a scan taken at once [s].
    corrected : (scans, 3) float64 or None
        Poses that another program found, for comparison only [m, rad].
    readings_stamps, readings : (readings,) and (readings, 3) float64
        When odometry was read, between scans too, and what it was [s, m, rad]; empty where the log has none
        of its own.
    reading_of_scan : (scans,) int64
        The last reading before each scan, -1 where there is none; empty where the log has no readings of its
        own.
    skipped : dict of str to int
        How many parts of the log were left out, by reason.
    """

    stamps: NDArray[np.float64]
    ranges: NDArray[np.float32]
    geometry: ScanGeometry
    odometry: NDArray[np.float64] | None
    laser_pose: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    beam_interval_s: float = 0.0
    corrected: NDArray[np.float64] | None = None
    readings_stamps: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    readings: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 3)))
    reading_of_scan: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    skipped: dict[str, int] = field(default_factory=dict)

    def limited(self, longest: float, clears_without_return: bool) -> "LaserLog":
        """Return the log with a laser that sees no farther than this [m].

        Parameters
        ----------
        longest : float
            Returns beyond it become beams without a return: the way there was free.
        clears_without_return : bool
            Whether a beam without return says so too; else it says nothing, as where glass or distance
            swallow it.
        """
        ranges = self.ranges.copy()
        if not clears_without_return:
            ranges[np.isinf(ranges)] = np.nan
        reach = min(longest, self.geometry.range_max)
        with np.errstate(invalid="ignore"):
            ranges[ranges > reach] = np.inf
        geometry = replace(
            self.geometry, range_max=reach, range_min=min(self.geometry.range_min, 0.5 * reach)
        )
        return replace(self, ranges=ranges, geometry=geometry)


def made_usable(log: LaserLog, where: str) -> LaserLog:
    """Return a log without unusable scans and odometry.

    Scans are dropped without any finite stamp or where stamps go back in time. Odometry is dropped where
    it contains no information.

    Where most stamps stand still or run backwards, the clock is useless, and scans are numbered by the second
    instead.

    Raises
    ------
    ValueError
        Where no scan is left.
    """
    for poses in (log.odometry, log.corrected, log.readings, log.laser_pose):
        if poses is not None and poses.size and not np.nanmax(np.abs(poses), initial=0.0) <= MOST_POSE_M:
            raise ValueError(f"{where} has poses beyond {MOST_POSE_M:,.0f} m; want metres and radians")
    stamps, skipped = log.stamps, dict(log.skipped)
    if len(stamps) > 2 and not (np.diff(stamps) > 0.0).mean() > 0.5:
        stamps = np.arange(len(stamps), dtype=np.float64)
        skipped["stamps of a clock that stands still or runs backwards: scans are numbered by the second"] = (
            len(stamps)
        )
        log = replace(
            log, readings_stamps=np.zeros(0), readings=np.zeros((0, 3)), reading_of_scan=np.zeros(0, np.int64)
        )
    known = np.where(np.isfinite(stamps), stamps, -np.inf)
    is_kept = np.isfinite(stamps) & (known >= np.maximum.accumulate(known))
    if not is_kept.all():
        skipped["scans back in time"] = int((~is_kept).sum())
    if not is_kept.any():
        raise ValueError(
            f"{where} holds no scan that can be used; want FLASER or ROBOTLASER1 lines, or an npz with "
            "ranges and stamps"
        )
    odometry = None if log.odometry is None else log.odometry[is_kept]
    if odometry is not None and (
        not np.isfinite(odometry).any() or not np.nanmax(np.ptp(odometry, axis=0)) > 0.0
    ):
        odometry = None
    corrected = None if log.corrected is None else log.corrected[is_kept]
    return replace(
        log,
        stamps=stamps[is_kept],
        ranges=log.ranges[is_kept],
        odometry=odometry,
        corrected=corrected,
        reading_of_scan=log.reading_of_scan[is_kept] if len(log.reading_of_scan) else log.reading_of_scan,
        skipped=skipped,
    )


def symmetric_scans(
    ranges: NDArray[np.float32], angle_min: float, increment: float, reach: tuple[float, float]
) -> tuple[NDArray[np.float32], ScanGeometry]:
    """Return scans symmetric about the heading, and their geometry.

    Invalid beams are added on one side.

    Parameters
    ----------
    ranges : (scans, beams) float32
        The scans [m].
    angle_min, increment : float
        Direction of the first beam against the heading, and from beam to beam [rad].
    reach : (float, float)
        Shortest and longest measured range [m].

    Raises
    ------
    ValueError
        Where the beams are not from right to left, within a circle.
    """
    beams = ranges.shape[1]
    if not (
        increment > 0.0 and beams * increment < 2.0 * math.pi + 1.5 * increment and math.isfinite(angle_min)
    ):
        raise ValueError(
            f"{beams} beams from {angle_min} rad in steps of {increment} rad; want steps of more than 0 "
            "within a circle"
        )
    if not abs(2.0 * angle_min / increment) + 2 * beams <= 2 * MOST_BEAMS or not reach[1] <= MOST_REACH_M:
        raise ValueError(
            f"{beams} beams from {angle_min} rad in steps of {increment} rad reach {reach[1]:g} m; want at "
            f"most {MOST_BEAMS:,} about the heading, and {MOST_REACH_M:,.0f} m"
        )
    if beams * increment > 2.0 * math.pi + 1e-6:
        # The last beam repeats the first.
        ranges, beams = ranges[:, :-1], beams - 1
    if abs(beams * increment - 2.0 * math.pi) < 1e-3 * increment:
        turned = round((angle_min + math.pi) / increment)
        return np.roll(ranges, turned, axis=1), ScanGeometry(
            beams=beams, field_of_view=2.0 * math.pi, range_min=reach[0], range_max=reach[1]
        )
    missing = round((2.0 * angle_min + (beams - 1) * increment) / increment)
    added = np.full((len(ranges), abs(missing)), np.nan, np.float32)
    wide = np.concatenate([added, ranges] if missing > 0 else [ranges, added], axis=1)
    view = (wide.shape[1] - 1) * increment
    if view > 2.0 * math.pi:
        raise ValueError(f"beams begin at {angle_min} rad; want beams about the heading")
    return wide, ScanGeometry(
        beams=wide.shape[1], field_of_view=view or 2.0 * math.pi, range_min=reach[0], range_max=reach[1]
    )


def read_npz_log(path: Path) -> LaserLog:
    """Read a log of our own format.

    Raises
    ------
    FileNotFoundError
        If it is not there.
    ValueError
        If it is no such file or holds no usable scan.
    """
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
    highest = _number(path, arrays, "max_range", _highest(ranges))
    ranges[ranges < 0.0] = np.nan
    with np.errstate(invalid="ignore"):
        ranges[ranges >= highest * (1.0 - 1e-6)] = np.inf
    first, increment = (
        _number(path, arrays, "angle_min", math.nan),
        _number(path, arrays, "angle_increment", math.nan),
    )
    try:
        wide, geometry = symmetric_scans(
            ranges, first, increment, (_number(path, arrays, "min_range", 0.0), highest)
        )
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error
    stamps = _table(path, arrays, "stamp", (scans,))
    readings_stamps = np.asarray(arrays.get("odometry_stamp", np.zeros(0)), np.float64)
    readings = _table(path, arrays, "odometry_pose", (len(readings_stamps), 3))
    laser_pose = _table(path, arrays, "laser_pose", (3,))
    return LaserLog(
        stamps=np.arange(scans, dtype=np.float64) if stamps is None else stamps,
        ranges=wide,
        geometry=geometry,
        odometry=_table(path, arrays, "pose_odom", (scans, 3)),
        laser_pose=np.zeros(3) if laser_pose is None else laser_pose,
        beam_interval_s=_number(path, arrays, "beam_interval", 0.0),
        corrected=_table(path, arrays, "pose_corrected", (scans, 3)),
        readings_stamps=readings_stamps if readings is not None else np.zeros(0),
        readings=readings if readings is not None else np.zeros((0, 3)),
        reading_of_scan=_readings_of_scans(path, arrays, scans, len(readings_stamps)),
    )


def _readings_of_scans(
    path: Path, arrays: Mapping[str, NDArray[Any]], scans: int, readings: int
) -> NDArray[np.int64]:
    table = _table(path, arrays, "odometry_of_scan", (scans,)) if readings else None
    if table is None:
        return np.zeros(0, np.int64)
    if not ((table >= -1) & (table < readings)).all():
        raise ValueError(
            f"{path}: odometry_of_scan is not within -1 and {readings - 1}, the numbers of odometry_stamp"
        )
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
    """Write a log in our own format, whole or not at all.

    Raises
    ------
    OSError
        Where nothing can be written there.
    """
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
    content = io.BytesIO()
    np.savez_compressed(content, **arrays)
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, content.getvalue())
