"""Directions of a laser's beams, from headers that contradict themselves or say nothing.

A header says three things of which two suffice: the field of view, the step from beam to beam and the number
of beams. Where they contradict each other the number of beams is certain, and the field of view is believed.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

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

WHOLE_TURN = 2.0 * math.pi

_JUMP_SHARE = 0.2
"""Neighbouring returns that differ by more than this share are of two surfaces."""


class Beams(NamedTuple):
    """Directions of the beams of a scan.

    Attributes
    ----------
    angle_min, increment : float
        Of the first beam against the heading, and from beam to beam [rad].
    remark : str
        What of the header was not believed; empty where all was.
    """

    angle_min: float
    increment: float
    remark: str = ""


@dataclass(frozen=True, slots=True)
class FieldOfView:
    """What is said of a laser whose scans carry no angles.

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
        """Return the directions of so many beams: the user's, the log's, a SICK's, or half a turn."""
        if self.wanted is not None:
            return _spread(self.wanted, count)
        if self.stated is not None and self.step is not None and agrees(self.stated, self.step, count):
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


def stated_beams(start: float, view: float, step: float, count: int) -> Beams:
    """Return the directions that a header states.

    Parameters
    ----------
    start, view, step : float
        Direction of the first beam, field of view, and angle from beam to beam [rad]; negative steps are
        those of a laser that is mounted upside down.
    count : int
        Number of beams.
    """
    if view == 0.0 or abs(view) > 1.01 * WHOLE_TURN or agrees(abs(view), abs(step), count):
        return Beams(start, step)
    is_circle = abs(abs(view) - WHOLE_TURN) < 1e-3
    size = abs(view) / (count if is_circle else max(count - 1, 1))
    return Beams(
        start,
        math.copysign(size, view),
        f"steps of {step:g} rad contradict {count} beams over {view:g} rad: {size:.6g} rad are assumed",
    )


def agrees(view: float, step: float, count: int) -> bool:
    """Return whether so many beams at a step cover a field of view, its last beam counted or not."""
    return step > 0.0 and abs((count - 0.5) * step - view) < step


def from_right_to_left(ranges: list[float], beams: Beams) -> tuple[list[float], Beams]:
    """Return a scan whose beams run counter-clockwise: that of an upside-down laser is reversed."""
    if beams.increment >= 0.0:
        return ranges, beams
    last = beams.angle_min + (len(ranges) - 1) * beams.increment
    return ranges[::-1], Beams(last, -beams.increment, "scans run clockwise, as of a laser upside down")


def resampled(ranges: NDArray[np.float32], beams: Beams, wanted: Beams, count: int) -> NDArray[np.float32]:
    """Return a scan at other directions.

    Between two returns of one surface the range is interpolated; else the nearest beam counts. Directions
    beyond the scan are invalid.

    Parameters
    ----------
    ranges : (n,) float32
        The scan [m]; inf for no return, nan for an invalid beam.
    beams, wanted : Beams
        Its directions, and those that are wanted.
    count : int
        Number of wanted directions.
    """
    own = len(ranges)
    is_circle = own * beams.increment > WHOLE_TURN - 0.5 * beams.increment
    place = (wanted.angle_min + np.arange(count) * wanted.increment - beams.angle_min) / beams.increment
    if is_circle:
        place %= WHOLE_TURN / beams.increment
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


def _spread(view: float, count: int, remark: str = "") -> Beams:
    return Beams(-0.5 * view, view / max(count - 1, 1), remark)
