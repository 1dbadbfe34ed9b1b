"""The next view: the place and the heading from which unknown ground is worth seeing."""

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.sparse.swept_body import BoxIndex, is_free

HEADINGS = 120
"""Headings among which one is chosen."""

SIGHT_M = 0.02
"""Nothing may be nearer to a line of sight than this [m]."""


class Places(NamedTuple):
    """Positions for views.

    Attributes
    ----------
    points : (P, 3) float64
        Places on the ground, the cheapest to come to first [m].
    costs : (P,) float64
        Cost of reaching each [m].
    headings : (P,) float64
        With which heading it comes there [rad].
    """

    points: Annotated[Array, np.float64, 2]
    costs: Annotated[Array, np.float64, 1]
    headings: Annotated[Array, np.float64, 1]


class Sight(NamedTuple):
    """How a robot sees, and the value of a view.

    Attributes
    ----------
    nearest, near, farthest : float
        Ground is seen between the first and the last distance; frontiers are viewed from no farther than
        the second [m].
    half_angle, bearing : float
        Half of the angle that is seen, and its middle from the heading [rad].
    low, height : float
        Between these heights a line of sight must be free [m].
    turn_cost : float
        Cost of turning [m/rad].
    gain : float
        Value of a square metre of unknown ground in view [m/m2].
    most_m2 : float
        Area from which on more is worth nothing [m2].
    least_m : float
        Shortest frontier that is worth a view [m].
    """

    nearest: float
    near: float
    farthest: float
    half_angle: float
    bearing: float
    low: float
    height: float
    turn_cost: float
    gain: float
    most_m2: float
    least_m: float


class Unknown(NamedTuple):
    """Ground that can be seen.

    Attributes
    ----------
    frontier : (F, 3) float64
        Unknown ground adjacent to seen ground [m].
    length : float
        Length of frontier for which each of these counts [m].
    samples : (S, 3) float64
        Samples of all unknown ground [m].
    area : float
        Area for which each of those counts [m2].
    """

    frontier: Annotated[Array, np.float64, 2]
    length: float
    samples: Annotated[Array, np.float64, 2]
    area: float


@dataclass(frozen=True, eq=False, slots=True)
class View:
    """The view from a position.

    Attributes
    ----------
    place : (3,) float64
        Position of the view [m].
    heading : float
        Heading of the robot there [rad].
    cost : float
        Cost of going there and turning [m].
    points : (K, 3) float64
        The unknown ground that is to be seen [m].
    """

    place: NDArray[np.float64]
    heading: float
    cost: float
    points: NDArray[np.float64]


def best_view(index: BoxIndex, places: Places, unknown: Unknown, sight: Sight) -> View | None:
    """Return the view whose cost less its worth is least."""
    if len(unknown.frontier) == 0 or len(places.costs) == 0:
        return None
    place, heading, cost = _best_view(index, places, unknown, sight)
    if place < 0:
        return None
    towards = heading + sight.bearing
    gaps = unknown.frontier[:, :2] - places.points[place, :2]
    apart = np.abs(np.mod(np.arctan2(gaps[:, 1], gaps[:, 0]) - towards + math.pi, 2.0 * math.pi) - math.pi)
    seen = _seen_from(index, places.points[place], unknown.frontier, sight, sight.near)
    seen &= apart <= sight.half_angle
    return View(places.points[place].copy(), float(heading), float(cost), unknown.frontier[seen])


@kernel
def _best_view(index: BoxIndex, places: Places, unknown: Unknown, sight: Sight) -> tuple[int, float, float]:
    """Return the number of the best place, the heading there and the cost; -1 if there is none."""
    best, best_heading, best_cost, minimum = -1, 0.0, np.inf, np.inf
    # Whole bins within the angle that is seen, to each side of the one in the middle.
    half = max(int(sight.half_angle * HEADINGS / (2.0 * math.pi) - 0.5), 0)
    for place in range(places.costs.shape[0]):
        if places.costs[place] - sight.gain * sight.most_m2 >= minimum:
            break
        point = places.points[place]
        seen = _seen_from(index, point, unknown.frontier, sight, sight.near)
        if seen.sum() * unknown.length < sight.least_m - 1e-9:
            continue
        frontier = _by_heading(point, unknown.frontier, seen)
        samples = _by_heading(point, unknown.samples, _seen_from(index, point, unknown.samples, sight, sight.farthest))
        for middle in range(HEADINGS):
            length, area = 0.0, 0.0
            for k in range(middle - half, middle + half + 1):
                length += frontier[k % HEADINGS] * unknown.length
                area += samples[k % HEADINGS] * unknown.area
            if length < sight.least_m - 1e-9:
                continue
            heading = (middle + 0.5) * 2.0 * math.pi / HEADINGS - sight.bearing
            turn = abs((heading - places.headings[place] + math.pi) % (2.0 * math.pi) - math.pi)
            cost = places.costs[place] + sight.turn_cost * turn
            value = cost - sight.gain * min(area, sight.most_m2)
            if value < minimum:
                best, best_heading, best_cost, minimum = place, heading, cost, value
    return best, best_heading, best_cost


@kernel
def _by_heading(place: Array, points: Array, seen: Array) -> Array:
    """Count the points (F, 3) that are seen from a place (3,), by heading, (HEADINGS,)."""
    counts = np.zeros(HEADINGS, np.int64)
    for k in range(points.shape[0]):
        if seen[k]:
            angle = math.atan2(points[k, 1] - place[1], points[k, 0] - place[0])
            counts[int(math.floor(angle * HEADINGS / (2.0 * math.pi))) % HEADINGS] += 1
    return counts


@kernel
def _seen_from(index: BoxIndex, place: Array, points: Array, sight: Sight, farthest: float) -> Array:
    """Return which points (F, 3) are seen from a place (3,), whatever the heading, (F,) bool."""
    seen = np.zeros(points.shape[0], np.bool_)
    ray = np.array([SIGHT_M, sight.low, sight.height])
    for k in range(points.shape[0]):
        gap = math.hypot(points[k, 0] - place[0], points[k, 1] - place[1])
        if sight.nearest <= gap <= farthest:
            seen[k] = is_free(index, place, points[k], ray)
    return seen
