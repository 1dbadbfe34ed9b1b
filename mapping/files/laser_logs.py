"""Recorded laser scans with odometry: the log, and the repair of clocks and odometry that jump."""

import math
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import composed, relative
from lidarium.mapping.grids.scan_geometry import MAX_BEAMS, ScanGeometry

FEW = 5
"""Number of scans in a row that may have wild stamps; if more run backwards the clock has restarted."""


class _Clock(NamedTuple):
    """Stamps that never decrease.

    Attributes
    ----------
    stamps : (kept,) float64
        Of the scans that are kept [s].
    kept : (kept,) int64
        Which these are.
    restarts : int
        How often the clock has restarted; the stamps after it follow those before by the median period.
    """

    stamps: NDArray[np.float64]
    kept: NDArray[np.int64]
    restarts: int


def _continued(stamps: NDArray[np.float64]) -> _Clock:
    """Return stamps in the order of the log.

    A stamp that is before its predecessor is wild itself if those after it go on after the predecessor. The
    predecessors are wild if they are few and those before them are earlier. Otherwise the clock has restarted
    there.

    Parameters
    ----------
    stamps : (n,) float64
        As they were recorded [s]; not finite if there is none.
    """
    finite = stamps[np.isfinite(stamps)]
    steps = np.diff(finite)
    period = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 1.0
    runs: list[list[int]] = [[]]
    for k in np.flatnonzero(np.isfinite(stamps)).tolist():
        run = runs[-1]
        if run and stamps[k] < stamps[run[-1]]:
            if _go_on_after(stamps, k, run[-1]):
                continue
            late = sum(stamps[j] > stamps[k] for j in run[-FEW - 1 :])
            if late <= FEW:
                del run[-late:]
            else:
                runs.append(run := [])
        run.append(k)
    kept = np.array([k for run in runs for k in run], np.int64)
    found = stamps[kept].astype(np.float64)
    for first in np.cumsum([len(run) for run in runs])[:-1].tolist():
        found[first:] += found[first - 1] + period - found[first]
    return _Clock(found, kept, len(runs) - 1)


def _go_on_after(stamps: NDArray[np.float64], k: int, last: int) -> bool:
    """Whether most of the few stamps that follow k are not before that of the last kept scan."""
    ahead = stamps[k + 1 : k + 1 + FEW]
    ahead = ahead[np.isfinite(ahead)]
    return len(ahead) == 0 or bool(np.median(ahead) >= stamps[last])


FASTEST_M_S, FASTEST_TURN = 3.0, 4.0
"""Speeds that an indoor robot reaches [m/s, rad/s]; higher speeds may still be usual in a log."""

USUAL = 3.0
"""Factor by which the speed may exceed that which 95 % of a log's motions keep below is still believed."""


def _without_jumps(odometry: NDArray[np.float64], stamps: NDArray[np.float64]) -> tuple[NDArray[np.float64], int]:
    """Return odometry without its jumps, and their number.

    Over a jump the robot is assumed to have moved as before it.

    Parameters
    ----------
    odometry : (n, 3) float64
        x, y, theta by dead reckoning [m, rad]; not finite if unknown.
    stamps : (n,) float64
        When, never decreasing [s].
    """
    if len(odometry) < 4 or not np.isfinite(odometry).all():
        return odometry, 0
    motions = relative(odometry[:-1], odometry[1:])
    steps = np.diff(stamps)
    # Stamps of scans that came in a bundle say nothing of the speed between them.
    steps = np.maximum(steps, np.median(steps))
    if not steps.all():
        return odometry, 0
    jumps = _beyond(np.hypot(motions[:, 0], motions[:, 1]) / steps, FASTEST_M_S) | _beyond(
        np.abs(motions[:, 2]) / steps, FASTEST_TURN
    )
    if not jumps.any():
        return odometry, 0
    mended = odometry.copy()
    for k, motion in enumerate(motions):
        if jumps[k]:
            motion = motions[k] = motions[k - 1] * (steps[k] / steps[k - 1]) if k else np.zeros(3)
        mended[k + 1] = composed(mended[k], motion)
    return mended, int(jumps.sum())


def _beyond(speeds: NDArray[np.float64], fastest: float) -> NDArray[np.bool_]:
    return np.asarray(speeds > max(fastest, USUAL * float(np.percentile(speeds, 95.0))))


MAX_REACH_M = 10_000.0
"""Longest range of a laser that a log may have [m]."""

