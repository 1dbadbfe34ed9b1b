"""Safe regions: the space around a place in which the robot can stand.

They follow from what was seen from there.

All that was seen from a place is kept as one *view*: a range for each of ``DIRECTIONS`` directions of the
full circle, along the axes of the map frame, so that scans taken at several headings are one.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.srt.settings import SHAPES
from lidarium.mapping.grids.scan_geometry import ScanGeometry

DIRECTIONS = 1080
"""Directions of a view: a third of a degree each, about a beam of the URG-04LX."""

STEP = 2.0 * math.pi / DIRECTIONS
"""Angle between neighbouring directions [rad]."""

ANGLES = np.asarray(STEP * np.arange(DIRECTIONS), np.float64)
"""Angles of the directions [rad]."""

UNIT = np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=1)
"""Unit vectors of the directions, (directions, 2)."""

REGION_WIDTH = math.radians(48.0)
"""Width of the laser regions: five of them are 240 degrees [rad]."""

REGION_FIRST = math.radians(-120.0)
"""Where the first region begins, against the heading [rad]."""

REGIONS = 8
"""Number of laser regions of the full circle.

They are right, right-front, front, left-front, left, and three of 40 degrees behind.
"""


def no_return(geometry: ScanGeometry) -> float:
    """Return the range from which on a beam has met nothing [m].

    Observations are float32, which may round the greatest range down.
    """
    return geometry.range_max * (1.0 - 1e-6)


def view_of(scan: NDArray[np.float32], geometry: ScanGeometry, heading: float) -> NDArray[np.float64]:
    """Return what a scan shows in each direction.

    Parameters
    ----------
    scan : (beams,) float32
        Ranges [m]; 0, nan or below the laser's least where invalid, its greatest range or inf where nothing
        was met.
    geometry : ScanGeometry
        The laser.
    heading : float
        Heading of the robot in the map frame [rad].

    Returns
    -------
    (directions,) float64
        Range of the nearest beam [m], inf where nothing was met, nan where there is no valid beam.
    """
    ranges = np.asarray(scan, np.float64)
    with np.errstate(invalid="ignore"):
        ranges = np.where(ranges >= geometry.range_min, ranges, np.nan)
        ranges = np.where(ranges >= no_return(geometry), np.inf, ranges)
    # A single beam sees its own direction alone.
    increment = geometry.angle_increment if geometry.beams > 1 else STEP
    offsets = (ANGLES - heading - geometry.angle_first + 0.5 * increment) % (2.0 * math.pi)
    beams = np.floor(offsets / increment).astype(np.int64)
    is_seen = beams < geometry.beams
    return np.where(is_seen, ranges[np.minimum(beams, geometry.beams - 1)], np.nan)


def joined_views(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the nearer of two views in each direction.

    Where one view does not cover a direction, the other one counts.
    """
    return np.fmin(first, second)


