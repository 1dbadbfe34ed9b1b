"""The geometry of a scan: directions and reach of its beams."""

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.bounds import above, check_settings, within
from lidarium.mapping.kernels.compilation import Array, kernel

MAX_BEAMS = 16_384
"""Maximum number of beams: kernels keep some 200 bytes per beam on the stack."""

MAX_RANGE_M = 10_000.0
"""Maximum reach of a laser [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ScanGeometry:
    """Beams of a planar laser range finder, symmetric about the heading, ordered counter-clockwise.

    Attributes
    ----------
    beams : int
        Number of beams, 1 to 16,384.
    field_of_view : float
        Angle between the first and the last beam, or the full circle 2 pi, whose last beam does not repeat
        the first [rad].
    range_min : float
        Minimum range that is measured [m].
    range_max : float
        Maximum range that is measured [m].
    """

    beams: Annotated[int, within(1, MAX_BEAMS)] = 727
    field_of_view: Annotated[float, above(0.0, 2.0 * math.pi + 1e-9)] = math.radians(240.0)
    range_min: Annotated[float, within(0.0, MAX_RANGE_M)] = 0.02
    range_max: Annotated[float, above(0.0, MAX_RANGE_M)] = 5.6

    def __post_init__(self) -> None:
        check_settings(self, "the scan")
        if not self.range_min < self.range_max:
            raise ValueError(
                f"range_min is {self.range_min} m and range_max is {self.range_max} m; want 0 <= range_min < range_max"
            )

    @property
    def is_full_circle(self) -> bool:
        """Whether the last beam is a neighbour of the first."""
        return self.field_of_view > 2.0 * math.pi - 1e-9

    @property
    def angle_increment(self) -> float:
        """Angle between neighbouring beams [rad]."""
        gaps = self.beams if self.is_full_circle else max(self.beams - 1, 1)
        return self.field_of_view / gaps

    @property
    def angle_first(self) -> float:
        """Angle of the first beam against the heading [rad]."""
        return -self.field_of_view / 2 if self.beams > 1 else 0.0

    @property
    def angles(self) -> NDArray[np.float64]:
        """Angle of each beam against the heading, shape (beams,) [rad]."""
        return np.asarray(self.angle_first + self.angle_increment * np.arange(self.beams), np.float64)

    @property
    def unit_vectors(self) -> NDArray[np.float64]:
        """Cosines and sines of the beams' angles, shape (2, beams)."""
        return np.stack([np.cos(self.angles), np.sin(self.angles)])


class Beams(NamedTuple):
    """The beams of one scan, as kernels cast them; lengths in cells of a grid.

    Attributes
    ----------
    x, y, heading : float
        Pose of the laser on the grid [cells, rad].
    angle_first, increment : float
        Angle of the first beam against the heading, and between two beams [rad].
    directions : (4, beams) float64
        Unit vectors along the grid's axes (x, y) and their inverses, see ``beam_directions``.
    reach : float
        Longest range [cells].
    """

    x: float
    y: float
    heading: float
    angle_first: float
    increment: float
    directions: Array
    reach: float


@kernel(nrt=False)
def beam_directions(heading: float, unit_vectors: Array, directions: Array) -> None:
    """Rotate the beams' unit vectors (2, beams) by the heading.

    The result ``directions`` (4, beams) holds x, y and their inverses.
    """
    cosine, sine = math.cos(heading), math.sin(heading)
    for beam in range(unit_vectors.shape[1]):
        direction_x = cosine * unit_vectors[0, beam] - sine * unit_vectors[1, beam]
        direction_y = sine * unit_vectors[0, beam] + cosine * unit_vectors[1, beam]
        directions[0, beam] = direction_x
        directions[1, beam] = direction_y
        directions[2, beam] = 1.0 / direction_x if direction_x != 0.0 else math.inf
        directions[3, beam] = 1.0 / direction_y if direction_y != 0.0 else math.inf


@kernel(forceinline=True)
def fast_angle(y: float, x: float) -> float:
    """Return the angle of (x, y) to within 2e-5 rad [rad], after Abramowitz and Stegun 4.4.49."""
    absolute_x, absolute_y = abs(x), abs(y)
    larger, smaller = max(absolute_x, absolute_y), min(absolute_x, absolute_y)
    # Without a branch, so that loops over many angles run on vectors.
    z = smaller / max(larger, 5e-324)
    square = z * z
    angle = z * (0.9998660 + square * (-0.3302995 + square * (0.1801410 + square * (-0.0851330 + square * 0.0208351))))
    if absolute_y > absolute_x:
        angle = 0.5 * math.pi - angle
    if x < 0.0:
        angle = math.pi - angle
    return -angle if y < 0.0 else angle


@kernel(forceinline=True)
def beams_towards(
    offset_x: float, offset_y: float, radius: float, heading: float, angle_first: float, increment: float
) -> tuple[float, float]:
    """Return the range of beams that a disc at an offset from the laser may meet.

    These are the first beam, not rounded, and the number of beams, which repeat after a full turn. Accurate to a
    few thousandths of the gap between beams at a third of a degree; a caller that must miss none takes one more
    beam.
    """
    squared = offset_x * offset_x + offset_y * offset_y
    beyond = squared - radius * radius
    half = fast_angle(radius, math.sqrt(beyond)) if beyond > 0.0 else math.pi
    begin = (fast_angle(offset_y, offset_x) - half - heading - angle_first) / increment
    turn = 2.0 * math.pi / increment
    begin -= turn * math.floor(begin / turn)
    return begin, 2.0 * half / increment
