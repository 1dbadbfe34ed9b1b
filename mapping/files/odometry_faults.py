"""Faults of recorded odometry that scans and odometry show themselves, and their repair."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.files.trajectories import interpolated
from lidarium.mapping.geometry.rigid import composed, relative
from lidarium.mapping.grids.scan_geometry import ScanGeometry

_FASTEST_M_S, _FASTEST_TURN = 3.0, 4.0
"""Speeds that an indoor robot reaches [m/s, rad/s]; higher speeds may still be usual in a log."""

_MAX_SPEED = 25.0
"""Usual speed beyond which odometry is not in metres [m/s]."""

_USUAL = 3.0
"""Factor by which the speed may exceed that which 95 % of a log's motions keep below is still believed."""

_GAP_S, _GAP_M = 1.0, 0.1
"""Odometry that is not read for longer is unknown if it has moved by more meanwhile [s, m or rad]."""

TURNS_DIFFER = "turns contradict each other"
"""Begins the remark on scans that turn by another share than odometry."""

_STILL_M = 1e-6
"""Odometry that moves by less stands still [m, rad]."""

_CHANGED_M, _CHANGED_SHARE, _CHANGED_BEAMS = 0.1, 0.03, 0.4
"""A range has changed if it differs by more [m, share of it]; a scan, if more than this share of its ranges has."""

_FROZEN_SCANS = 3
"""Minimum number of scans in a row at which odometry is found to stand still."""

_CONSISTENT, _INCONSISTENT = 0.9, 0.7
"""How well motions have one direction against headings: of odometry after a repair at least, and before at most."""

_TURNED = 0.5
"""Headings that differ by less say nothing of axes [rad]."""

_PAIRS, _MIN_PAIRS = 400, 10
"""Maximum number of pairs of scans that are compared, and minimum number of which a ratio is believed."""

_MAX_SHIFT, _MIN_TURN = math.radians(45.0), math.radians(3.0)
"""Turns between scans that are looked for, and counted [rad]."""

_OPPOSED, _RATIO = 0.85, 0.2
"""Share of opposed turns from which on scans are mirrored, and by how much the ratio of turns may differ from 1."""

_STEADY = 0.7
"""A ratio of turns is believed if this share of the turns is within a fifth of it."""

_COMPARED_BEAMS = 360
"""Of scans with more than twice as many beams some are compared."""

_FIT = 0.45
"""Disagreement of two turned scans below which their turn is believed; 1 is none of their ranges alike."""


