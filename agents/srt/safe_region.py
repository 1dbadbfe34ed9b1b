"""Safe regions: the space around a position that the robot can occupy.

They follow from the ranges seen from there.

All that was seen from a place is kept as one *view*: a range for each of ``DIRECTIONS`` directions of the
full circle, along the axes of the map frame, so that scans taken at several headings are one.

Openings of the region seen from a position are arcs of free rays, gaps at edges that hide something, and the
border of a blind sector. An opening is kept as points along it, each with a point just beyond. It stays open
until enough of the space beyond was seen by any robot; so openings are found once, when their node is made,
and are only looked up afterwards.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.srt.settings import SHAPES
from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.kernels.compilation import Array, kernel

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
"""Start of the first region, against the heading [rad]."""

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
    """Return the ranges of a scan in each direction.

    Parameters
    ----------
    scan : (beams,) float32
        Ranges [m]; 0, nan or below the laser's minimum if invalid, its maximum range or inf if nothing
        was met.
    geometry : ScanGeometry
        The laser.
    heading : float
        Heading of the robot in the map frame [rad].

    Returns
    -------
    (directions,) float64
        Range of the nearest beam [m], inf if nothing was met, nan if there is no valid beam.
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

    If one view does not cover a direction, the other one counts.
    """
    return np.fmin(first, second)


def _region_of(angle: NDArray[np.float64]) -> NDArray[np.int64]:
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
        How far the region reaches in each direction [m]; 0 if nothing is known.
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
        Position of the view [m].
    view : (directions,) float64
        Seen ranges [m].
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
    """
    if shape not in SHAPES:
        raise ValueError(f"shape of the safe region is {shape!r}; want one of {', '.join(SHAPES)}")
    seen = ~np.isnan(view)
    ranges = np.minimum(np.where(seen, view, 0.0), perception)
    regions = _region_of(np.asarray(ANGLES - heading, np.float64))
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

    Inf if nothing of it was seen.
    """
    nearest = np.full(REGIONS, np.inf)
    np.minimum.at(nearest, regions[seen], ranges[seen])
    return nearest


def _radial(ranges: NDArray[np.float64], body: float) -> NDArray[np.float64]:
    """Return how far a disc can go along each direction, (directions,) [m].

    0 if ``ranges`` are nan, which stop no other ray.

    Along a ray the disc meets the end of another one, at an angle off and a range, if it comes within its
    radius of it.
    """
    reach = np.nanmax(ranges, initial=0.0)
    nearest = np.nanmin(ranges, initial=np.inf)
    radii = np.where(np.isnan(ranges), 0.0, np.maximum(ranges - body, 0.0))
    if not reach > 0.0 or not nearest > 0.0:
        return np.zeros(DIRECTIONS)
    widest = int(math.ceil(math.asin(min(body / nearest, 1.0)) / STEP))
    angles = [shift * STEP for shift in range(1, widest + 1)]
    sines, cosines = (np.array([function(angle) for angle in angles]) for function in (math.sin, math.cos))
    _shorten(ranges, sines, cosines, body, radii)
    return radii


@kernel(nrt=False)
def _shorten(ranges: Array, sines: Array, cosines: Array, body: float, radii: Array) -> None:
    """Shorten radii (directions,) to where a disc meets the end of a ray at one of the angles off (kernel)."""
    count = len(ranges)
    for k in range(len(sines)):
        shift = k + 1
        for met in range(count):
            across = ranges[met] * sines[k]
            if across < body:  # nan is not
                limit = max(ranges[met] * cosines[k] - math.sqrt(body * body - across * across), 0.0)
                left, right = (met + shift) % count, (met - shift) % count
                radii[left] = min(radii[left], limit)
                radii[right] = min(radii[right], limit)


SPACING = 0.1
"""Distance of the points along a gap [m]."""

BEYOND = 0.1
"""How far beyond the border of what was seen an opening asks [m]."""

PAST_EDGE = 0.5
"""A robot that explores behind an edge goes at most this far beyond it [m]."""

WIDER, WIDER_COUNT = math.radians(3.0), 20
"""Angle between directions past an edge [rad], and their number.