def region_of(angle: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the laser region of an angle against the heading [rad].

    The regions are 0 right to 4 left, and 5 to 7 behind.
    """
    turned = (angle - REGION_FIRST) % (2.0 * math.pi)
    behind = 5 + np.floor((turned - 5.0 * REGION_WIDTH) / math.radians(40.0) + 1e-9)
    return np.where(
        turned < 5.0 * REGION_WIDTH - 1e-9, np.floor(turned / REGION_WIDTH + 1e-9), np.minimum(behind, 7)
    ).astype(np.int64)


@dataclass(frozen=True, slots=True)
class SafeRegion:
    """A star-shaped region around a place.

    Attributes
    ----------
    place : (2,) float64
        The place [m].
    radii : (directions,) float64
        How far the region reaches in each direction [m]; 0 where nothing is known.
    """

    place: NDArray[np.float64]
    radii: NDArray[np.float64]

    @property
    def outline(self) -> NDArray[np.float64]:
        """The region's border around its place, (directions, 2) [m]."""
        return np.asarray(self.radii[:, None] * UNIT)

    def radius_at(self, angle: float) -> float:
        """Return how far the region reaches in a direction of the map frame [rad]."""
        return float(self.radii[round(angle / STEP) % DIRECTIONS])

    def contains(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether points (..., 2) lie within, shape (...)."""
        gap = points - self.place
        directions = np.round(np.arctan2(gap[..., 1], gap[..., 0]) / STEP).astype(np.int64) % DIRECTIONS
        return np.asarray(np.hypot(gap[..., 0], gap[..., 1]) <= self.radii[directions])


def seen_region(place: NDArray[np.float64], view: NDArray[np.float64], perception: float) -> SafeRegion:
    """Return the region that was seen from a place, up to the perception's range [m]."""
    return SafeRegion(place, np.minimum(np.nan_to_num(view, nan=0.0, posinf=np.inf), perception))


def safe_region(
    place: NDArray[np.float64],
    view: NDArray[np.float64],
    heading: float,
    shape: str,
    body: float,
    perception: float,
    turn_room: float = 0.0,
) -> SafeRegion:
    """Return the region in which a disc is safe.

    Parameters
    ----------
    place : (2,) float64
        Where the view was taken [m].
    view : (directions,) float64
        What was seen [m].
    heading : float
        Heading of the laser regions [rad].
    shape : str
        ``ball`` (the least radius in all directions), ``star`` (the least of each laser region) or ``radial``
        (the disc fits along each ray). A ball lies within the star, and the star within the radial region.
    body : float
        Radius of the disc with its margin [m].
    perception : float
        Rays count as far as this [m].
    turn_room : float
        A laser region with a return nearer than the disc and this is not safe [m]; 0 for off.

    Raises
    ------
    ValueError
        Where the shape is unknown.
    """
    if shape not in SHAPES:
        raise ValueError(f"shape of the safe region is {shape!r}; want one of {', '.join(SHAPES)}")
    seen = ~np.isnan(view)
    ranges = np.minimum(np.where(seen, view, 0.0), perception)
    regions = region_of(np.asarray(ANGLES - heading, np.float64))
    radial = _radial(np.where(seen, ranges, np.nan), body)
    if shape == "radial":
        radii = radial
    elif shape == "ball":
        radii = np.where(seen, max(float(ranges[seen].min(initial=np.inf)) - body, 0.0), 0.0)
    else:
        nearest = _nearest_of_regions(ranges, regions, seen)
        # At the border of two regions the disc also meets what stands in the other one.
        radii = np.where(seen, np.minimum(np.maximum(nearest[regions] - body, 0.0), radial), 0.0)
    if turn_room > 0.0:
        radii = np.where(_nearest_of_regions(ranges, regions, seen)[regions] < body + turn_room, 0.0, radii)
    return SafeRegion(np.array(place[:2], np.float64), radii)


def _nearest_of_regions(
    ranges: NDArray[np.float64], regions: NDArray[np.int64], seen: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Return the least range of each laser region, (regions,) [m].

    Inf where nothing of it was seen.
    """
    nearest = np.full(REGIONS, np.inf)
    np.minimum.at(nearest, regions[seen], ranges[seen])
    return nearest


def _radial(ranges: NDArray[np.float64], body: float) -> NDArray[np.float64]:
    """Return how far a disc can go along each direction, (directions,) [m].

    0 where ``ranges`` are nan, which stop no other ray.

    Along a ray the disc meets the end of another one, at an angle off and a range, where it comes within its
    radius of it.
    """
    reach = np.nanmax(ranges, initial=0.0)
    nearest = np.nanmin(ranges, initial=np.inf)
    radii = np.where(np.isnan(ranges), 0.0, np.maximum(ranges - body, 0.0))
    if not reach > 0.0 or not nearest > 0.0:
        return np.zeros(DIRECTIONS)
    widest = int(math.ceil(math.asin(min(body / nearest, 1.0)) / STEP))
    for shift in range(1, widest + 1):
        sine, cosine = math.sin(shift * STEP), math.cos(shift * STEP)
        for side in (shift, -shift):
            other = np.roll(ranges, side)
            with np.errstate(invalid="ignore"):
                across = other * sine
                is_met = across < body
                limit = other * cosine - np.sqrt(np.maximum(body * body - across * across, 0.0))
                radii = np.where(is_met, np.minimum(radii, np.maximum(limit, 0.0)), radii)
    return radii