def odometry_at(
    readings_stamps: NDArray[np.float64], readings: NDArray[np.float64], stamps: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return odometry (n, 3) at stamps, between readings; nan in gaps in which the robot moved."""
    poses = interpolated(readings_stamps, readings, stamps)
    if len(readings_stamps) < 2:
        return poses
    after = np.clip(np.searchsorted(readings_stamps, stamps), 1, len(readings_stamps) - 1)
    steps = np.diff(readings_stamps)
    is_gap = steps > max(_GAP_S, 5.0 * float(np.median(steps)))
    is_gap &= np.abs(relative(readings[:-1], readings[1:])).max(axis=1) > _GAP_M
    is_inside = (stamps > readings_stamps[after - 1]) & (stamps < readings_stamps[after])
    poses[is_gap[after - 1] & is_inside] = np.nan
    return poses


def mended(
    odometry: NDArray[np.float64],
    ranges: NDArray[np.float32],
    geometry: ScanGeometry,
    stamps: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float32], list[str]]:
    """Return odometry (n, 3) and ranges (n, beams) without the faults that they show, and remarks on these.

    Odometry is nan where it stands still although scans move.
    """
    _check_metres(odometry, stamps)
    remarks = []
    gaps = _runs(np.asarray(np.isnan(odometry).any(axis=1)))
    if gaps:
        first, last = max(gaps, key=lambda each: each[1] - each[0])
        remarks.append(
            f"odometry is missing in {len(gaps)} stretches while the robot moves, the longest from {stamps[first]:.3f} "
            f"to {stamps[last - 1]:.3f} s: {sum(b - a for a, b in gaps)} scans are matched without it"
        )
    axes = axes_of(odometry)
    if axes is not None:
        odometry = axes.corrected(odometry)
        remarks.append(f"{axes.what}, and taken so")
    odometry, jumps = _without_jumps(odometry, stamps)
    if jumps:
        remarks.append(f"odometry jumps {jumps} times as no robot moves; the jumps are taken out")
    for first, last in _frozen(odometry, ranges):
        odometry = odometry.copy()
        odometry[first + 1 : last + 1] = np.nan
        remarks.append(
            f"odometry stands still while the scans move, from {stamps[first]:.3f} to {stamps[last]:.3f} s: "
            f"{last - first} scans are matched without it"
        )
    turns = _Turns.of(odometry, ranges, geometry)
    if turns.opposed > _OPPOSED:
        ranges = np.ascontiguousarray(ranges[:, ::-1])
        remarks.append("scans turn against odometry, as those of a laser upside down: their beams are reversed")
        turns = _Turns.of(odometry, ranges, geometry)
    if turns.is_known and abs(turns.ratio - 1.0) > _RATIO:
        remarks.append(
            f"{TURNS_DIFFER}: scans turn {turns.ratio:.2f} times as far as odometry; the angle between beams "
            f"(--field-of-view {min(math.degrees(geometry.field_of_view) / turns.ratio, 360.0):.0f}?) or odometry is "
            "wrong"
        )
    return odometry, ranges, remarks


def _check_metres(odometry: NDArray[np.float64], stamps: NDArray[np.float64]) -> None:
    """Raise ValueError if the robot usually moves as fast as odometry in centimetres or millimetres would be."""
    motions = relative(odometry[:-1], odometry[1:])
    lengths, duration = np.hypot(motions[:, 0], motions[:, 1]), float(stamps[-1] - stamps[0])
    moving = lengths[lengths > 0.0]
    # Stamps of scans that came in a bundle say nothing of single speeds, and jumps nothing of usual lengths.
    speed = float(np.median(moving)) * len(lengths) / duration if len(moving) >= _MIN_PAIRS and duration > 0.0 else 0.0
    if speed > _MAX_SPEED:
        raise ValueError(
            f"the robot moves at {speed:,.0f} a second, as odometry in centimetres or millimetres; want metres"
        )


class PoseAxes(NamedTuple):
    """Axes and units of a log's poses: `order` of x, y, theta, the `scale` of headings, and `what` they are."""

    order: list[int]
    scale: float
    what: str

    def corrected(self, poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return poses (..., 3) as x, y [m] and headings counter-clockwise from x to y [rad]."""
        return poses[..., self.order] * [1.0, 1.0, self.scale]


def axes_of(odometry: NDArray[np.float64]) -> PoseAxes | None:
    """Return the axes of a log's odometry (n, 3); None if they are as they should be, or cannot be told.

    A robot mostly moves in one direction of its body. If it does not, and moves along its heading by other units or
    axes, these are the log's.
    """
    known = np.isfinite(odometry).all(axis=1)
    if abs(_direction(odometry)) > _INCONSISTENT:
        return None
    degrees, same, swapped = math.pi / 180.0, [0, 1, 2], [1, 0, 2]
    for axes in (
        PoseAxes(same, degrees, "headings of odometry are in degrees"),
        PoseAxes(swapped, 1.0, "x and y of odometry are swapped"),
        PoseAxes(same, -1.0, "headings of odometry are clockwise"),
        PoseAxes(swapped, degrees, "x and y of odometry are swapped, its headings in degrees"),
        PoseAxes(same, -degrees, "headings of odometry are clockwise, in degrees"),
    ):
        changed = axes.corrected(odometry)
        if abs(_direction(changed).real) > _CONSISTENT and np.ptp(changed[known, 2]) > _TURNED:
            return axes
    return None


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
    known = np.flatnonzero(np.isfinite(odometry).all(axis=1))
    if len(known) < 4:
        return odometry, 0
    motions = relative(odometry[known[:-1]], odometry[known[1:]])
    steps = np.diff(stamps[known])
    # Stamps of scans that came in a bundle say nothing of the speed between them.
    steps = np.maximum(steps, np.median(steps))
    if not steps.all():
        return odometry, 0
    jumps = _beyond(np.hypot(motions[:, 0], motions[:, 1]) / steps, _FASTEST_M_S) | _beyond(
        np.abs(motions[:, 2]) / steps, _FASTEST_TURN
    )
    if not jumps.any():
        return odometry, 0
    mended = odometry.copy()
    for k, motion in enumerate(motions):
        if jumps[k]:
            motion = motions[k] = motions[k - 1] * (steps[k] / steps[k - 1]) if k else np.zeros(3)
        mended[known[k + 1]] = composed(mended[known[k]], motion)
    return mended, int(jumps.sum())


def _beyond(speeds: NDArray[np.float64], fastest: float) -> NDArray[np.bool_]:
    return np.asarray(speeds > max(fastest, _USUAL * float(np.percentile(speeds, 95.0))))


def _frozen(odometry: NDArray[np.float64], ranges: NDArray[np.float32]) -> list[tuple[int, int]]:
    """Return stretches in which odometry stands still while scans move: numbers of their first and last scans.

    Odometry that is read less often than scans also stands still for some scans: a stretch is longer than twice
    what is usual in the log.
    """
    still = np.abs(np.diff(odometry, axis=0)).max(axis=1) < _STILL_M
    moved = [(a, b) for a, b in _runs(still) if _has_changed(ranges[a : b + 1])]
    lengths = [b - a for a, b in moved]
    usual = float(np.percentile(lengths, 90.0)) if len(lengths) >= 10 else 0.0
    return [(a, b) for a, b in moved if b - a >= max(_FROZEN_SCANS, 2.0 * usual)]


def _runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return where flags are set in a row: the first of each run, and the first behind it."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def _has_changed(ranges: NDArray[np.float32]) -> bool:
    """Whether two scans or more differ from the first one in many of their ranges."""
    first = ranges[0]
    with np.errstate(invalid="ignore"):
        differs = np.abs(ranges[1:] - first) > _CHANGED_M + _CHANGED_SHARE * first
    known = np.isfinite(ranges[1:]) & np.isfinite(first)
    share = (differs & known).sum(axis=1) / np.maximum(known.sum(axis=1), 1)
    return bool((share > _CHANGED_BEAMS).sum() >= min(2, len(share)))


@dataclass(frozen=True, slots=True)
class _Turns:
    """Turns between scans by their ranges alone, against those of odometry.

    Attributes
    ----------
    ratio : float
        Median of a turn of scans over that of odometry; nan if too few are known.
    opposed : float
        Share of turns in which the two have other signs.
    is_known : bool
        Whether most turns have nearly this ratio.
    """

    ratio: float
    opposed: float
    is_known: bool = False

    @classmethod
    def of(cls, odometry: NDArray[np.float64], ranges: NDArray[np.float32], geometry: ScanGeometry) -> "_Turns":
        """Compare turns of scans with those of odometry."""
        turns = relative(odometry[:-1], odometry[1:])[:, 2]
        numbers = np.flatnonzero(np.abs(turns) > _MIN_TURN)  # nan is no turn
        if len(numbers) > _PAIRS:
            numbers = numbers[np.linspace(0, len(numbers) - 1, _PAIRS).astype(np.int64)]
        seen = np.array([_turn(ranges[k], ranges[k + 1], geometry) for k in numbers])
        known = np.isfinite(seen)
        if known.sum() < _MIN_PAIRS:
            return cls(math.nan, 0.0)
        ratios = seen[known] / turns[numbers[known]]
        ratio = float(np.median(ratios))
        is_known = bool((np.abs(ratios - ratio) < 0.2 * abs(ratio)).mean() > _STEADY)
        return cls(ratio, float((ratios < 0.0).mean()), is_known)


def _turn(before: NDArray[np.float32], after: NDArray[np.float32], geometry: ScanGeometry) -> float:
    """Return the turn from one scan to the next at which their ranges are most alike [rad]; nan if none are."""
    stride = max(geometry.beams // _COMPARED_BEAMS, 1)
    most = max(int(_MAX_SHIFT / (stride * geometry.angle_increment)), 1)
    shifts = stride * np.arange(-most, most + 1)
    after = after[::stride]
    index = stride * np.arange(len(after)) + shifts[:, None]
    is_inside = np.ones(index.shape, np.bool_) if geometry.is_full_circle else (index >= 0) & (index < geometry.beams)
    moved = before[index % geometry.beams]
    known = is_inside & np.isfinite(moved) & np.isfinite(after)
    with np.errstate(invalid="ignore"):
        apart = np.minimum(np.abs(moved - after) / (_CHANGED_M + 0.1 * after), 1.0)
    count = known.sum(axis=1)
    cost = np.where(known, apart, 0.0).sum(axis=1) / np.maximum(count, 1)
    cost[count < 0.4 * len(after)] = 1.0
    best = int(cost.argmin())
    is_clear = cost[best] < _FIT and cost[best] < 0.8 * float(np.median(cost))
    return float(shifts[best] * geometry.angle_increment) if is_clear else math.nan


def _direction(odometry: NDArray[np.float64]) -> complex:
    """Return the mean direction of motions against headings, of length 1 if they always have the same.

    It is 1 for a robot that drives ahead. Unknown odometry does not count.
    """
    motions = relative(odometry[:-1], odometry[1:])
    motions = motions[np.isfinite(motions).all(axis=1)]
    lengths = np.hypot(motions[:, 0], motions[:, 1])
    if not lengths.any():
        return 1.0 + 0.0j
    against = np.arctan2(motions[:, 1], motions[:, 0]) - 0.5 * motions[:, 2]
    return complex((lengths * np.exp(1j * against)).sum() / lengths.sum())