These are the directions in which a robot may pass the edge.
"""

IsSeen = Callable[[NDArray[np.float64]], NDArray[np.bool_]]


@dataclass(eq=False, slots=True)
class Opening:
    """A part of the border of the region seen from a node, beyond which more may be seen.

    Attributes
    ----------
    points, beyond : (n, 2) float64
        Places along it, and just outside of them [m].
    lengths : (n,) float64
        Length of the border that each point represents [m].
    directions : (m,) int64
        Directions of a view in which a robot may go: to each point of a free arc; past the edge, ever wider
        of it, of a gap.
    reaches : (m,) float64
        How far it goes at most [m].
    is_gap : bool
        Whether it is a gap at an edge, and not an arc of free rays.
    width : float
        Angle that it takes up as seen from the node [rad].
    is_closed : bool
        Whether it was seen through.
    is_tried : bool
        Whether a robot was where it sees through it, or could not get there.
    """

    points: NDArray[np.float64]
    beyond: NDArray[np.float64]
    lengths: NDArray[np.float64]
    directions: NDArray[np.int64]
    reaches: NDArray[np.float64]
    is_gap: bool
    width: float
    is_closed: bool = False
    is_tried: bool = False

    def open_points(self, is_seen: IsSeen, least: float) -> NDArray[np.int64]:
        """Return the numbers of the points that are open.

        None, for good, once less than ``least`` [m] of it is.
        """
        if not (self.is_closed or self.is_tried):
            is_open = ~is_seen(self.beyond)
            if self.lengths[is_open].sum() >= least:
                return np.flatnonzero(is_open)
            self.is_closed = True
        return np.zeros(0, np.int64)


def openings_of(
    place: NDArray[np.float64], view: NDArray[np.float64], perception: float, body: float, with_blind: bool
) -> list[Opening]:
    """Return the openings of the region seen from a position.

    Parameters
    ----------
    place : (2,) float64
        The place [m].
    view : (directions,) float64
        Ranges seen from it [m], inf if nothing was met, nan if nothing is known.
    perception : float
        A ray that is longer is free [m].
    body : float
        Radius of the robot with its margin [m]; openings shorter than twice that and 0.1 m are left out.
    with_blind : bool
        Whether the border of directions of which nothing is known is an opening.
    """
    ranges = np.minimum(np.where(np.isnan(view), 0.0, view), perception)
    least = least_opening(body)
    arcs = [_free_arc(place, run, perception) for run in _runs(ranges >= perception)]
    following = np.roll(ranges, -1)
    is_blind = np.isnan(view) | np.isnan(np.roll(view, -1))
    is_gap = (np.abs(following - ranges) > least) & (np.bool_(with_blind) | ~is_blind)
    gaps = [_gap(place, ranges, int(direction), body) for direction in np.flatnonzero(is_gap)]
    return [opening for opening in (*arcs, *gaps) if opening.lengths.sum() >= least]


def least_opening(body: float) -> float:
    """Return how long an opening has to be to count [m]."""
    return 2.0 * body + 0.1


def _runs(is_free: NDArray[np.bool_]) -> list[NDArray[np.int64]]:
    """Return the runs of free directions around the circle, each in order."""
    if is_free.all():
        return [np.arange(DIRECTIONS)]
    first = int(np.argmin(is_free))
    free = np.flatnonzero(np.roll(is_free, -first))
    if not len(free):
        return []
    return [(run + first) % DIRECTIONS for run in np.split(free, np.flatnonzero(np.diff(free) > 1) + 1)]


def _free_arc(place: NDArray[np.float64], run: NDArray[np.int64], perception: float) -> Opening:
    lengths, reaches = np.full(len(run), perception * STEP), np.full(len(run), perception)
    return Opening(
        place + perception * UNIT[run],
        place + (perception + BEYOND) * UNIT[run],
        lengths,
        run,
        reaches,
        False,
        len(run) * STEP,
    )


def _gap(place: NDArray[np.float64], ranges: NDArray[np.float64], direction: int, body: float) -> Opening:
    """Return the gap between a direction and the next one.

    It is the part of the longer ray behind the edge at which the shorter one ends.
    """
    after = (direction + 1) % DIRECTIONS
    is_after_far = bool(ranges[after] > ranges[direction])
    far, side = (after, 1) if is_after_far else (direction, -1)
    near_range, far_range = sorted((float(ranges[direction]), float(ranges[after])))
    count = max(round((far_range - near_range) / SPACING), 1)
    distances = near_range + (far_range - near_range) * (np.arange(count) + 0.5) / count
    hidden = -side * np.array([-UNIT[far, 1], UNIT[far, 0]])
    # The body has to pass beside the edge, on the side of the longer ray, and goes until it sees what lies
    # behind.
    aside = math.asin(min(body / near_range, 1.0)) if near_range > 0.0 else 0.0
    offsets = aside + WIDER * np.arange(1, WIDER_COUNT + 1)
    towards = np.round(far + side * offsets / STEP).astype(np.int64) % DIRECTIONS
    middle = min(0.5 * (near_range + far_range), near_range + PAST_EDGE)
    points = place + distances[:, None] * UNIT[far]
    lengths = np.full(count, (far_range - near_range) / count)
    return Opening(points, points + BEYOND * hidden, lengths, towards, np.full(WIDER_COUNT, middle), True, aside)
