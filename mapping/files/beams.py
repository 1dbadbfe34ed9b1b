"""Beams of recorded scans: their directions, their marks, and all scans of a log on one grid of directions."""

import math
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.grids.scan_geometry import MAX_BEAMS, ScanGeometry

WHOLE_TURN = 2.0 * math.pi

_JUMP_SHARE = 0.2
"""Neighbouring returns that differ by more than this share are of two surfaces."""

_SAME_ANGLE = 1e-4
"""Directions that differ by less are the same: headers are rounded [rad]."""

_FAR_M = 60.0
"""Half of the returns of no laser are farther away [m]."""

_MAX_REACH_M = 10_000.0
"""Longest range of a laser that a log may have [m]."""

_CIRCLE_BEAMS = 0.4
"""Beams that miss a whole turn by less than so many steps cover it: headers round the step."""


class Beams(NamedTuple):
    """Directions of the beams of a scan.

    Attributes
    ----------
    angle_min, increment : float
        Of the first beam against the heading, and from beam to beam [rad].
    remark : str
        Parts of the header that were ignored; empty if there are none.
    """

    angle_min: float
    increment: float
    remark: str = ""


def marked(ranges: NDArray[np.float32], least: float, most: float) -> NDArray[np.float32]:
    """Mark ranges [m] in place: inf for no return, which is ``most`` or more; nan for invalid beams.

    Beams are invalid at zero or below, and nearer than ``least``.
    """
    with np.errstate(invalid="ignore"):
        ranges[~(ranges > 0.0) | (ranges < np.float32(least))] = np.nan
        ranges[ranges >= most * (1.0 - 1e-6)] = np.inf
    return ranges


def check_metres(ranges: NDArray[np.float32], where: str) -> None:
    """Raise ValueError if ranges are in centimetres or millimetres, by how far away most returns are."""
    known = ranges[np.isfinite(ranges) & (ranges > 0.0)]
    # The longest range stands for no return.
    known = known[known < known.max(initial=0.0) * (1.0 - 1e-6)]
    middle = float(np.median(known)) if known.size else 0.0
    if middle > _FAR_M:
        unit = "centimetres" if middle < 20.0 * _FAR_M else "millimetres"
        raise ValueError(f"{where}: half of the returns are beyond {middle:,.0f}, as of ranges in {unit}; want metres")


def from_right_to_left(ranges: NDArray[np.float32], beams: Beams) -> tuple[NDArray[np.float32], Beams]:
    """Return a scan whose beams run counter-clockwise: that of an upside-down laser is reversed."""
    if beams.increment >= 0.0:
        return ranges, beams
    last = beams.angle_min + (len(ranges) - 1) * beams.increment
    return ranges[::-1], Beams(last, -beams.increment, "scans run clockwise, as of a laser upside down")


def on_one_grid(scans: Sequence[NDArray[np.float32]], beams: Sequence[Beams]) -> tuple[NDArray[np.float32], Beams, int]:
    """Return scans (n, beams) in the same directions, these directions, and the number of resampled scans.

    Directions are those of most scans; if no half of them has the same, those of the scan that sees most.

    Parameters
    ----------
    scans : sequence of (beams,) float32
        Ranges [m], counter-clockwise; inf for no return, nan for an invalid beam.
    beams : sequence of Beams
        Directions of each.
    """
    keys = [
        (len(ranges), round(each.angle_min / _SAME_ANGLE), round(len(ranges) * each.increment / _SAME_ANGLE))
        for ranges, each in zip(scans, beams, strict=True)
    ]
    groups = Counter(keys)
    chosen, number = groups.most_common(1)[0]
    if 2 * number < len(scans):
        # Not of many more beams than others have: the table of all scans would be large.
        most = 2.0 * float(np.median([len(ranges) for ranges in scans]))
        turn = round(WHOLE_TURN / _SAME_ANGLE)
        chosen = max(groups, key=lambda key: (key[0] <= most, min(key[2], turn), groups[key]))
    wanted, count = beams[keys.index(chosen)], chosen[0]
    if count > MAX_BEAMS:
        raise ValueError(f"scans have {count:,} beams; want at most {MAX_BEAMS:,}")
    table = np.empty((len(scans), count), np.float32)
    for row, (key, ranges, each) in enumerate(zip(keys, scans, beams, strict=True)):
        table[row] = ranges if key == chosen else resampled(ranges, each, wanted, count)
    return table, wanted, len(scans) - groups[chosen]


