"""Recorded scans with odometry: what a log holds, made fit for use."""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.files.mending.clocks import continued
from lidarium.mapping.files.mending.odometry_jumps import without_jumps
from lidarium.mapping.grids.scan_geometry import MAX_BEAMS, ScanGeometry

MOST_REACH_M = 10_000.0
"""Longest range of a laser that a log may have [m]."""

MOST_POSE_M = 1e8
"""Farthest that a log may lead [m]."""

CIRCLE_BEAMS = 0.4
"""Beams that miss a whole turn by less than so many steps cover it: headers round the step."""


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
        Directions of the beams.
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
    remarks : tuple of str
        What of the log was not believed, and what was assumed instead.
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
    remarks: tuple[str, ...] = ()

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

    Scans are dropped without any finite stamp or where stamps go back in time; a clock that restarts is
    continued. Odometry is dropped where it contains no information, and its jumps are taken out.

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
    stamps, skipped, remarks = log.stamps, dict(log.skipped), list(log.remarks)
    if len(stamps) > 2 and not (np.diff(stamps) > 0.0).mean() > 0.5:
        stamps = np.arange(len(stamps), dtype=np.float64)
        skipped["stamps of a clock that stands still or runs backwards: scans are numbered by the second"] = (
            len(stamps)
        )
        log = _without_readings(log)
    clock = continued(stamps)
    if len(clock.kept) < len(stamps):
        skipped["scans back in time"] = len(stamps) - len(clock.kept)
    if not len(clock.kept):
        raise ValueError(
            f"{where} holds no scan that can be used; want FLASER or ROBOTLASER1 lines, or an npz with "
            "ranges and stamps"
        )
    if clock.restarts:
        remarks.append(f"the clock restarts {clock.restarts} times; stamps are continued")
        log = _without_readings(log)
    odometry = None if log.odometry is None else log.odometry[clock.kept]
    if odometry is not None and (
        not np.isfinite(odometry).any() or not np.nanmax(np.ptp(odometry, axis=0)) > 0.0
    ):
        odometry = None
    if odometry is not None:
        odometry, jumps = without_jumps(odometry, clock.stamps)
        if jumps:
            remarks.append(f"odometry jumps {jumps} times as no robot moves; the jumps are taken out")
    return replace(
        log,
        stamps=clock.stamps,
        ranges=log.ranges[clock.kept],
        odometry=odometry,
        corrected=None if log.corrected is None else log.corrected[clock.kept],
        reading_of_scan=log.reading_of_scan[clock.kept] if len(log.reading_of_scan) else log.reading_of_scan,
        skipped=skipped,
        remarks=tuple(remarks),
    )


def _without_readings(log: LaserLog) -> LaserLog:
    """Return a log without the readings between its scans, whose stamps are of no use."""
    return replace(
        log, readings_stamps=np.zeros(0), readings=np.zeros((0, 3)), reading_of_scan=np.zeros(0, np.int64)
    )


def symmetric_scans(
    ranges: NDArray[np.float32], angle_min: float, increment: float, reach: tuple[float, float]
) -> tuple[NDArray[np.float32], ScanGeometry, float]:
    """Return scans symmetric about the laser's axis, their geometry, and that axis.

    Invalid beams are added on one side. The axis is within half a beam of the heading, by which beams that
    are not symmetric about the heading are turned: it belongs to the laser's pose on the robot.

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
    if not abs(2.0 * angle_min / increment) + 2 * beams <= 2 * MAX_BEAMS or not reach[1] <= MOST_REACH_M:
        raise ValueError(
            f"{beams} beams from {angle_min} rad in steps of {increment} rad reach {reach[1]:g} m; want at "
            f"most {MAX_BEAMS:,} about the heading, and {MOST_REACH_M:,.0f} m"
        )
    whole = 2.0 * math.pi
    if abs((beams - 1) * increment - whole) < CIRCLE_BEAMS * increment:
        # The last beam repeats the first.
        ranges, beams = ranges[:, :-1], beams - 1
    if abs(beams * increment - whole) < CIRCLE_BEAMS * increment:
        increment = whole / beams
        turned = round((angle_min + math.pi) / increment)
        geometry = ScanGeometry(beams=beams, field_of_view=whole, range_min=reach[0], range_max=reach[1])
        return (
            np.roll(ranges, turned, axis=1),
            geometry,
            _axis(angle_min + math.pi - turned * increment, increment),
        )
    missing = round((2.0 * angle_min + (beams - 1) * increment) / increment)
    added = np.full((len(ranges), abs(missing)), np.nan, np.float32)
    wide = np.concatenate([added, ranges] if missing > 0 else [ranges, added], axis=1)
    view = (wide.shape[1] - 1) * increment
    if view > whole:
        raise ValueError(f"beams begin at {angle_min} rad; want beams about the heading")
    geometry = ScanGeometry(
        beams=wide.shape[1], field_of_view=view or whole, range_min=reach[0], range_max=reach[1]
    )
    first = angle_min - max(missing, 0) * increment
    return wide, geometry, _axis(first + 0.5 * view, increment)


def _axis(angle: float, increment: float) -> float:
    """Return the angle of the laser's axis [rad]; 0 where it is a rounded zero."""
    return angle if abs(angle) > 1e-2 * increment else 0.0
