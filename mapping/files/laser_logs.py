"""Recorded laser scans with odometry: the log, and the repair of its clock."""

from bisect import bisect_right
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.files.odometry_faults import mended
from lidarium.mapping.files.trajectories import interpolated
from lidarium.mapping.grids.scan_geometry import ScanGeometry

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


def _order(stamps: NDArray[np.float64]) -> NDArray[np.int64] | None:
    """Return the order of time of scans that are not in it although their stamps are fine; None if they are, or not.

    In the order of time such stamps are as steady as those of a log. Those of a clock that has restarted lie between
    each other or far apart, and a wild stamp is far from all others or too near to one.
    """
    steps = np.diff(stamps)
    if not np.isfinite(stamps).all() or not (steps < 0.0).any():
        return None
    order = np.argsort(stamps, kind="stable")
    period, forward = np.diff(stamps[order]), steps[steps > 0.0]
    usual = float(np.median(period))
    # A pause is a step forward between others.
    pauses = steps[1:-1][(steps[:-2] >= 0.0) & (steps[2:] >= 0.0)]
    if not usual > 0.0 or period.max() > max(3.0 * usual, float(pauses.max(initial=0.0))):
        return None
    near = int((period < 0.6 * usual).sum())
    if len(stamps) > FEW * (1 + int((steps < 0.0).sum())):
        # Long runs: their own steps show how steady stamps are, and those of two clocks would lie between each other.
        is_fine = usual > 0.75 * float(np.median(forward))
        is_fine &= near - int((forward < 0.6 * usual).sum()) <= 0.3 * _displaced(stamps)
    else:
        is_fine = near <= 0.5 * len(stamps)
    return order if is_fine else None


def _displaced(stamps: NDArray[np.float64]) -> int:
    """Return the smallest number of stamps without which the others are in order."""
    ends: list[float] = []  # the last stamp of the longest ascending choices of each length, as low as possible
    for stamp in stamps.tolist():
        position = bisect_right(ends, stamp)
        ends[position : position + 1] = [stamp]
    return len(stamps) - len(ends)


NOT_IN_TIME = "motion within scans is not undone: their beams are not in the order of time from behind"

MAX_POSE_M = 1e8
"""Farthest that a log may lead [m]."""


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
    beams_behind : int
        Number of invalid beams behind the last one that was taken; `swept` shifts the stamps by their time.
    is_in_time : bool
        Whether the beams are in the order in which they were taken; otherwise they have no interval.
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
    beams_behind: int = 0
    is_in_time: bool = True
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

    def swept(self, beam_interval_s: float) -> "LaserLog":
        """Return the log with a time from beam to beam [s], and with the stamps of the last beams of its scans.

        If beams are not in the order of time, the interval stays 0 and a remark is added: motion within these scans
        cannot be corrected.
        """
        if beam_interval_s <= 0.0:
            return self
        if not self.is_in_time:
            return replace(self, beam_interval_s=0.0, remarks=(*self.remarks, NOT_IN_TIME))
        stamps, odometry = self.stamps + self.beams_behind * beam_interval_s, self.odometry
        if odometry is not None and self.beams_behind:
            odometry = interpolated(self.stamps, odometry, stamps)
        return replace(self, stamps=stamps, odometry=odometry, beam_interval_s=beam_interval_s, beams_behind=0)