def resampled(ranges: NDArray[np.float32], beams: Beams, wanted: Beams, count: int) -> NDArray[np.float32]:
    """Return a scan at other directions.

    Between two returns of one surface the range is interpolated; else the nearest beam counts. Directions beyond
    the scan are invalid.

    Parameters
    ----------
    ranges : (n,) float32
        The scan [m]; inf for no return, nan for an invalid beam.
    """
    own = len(ranges)
    is_circle = own * beams.increment > WHOLE_TURN - 0.5 * beams.increment
    place = (wanted.angle_min + np.arange(count) * wanted.increment - beams.angle_min) / beams.increment
    if is_circle:
        place %= WHOLE_TURN / beams.increment
    else:
        # The same direction may be written a whole turn apart.
        place += WHOLE_TURN / beams.increment * np.round((0.5 * (own - 1) - place) / (WHOLE_TURN / beams.increment))
    before = np.floor(place + 1e-9).astype(np.int64)
    share = np.maximum(place - before, 0.0)
    is_seen = is_circle | ((place > -0.5) & (place < own - 0.5))
    index = np.array([before, before + 1])
    left, right = ranges[index % own if is_circle else np.clip(index, 0, own - 1)].astype(np.float64)
    with np.errstate(invalid="ignore"):
        is_one = np.abs(left - right) <= _JUMP_SHARE * np.minimum(left, right)
        between = (1.0 - share) * left + share * right
    found = np.where(is_one & np.isfinite(between), between, np.where(share < 0.5, left, right))
    return np.where(is_seen, found, np.nan).astype(np.float32)


class SymmetricScans(NamedTuple):
    """Scans symmetric about the laser's axis.

    Attributes
    ----------
    ranges : (scans, beams) float32
        The scans [m].
    geometry : ScanGeometry
        Their beams.
    axis : float
        Direction of the axis against the heading, within half a beam of it: it belongs to the laser's pose on the
        robot [rad].
    behind : int
        Number of beams behind the last one that the laser took; -1 if that one is left out.
    is_rolled : bool
        Whether the beams of a full circle begin with another one than the laser began with.
    """

    ranges: NDArray[np.float32]
    geometry: ScanGeometry
    axis: float
    behind: int = 0
    is_rolled: bool = False


def symmetric_scans(
    ranges: NDArray[np.float32], angle_min: float, increment: float, reach: tuple[float, float]
) -> SymmetricScans:
    """Return scans symmetric about the laser's axis; invalid beams are added on one side.

    Parameters
    ----------
    ranges : (scans, beams) float32
        The scans [m].
    angle_min, increment : float
        Direction of the first beam against the heading, and from beam to beam [rad].
    reach : (float, float)
        Shortest and longest measured range [m].
    """
    beams, behind = ranges.shape[1], 0
    if not (increment > 0.0 and beams * increment < 2.0 * math.pi + 1.5 * increment and math.isfinite(angle_min)):
        raise ValueError(
            f"{beams} beams from {angle_min} rad in steps of {increment} rad; want steps of more than 0 within a circle"
        )
    if not abs(2.0 * angle_min / increment) + 2 * beams <= 2 * MAX_BEAMS or not reach[1] <= _MAX_REACH_M:
        raise ValueError(
            f"{beams} beams from {angle_min} rad in steps of {increment} rad reach {reach[1]:g} m; want at "
            f"most {MAX_BEAMS:,} about the heading, and {_MAX_REACH_M:,.0f} m"
        )
    if abs((beams - 1) * increment - WHOLE_TURN) < _CIRCLE_BEAMS * increment:
        # The last beam repeats the first.
        ranges, beams, behind = ranges[:, :-1], beams - 1, -1
    if abs(beams * increment - WHOLE_TURN) < _CIRCLE_BEAMS * increment:
        increment = WHOLE_TURN / beams
        turned = round((angle_min + math.pi) / increment)
        geometry = ScanGeometry(beams=beams, field_of_view=WHOLE_TURN, range_min=reach[0], range_max=reach[1])
        return SymmetricScans(
            np.roll(ranges, turned, axis=1),
            geometry,
            _axis(angle_min + math.pi - turned * increment, increment),
            behind,
            turned % beams != 0,
        )
    missing = round((2.0 * angle_min + (beams - 1) * increment) / increment)
    added = np.full((len(ranges), abs(missing)), np.nan, np.float32)
    wide = np.concatenate([added, ranges] if missing > 0 else [ranges, added], axis=1)
    view = (wide.shape[1] - 1) * increment
    if view > WHOLE_TURN:
        raise ValueError(f"beams begin at {angle_min} rad; want beams about the heading")
    geometry = ScanGeometry(
        beams=wide.shape[1], field_of_view=view or WHOLE_TURN, range_min=reach[0], range_max=reach[1]
    )
    first = angle_min - max(missing, 0) * increment
    return SymmetricScans(wide, geometry, _axis(first + 0.5 * view, increment), behind + max(-missing, 0))


def _axis(angle: float, increment: float) -> float:
    """Return the angle of the laser's axis [rad]; 0 if it is a rounded zero."""
    return angle if abs(angle) > 1e-2 * increment else 0.0
