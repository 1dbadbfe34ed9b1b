"""Openings of what is seen from a place.

They are arcs of free rays, gaps beside edges that hide something, and the border of a blind sector.

An opening is kept as points along it, each with a point just beyond. It stays open as long as enough of what
lies beyond was not seen by anybody; so openings are found once, when their node is made, and are only
looked up afterwards.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.srt.safe_region import DIRECTIONS, STEP, UNIT

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
    """A part of the border of what was seen from a node where more may be seen.

    Attributes
    ----------
    points, beyond : (n, 2) float64
        Places along it, and just outside of them [m].
    lengths : (n,) float64
        How much of the border each point stands for [m].
    directions : (m,) int64
        Directions of a view in which a robot may go: to each point of a free arc; past the edge, ever wider
        of it, of a gap.
    reaches : (m,) float64
        How far it goes at most [m].
    is_gap : bool
        Whether it is a gap beside an edge, and not an arc of free rays.
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
    """Return the openings of what is seen from a place.

    Parameters
    ----------
    place : (2,) float64
        The place [m].
    view : (directions,) float64
        What is seen from it [m], inf where nothing was met, nan where nothing is known.
    perception : float
        A ray that is longer is free [m].
    body : float
        Radius of the robot with its margin [m]; openings shorter than twice that and 0.1 m are left out.
    with_blind : bool
        Whether the border of directions of which nothing is known is an opening.

    Returns
    -------
    list of Opening
        Free arcs by their first direction, then gaps.
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
    return Opening(
        points, points + BEYOND * hidden, lengths, towards, np.full(WIDER_COUNT, middle), True, aside
    )