MAX_POSE_M = 1e8
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
        x, y, theta of the robot by dead reckoning [m, rad]; None if the log has none.
    laser_pose : (3,) float64
        x, y, theta of the laser on the robot [m, rad].
    beam_interval_s : float
        Time from beam to beam; 0 for a scan taken at once [s].
    corrected : (scans, 3) float64 or None
        Poses that another program found, for comparison only [m, rad].
    readings_stamps, readings : (readings,) and (readings, 3) float64
        When odometry was read, between scans too, and what it was [s, m, rad]; empty if the log has none
        of its own.
    reading_of_scan : (scans,) int64
        The last reading before each scan, -1 if there is none; empty if the log has no readings of its
        own.
    skipped : dict of str to int
        Number of parts of the log were left out, by reason.
    remarks : tuple of str
        Parts of the log that were ignored, and the assumptions made instead.
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
        """Return the log with a laser that sees no farther than this [m]."""
        ranges = self.ranges.copy()
        if not clears_without_return:
            ranges[np.isinf(ranges)] = np.nan
        reach = min(longest, self.geometry.range_max)
        with np.errstate(invalid="ignore"):
            ranges[ranges > reach] = np.inf
        geometry = replace(self.geometry, range_max=reach, range_min=min(self.geometry.range_min, 0.5 * reach))
        return replace(self, ranges=ranges, geometry=geometry)


def made_usable(log: LaserLog, where: str) -> LaserLog:
    """Return a log without unusable scans and odometry.

    Scans are dropped without any finite stamp or if stamps go back in time; a clock that restarts is continued.
    Odometry is dropped if it contains no information, and its jumps are taken out.

    If most stamps stand still or run backwards, the clock is useless, and scans are numbered by the second instead.
    """
    for poses in (log.odometry, log.corrected, log.readings, log.laser_pose):
        if poses is not None and poses.size and not np.nanmax(np.abs(poses), initial=0.0) <= MAX_POSE_M:
            raise ValueError(f"{where} has poses beyond {MAX_POSE_M:,.0f} m; want metres and radians")
    stamps, skipped, remarks = log.stamps, dict(log.skipped), list(log.remarks)
    if len(stamps) > 2 and not (np.diff(stamps) > 0.0).mean() > 0.5:
        stamps = np.arange(len(stamps), dtype=np.float64)
        skipped["stamps of a clock that stands still or runs backwards: scans are numbered by the second"] = len(stamps)
        log = _without_readings(log)
    clock = _continued(stamps)
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
    if odometry is not None and (not np.isfinite(odometry).any() or not np.nanmax(np.ptp(odometry, axis=0)) > 0.0):
        odometry = None
    if odometry is not None:
        odometry, jumps = _without_jumps(odometry, clock.stamps)
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
    return replace(log, readings_stamps=np.zeros(0), readings=np.zeros((0, 3)), reading_of_scan=np.zeros(0, np.int64))


def symmetric_scans(
    ranges: NDArray[np.float32], angle_min: float, increment: float, reach: tuple[float, float]
) -> tuple[NDArray[np.float32], ScanGeometry, float]:
    """Return scans symmetric about the laser's axis, their geometry, and that axis.

    Invalid beams are added on one side. The axis is within half a beam of the heading, by which beams that are not
    symmetric about the heading are turned: it belongs to the laser's pose on the robot.

    Parameters
    ----------
    ranges : (scans, beams) float32
        The scans [m].
    angle_min, increment : float
        Direction of the first beam against the heading, and from beam to beam [rad].
    reach : (float, float)
        Shortest and longest measured range [m].
    """
    beams = ranges.shape[1]
    if not (increment > 0.0 and beams * increment < 2.0 * math.pi + 1.5 * increment and math.isfinite(angle_min)):
        raise ValueError(
            f"{beams} beams from {angle_min} rad in steps of {increment} rad; want steps of more than 0 within a circle"
        )
    if not abs(2.0 * angle_min / increment) + 2 * beams <= 2 * MAX_BEAMS or not reach[1] <= MAX_REACH_M:
        raise ValueError(
            f"{beams} beams from {angle_min} rad in steps of {increment} rad reach {reach[1]:g} m; want at "
            f"most {MAX_BEAMS:,} about the heading, and {MAX_REACH_M:,.0f} m"
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
    geometry = ScanGeometry(beams=wide.shape[1], field_of_view=view or whole, range_min=reach[0], range_max=reach[1])
    first = angle_min - max(missing, 0) * increment
    return wide, geometry, _axis(first + 0.5 * view, increment)


def _axis(angle: float, increment: float) -> float:
    """Return the angle of the laser's axis [rad]; 0 if it is a rounded zero."""
    return angle if abs(angle) > 1e-2 * increment else 0.0