def made_usable(log: LaserLog, where: str) -> LaserLog:
    """Return a log without unusable scans and odometry.

    Scans are dropped without a finite stamp, if they repeat an earlier one, stamp, ranges and odometry, or if stamps go
    back in time; a clock that restarts is continued.
    Scans out of the order of time are sorted. Odometry is dropped if it contains no information, and mended by
    ``odometry_faults``.

    If most stamps stand still or run backwards, the clock is useless, and scans are numbered by the second instead.
    """
    for poses in (log.odometry, log.corrected, log.readings, log.laser_pose):
        if poses is not None and poses.size and not np.nanmax(np.abs(poses), initial=0.0) <= MAX_POSE_M:
            raise ValueError(f"{where} has poses beyond {MAX_POSE_M:,.0f} m; want metres and radians")
    first = _first_told(log)
    if len(first) < len(log.stamps):
        skipped = {**log.skipped, "repeated scans": len(log.stamps) - len(first)}
        log = replace(_without_readings(_at(log, first)), skipped=skipped)
    order = _order(log.stamps)
    if order is not None:
        moved = int((order != np.arange(len(order))).sum())
        log = replace(_at(log, order), remarks=(*log.remarks, f"{moved} scans are not in the order of time: sorted"))
    stamps, skipped, remarks = log.stamps, dict(log.skipped), list(log.remarks)
    if len(stamps) > 2 and not (np.diff(stamps) > 0.0).mean() > 0.5:
        stamps = np.arange(len(stamps), dtype=np.float64)
        skipped["stamps of a clock that stands still or runs backwards: scans are numbered by the second"] = len(stamps)
        log = _without_readings(log)
    clock = _continued(stamps)
    if len(clock.kept) < len(stamps):
        timeless = int((~np.isfinite(stamps)).sum())
        dropped = {"scans without a stamp": timeless, "scans back in time": len(stamps) - len(clock.kept) - timeless}
        skipped |= {reason: count for reason, count in dropped.items() if count}
    if not len(clock.kept):
        raise ValueError(
            f"{where} holds no scan that can be used; want FLASER or ROBOTLASER1 lines, or an npz with "
            "ranges and stamps"
        )
    if clock.restarts:
        remarks.append(f"the clock restarts {clock.restarts} times; stamps are continued")
        log = _without_readings(log)
    log = _at(log, clock.kept)
    log = replace(log, stamps=clock.stamps, skipped=skipped)
    odometry = log.odometry
    if odometry is not None and not _moves(odometry):
        log = replace(log, odometry=None)
    elif odometry is not None:
        better, ranges, found = mended(odometry, log.ranges, log.geometry, log.stamps)
        remarks += found
        if np.nan_to_num(better - odometry).any():
            log = _without_readings(log)  # they have the same faults
        if ranges is not log.ranges:  # their beams are reversed
            log = replace(log, ranges=ranges, is_in_time=False)
        log = replace(log, odometry=better)
    return replace(log, remarks=tuple(remarks)).swept(log.beam_interval_s)


def _first_told(log: LaserLog) -> NDArray[np.int64]:
    """Return the indices of scans that are not repeats of earlier ones; all of them if all stamps are equal."""
    stamps, repeats = np.unique(log.stamps, return_counts=True)
    again, told, numbers = set(stamps[repeats > 1].tolist()) if len(stamps) > 1 else set(), set(), []
    for k, stamp in enumerate(log.stamps.tolist()):
        scan = (stamp, log.ranges[k].tobytes(), b"" if log.odometry is None else log.odometry[k].tobytes())
        if stamp not in again or scan not in told:
            numbers.append(k)
        if stamp in again:
            told.add(scan)
    return np.array(numbers, np.int64)


def _at(log: LaserLog, numbers: NDArray[np.int64]) -> LaserLog:
    """Return a log of some of its scans, or in another order."""
    numbered = log.reading_of_scan[numbers] if len(log.reading_of_scan) else log.reading_of_scan
    changed = replace(
        log,
        stamps=log.stamps[numbers],
        ranges=log.ranges[numbers],
        odometry=None if log.odometry is None else log.odometry[numbers],
        corrected=None if log.corrected is None else log.corrected[numbers],
        reading_of_scan=numbered,
    )
    return _without_readings(changed) if (np.diff(numbered) < 0).any() else changed


def _moves(odometry: NDArray[np.float64]) -> bool:
    """Whether odometry contains information."""
    known = odometry[np.isfinite(odometry).all(axis=1)]
    return len(known) > 0 and bool(np.ptp(known, axis=0).max() > 0.0)


def _without_readings(log: LaserLog) -> LaserLog:
    """Return a log without the readings between its scans, whose stamps are of no use."""
    return replace(log, readings_stamps=np.zeros(0), readings=np.zeros((0, 3)), reading_of_scan=np.zeros(0, np.int64))
