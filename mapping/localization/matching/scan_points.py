"""Representative points in which a scan's beams ended.

They are few, and free of the distortion by motion within the scan.
"""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.kernels.compilation import Array, kernel


def at_last_beam(
    ranges: NDArray[np.float32],
    geometry: ScanGeometry,
    motion: NDArray[np.float64],
    beam_interval_s: float,
    period_s: float,
) -> NDArray[np.float32]:
    """Return the scan as if all beams had been taken with the last one.

    Parameters
    ----------
    ranges : (beams,) float32
        The scan, first beam first [m]; inf for no return, nan for an invalid beam.
    geometry : ScanGeometry
        Directions of the beams.
    motion : (3,) float64
        Motion x, y, theta of the robot in the period that ended with the last beam, in the frame in which it
        began [m, rad].
    beam_interval_s, period_s : float
        Time between neighbouring beams, and that in which the motion took place [s].

    Returns
    -------
    (beams,) float32
        For each beam the range in its direction as seen from the pose at the last beam; nan if nothing was
        seen there.
    """
    if beam_interval_s <= 0.0 or period_s <= 0.0 or not motion.any():
        return ranges
    seen = np.full(geometry.beams, np.nan, np.float32)
    numbers = (geometry.angle_first, geometry.angle_increment, geometry.range_max)
    _undo_motion(ranges, numbers, geometry.is_full_circle, motion, beam_interval_s / period_s, seen)
    return seen


@kernel
def _undo_motion(
    ranges: Array,
    geometry: tuple[float, float, float],
    is_full_circle: bool,
    motion: Array,
    share: float,
    seen: Array,
) -> None:
    """Note each beam's end at the beam of that direction from the last pose.

    The nearer one if two coincide.
    """
    first, increment, range_max = geometry
    beams = ranges.shape[0]
    # At constant speed the robot moved along its own heading of half time.
    middle = 0.5 * motion[2]
    ahead = math.cos(middle) * motion[0] + math.sin(middle) * motion[1]
    aside = math.cos(middle) * motion[1] - math.sin(middle) * motion[0]
    for beam in range(beams):
        value = float(ranges[beam])
        if math.isnan(value):
            continue
        reach = min(value, range_max)
        since = (beams - 1 - beam) * share
        turn = motion[2] * since
        cosine, sine = math.cos(0.5 * turn) * since, math.sin(0.5 * turn) * since
        angle = first + beam * increment - turn
        x = reach * math.cos(angle) - (cosine * ahead + sine * aside)
        y = reach * math.sin(angle) - (cosine * aside - sine * ahead)
        position = int(math.floor((math.atan2(y, x) - first) / increment + 0.5))
        if is_full_circle:
            position %= beams
        if 0 <= position < beams:
            distance = math.hypot(x, y) if math.isfinite(value) and value <= range_max else math.inf
            if not (seen[position] <= distance):
                seen[position] = distance


def scan_points(
    ranges: NDArray[np.float32],
    unit_vectors: NDArray[np.float64],
    increment: float,
    longest: float,
    spacing: float,
    limit: int,
) -> NDArray[np.float64]:
    """Return representative points in which beams ended, shape (points, 2) [m].

    In the robot's frame, thinned to few.

    Parameters
    ----------
    ranges : (beams,) float32
        The scan [m]; inf for no return, nan for an invalid beam.
    unit_vectors : (2, beams) float64
        Directions of the beams.
    increment : float
        Angle between neighbouring beams [rad].
    longest : float
        Longest range that counts [m].
    spacing : float
        Of returns between which the beams are nearer to each other than this at their range, one is taken
        [m].
    limit : int
        Maximum number of points.
    """
    beams = np.empty(len(ranges), np.int64)
    kept = beams[: _spaced(ranges, increment, longest, spacing, beams)]
    if len(kept) > limit:
        kept = kept[np.linspace(0, len(kept) - 1, limit).astype(np.int64)]
    return np.ascontiguousarray((unit_vectors[:, kept] * ranges[kept]).T)


@kernel
def _spaced(ranges: Array, increment: float, longest: float, spacing: float, kept: Array) -> int:
    """Note the beams that stay; return their number.

    The gap between beams counts, not that between their ends: the first end that is far enough from the
    last one would be one that noise has moved that way more often than not, and scans so thinned turn against
    the map.
    """
    count, last = 0, -ranges.shape[0] * 1000
    for beam in range(ranges.shape[0]):
        value = float(ranges[beam])
        if 0.0 < value <= longest and (beam - last) * increment * value >= spacing:
            kept[count] = beam
            count += 1
            last = beam
    return count
