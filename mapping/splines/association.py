"""Which curves are of one wall, and along which part of both.

Rough step: curves some of whose control points are near each other are candidates. Fine step: from an end of
the seen curve the nearest point of the known curve is looked up. If that is an end of the known curve, the
known curve ends first, and the overlap begins at the seen curve's point nearest to it; else it begins at the
seen curve's own end. The same at the other end: four cases.

Curves of one wall are joined as their weighted mean on their common part, and each of them alone elsewhere.
They are joined as ways, points along them with weights. A weight is a number of observations with a standard
deviation of 1 cm.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.splines.bspline import Spline
from lidarium.mapping.splines.settings import AssociationSettings, MapSettings

SAMPLE_SPACING = 0.05
"""Curves are compared by points so far apart [m]."""


@dataclass(frozen=True, slots=True)
class Overlap:
    """The common part of a seen and a known curve, which run the same way.

    Attributes
    ----------
    seen, known : (float, float)
        Parameters at which it begins and ends, of either curve [m].
    begins_at_known, ends_at_known : bool
        Whether the known curve's end, not the seen one's, bounds it.
    length : float
        Its length along the seen curve [m].
    distance : float
        Mean distance of the curves [m].
    turn : float
        Mean angle between them [rad].
    """

    seen: tuple[float, float]
    known: tuple[float, float]
    begins_at_known: bool
    ends_at_known: bool
    length: float
    distance: float
    turn: float


def are_near(seen: NDArray[np.float64], known: NDArray[np.float64], distance: float) -> bool:
    """Return whether two curves have control points within a distance [m].

    Any of (n, 2) of one from any of (m, 2) of the other.
    """
    return bool(_are_near(seen, known, distance))


def overlap_of(seen: Spline, known: Spline, settings: AssociationSettings | None = None) -> Overlap | None:
    """Find the common part of two curves.

    Parameters
    ----------
    seen, known : Spline
        Curves in one frame.
    settings : AssociationSettings or None
        How alike they have to be.

    Returns
    -------
    Overlap or None
        None if they have no common part of the least length, lie too far apart, or run different ways.
    """
    settings = settings or AssociationSettings()
    seen_at, known_at = seen.sample_parameters(SAMPLE_SPACING), known.sample_parameters(SAMPLE_SPACING)
    found = _find_overlap(seen.evaluate(seen_at), known.evaluate(known_at))
    seen_from, seen_to, known_from, known_to, length, distance, turn, cases = found
    if length < settings.least_overlap or distance > settings.mean_distance or turn > settings.mean_turn:
        return None
    return Overlap(
        (_parameter(seen_at, seen_from), _parameter(seen_at, seen_to)),
        (_parameter(known_at, known_from), _parameter(known_at, known_to)),
        bool(cases & 1),
        bool(cases & 2),
        length,
        distance,
        turn,
    )


def _parameter(parameters: NDArray[np.float64], place: float) -> float:
    """Return the parameter at a place of a way through samples, counted in samples."""
    return float(np.interp(place, np.arange(len(parameters)), parameters))


@kernel
def _are_near(seen: Array, known: Array, distance: float) -> bool:
    for i in range(seen.shape[0]):
        for j in range(known.shape[0]):
            x, y = seen[i, 0] - known[j, 0], seen[i, 1] - known[j, 1]
            if x * x + y * y <= distance * distance:
                return True
    return False


@kernel
def _closest_place(way: Array, x: float, y: float) -> tuple[float, float]:
    """Return the nearest position on a polyline (n, 2) to a point, and its distance.

    The position is counted in points of the polyline, n >= 2; the distance is in metres [m].
    """
    position, nearest = 0.0, math.inf
    for k in range(way.shape[0] - 1):
        ax, ay = way[k, 0], way[k, 1]
        dx, dy = way[k + 1, 0] - ax, way[k + 1, 1] - ay
        squared = dx * dx + dy * dy
        share = ((x - ax) * dx + (y - ay) * dy) / squared if squared > 0.0 else 0.0
        share = min(max(share, 0.0), 1.0)
        gap = (ax + share * dx - x) ** 2 + (ay + share * dy - y) ** 2
        if gap < nearest:
            position, nearest = k + share, gap
    return position, math.sqrt(nearest)


@kernel
def mark_along(points: Array, way: Array, distance: float, is_along: Array) -> None:
    """Mark the points of one polyline (m, 2) that run along another (n, 2).

    Within a distance [m]; other points keep their marks (m,).

    The two faces of a thin wall run opposite ways.
    """
    last = points.shape[0] - 1
    for k in range(points.shape[0]):
        position, gap = _closest_place(way, points[k, 0], points[k, 1])
        if gap <= distance:
            x, y = (
                points[min(k + 1, last), 0] - points[max(k - 1, 0), 0],
                points[min(k + 1, last), 1] - points[max(k - 1, 0), 1],
            )
            direction = _direction_of(way, position)
            if x * math.cos(direction) + y * math.sin(direction) >= 0.0:
                is_along[k] = True


@kernel
def _point_of(way: Array, place: float) -> tuple[float, float]:
    """Return the point at a place of a way."""
    k = min(max(int(place), 0), way.shape[0] - 2)
    share = place - k
    return way[k, 0] + share * (way[k + 1, 0] - way[k, 0]), way[k, 1] + share * (way[k + 1, 1] - way[k, 1])


@kernel
def _direction_of(way: Array, place: float) -> float:
    """Return the direction of a way at a place [rad]."""
    k = min(max(int(place), 0), way.shape[0] - 2)
    return math.atan2(way[k + 1, 1] - way[k, 1], way[k + 1, 0] - way[k, 0])


@kernel
def _find_overlap(seen: Array, known: Array) -> tuple[float, float, float, float, float, float, float, int]:
    """Find the common part of two ways of points (n, 2), (m, 2).

    Returns
    -------
    tuple
        Places where it begins and ends on the seen way and on the known one, counted in points; its length
        along the seen way [m]; mean distance [m] and mean angle [rad]; 1 if the known way's end begins it,
        plus 2 if one ends it. A length of 0 for none.
    """
    ends = np.empty(4)
    cases = 0
    for side in range(2):
        a = 0 if side == 0 else seen.shape[0] - 1
        b, _ = _closest_place(known, seen[a, 0], seen[a, 1])
        is_end = b <= 0.0 or b >= known.shape[0] - 1.0
        if is_end:
            x, y = _point_of(known, b)
            ends[side], _ = _closest_place(seen, x, y)
            cases += 1 << side
        else:
            ends[side] = float(a)
        ends[2 + side] = b
    if not (ends[0] < ends[1] and ends[2] < ends[3]):
        return ends[0], ends[1], ends[2], ends[3], 0.0, math.inf, math.inf, cases
    length, distance, turn, weight = 0.0, 0.0, 0.0, 0.0
    for k in range(int(ends[0]), min(int(ends[1]) + 1, seen.shape[0] - 1)):
        low, high = max(ends[0], float(k)), min(ends[1], k + 1.0)
        if high <= low:
            continue
        dx, dy = seen[k + 1, 0] - seen[k, 0], seen[k + 1, 1] - seen[k, 1]
        step = (high - low) * math.sqrt(dx * dx + dy * dy)
        x, y = _point_of(seen, (low + high) / 2.0)
        position, gap = _closest_place(known, x, y)
        angle = math.atan2(dy, dx) - _direction_of(known, position)
        length += step
        distance += step * gap
        turn += step * abs(math.atan2(math.sin(angle), math.cos(angle)))
        weight += step
    if weight == 0.0:
        return ends[0], ends[1], ends[2], ends[3], 0.0, math.inf, math.inf, cases
    return ends[0], ends[1], ends[2], ends[3], length, distance / weight, turn / weight, cases


@dataclass(frozen=True, slots=True, eq=False)
class Way:
    """Points along a curve.

    Attributes
    ----------
    points : (n, 2) float64
        In order, at least 2 [m].
    weights : (n,) float64
        How much is known of each.
    """

    points: NDArray[np.float64]
    weights: NDArray[np.float64]

    @property
    def length(self) -> float:
        """Length of the way [m]."""
        return float(lengths_along(self.points)[-1])


@dataclass(frozen=True, slots=True)
class Places:
    """Where two ways run together, see `find_overlap`."""

    seen_from: float
    seen_to: float
    known_from: float
    known_to: float
    length: float


def common_places(seen: Way, known: Way, settings: AssociationSettings) -> Places | None:
    """Return where two ways run together, None if they are not of one wall."""
    seen_from, seen_to, known_from, known_to, length, distance, turn, _ = _find_overlap(seen.points, known.points)
    if length < settings.least_overlap or distance > settings.mean_distance or turn > settings.mean_turn:
        return None
    return Places(seen_from, seen_to, known_from, known_to, length)


def join(seen: Way, known: Way, places: Places, settings: MapSettings) -> tuple[Way, bool]:
    """Return the joint polyline of both, and whether it extends the known one.

    It does if the seen one goes beyond an end of the known one.
    """
    most = len(seen.points) + len(known.points) + 4
    points, weights = np.empty((most, 2)), np.empty(most)
    numbers = np.array([places.seen_from, places.seen_to, places.known_from, places.known_to])
    rule = _JoinRule(settings.most_weight, settings.least_extension, settings.blend_length)
    count, extends = _join(
        _Weighted(seen.points, seen.weights),
        _Weighted(known.points, known.weights),
        numbers,
        rule,
        _Weighted(points, weights),
    )
    return Way(points[:count].copy(), weights[:count].copy()), bool(extends)


@kernel
def lengths_along(points: Array) -> Array:
    """Return how far along a way of points (n, 2) each lies, shape (n,) [m]."""
    lengths = np.zeros(points.shape[0])
    for k in range(1, points.shape[0]):
        dx, dy = points[k, 0] - points[k - 1, 0], points[k, 1] - points[k - 1, 1]
        lengths[k] = lengths[k - 1] + math.sqrt(dx * dx + dy * dy)
    return lengths


@kernel
def _length_between(way: Array, low: float, high: float) -> float:
    """Return the length of a way between two places [m]."""
    total = 0.0
    for k in range(max(int(low), 0), min(int(math.ceil(high)), way.shape[0] - 1)):
        dx, dy = way[k + 1, 0] - way[k, 0], way[k + 1, 1] - way[k, 1]
        share = min(high, k + 1.0) - max(low, float(k))
        if share > 0.0:
            total += share * math.sqrt(dx * dx + dy * dy)
    return total


@kernel
def _weight_at(weights: Array, place: float) -> float:
    k = min(max(int(place), 0), weights.shape[0] - 2)
    share = place - k
    return float(weights[k] + share * (weights[k + 1] - weights[k]))


class _Weighted(NamedTuple):
    """The arrays of a ``Way``: points (n, 2) [m] and weights (n,)."""

    points: Array
    weights: Array


class _JoinRule(NamedTuple):
    """How ways are joined; see ``MapSettings``."""

    most_weight: float
    least_extension: float
    blend_length: float


@kernel
def _join(
    seen_way: _Weighted, known_way: _Weighted, places: Array, rule: _JoinRule, joined: _Weighted
) -> tuple[int, bool]:
    """Write the joined way.

    Return its number of points and whether the seen way goes beyond an end of the known one.
    """
    (seen, seen_weights), (known, known_weights), (points, weights) = seen_way, known_way, joined
    most_weight, least_extension, blend = rule
    seen_from, seen_to, known_from, known_to = places
    last_seen, last_known = seen.shape[0] - 1.0, known.shape[0] - 1.0
    head = known_from <= 0.0 and _length_between(seen, 0.0, seen_from) >= least_extension
    tail = known_to >= last_known and _length_between(seen, seen_to, last_seen) >= least_extension
    count = 0
    if head:
        x, y = _point_of(seen, seen_from)
        offset_x, offset_y = _shift(
            known[0, 0], known[0, 1], known_weights[0], x, y, _weight_at(seen_weights, seen_from)
        )
        for k in range(int(math.ceil(seen_from))):
            fade = max(1.0 - _length_between(seen, float(k), seen_from) / blend, 0.0)
            points[count, 0], points[count, 1] = seen[k, 0] + fade * offset_x, seen[k, 1] + fade * offset_y
            weights[count] = seen_weights[k]
            count += 1
    for k in range(known.shape[0]):
        points[count, 0], points[count, 1], weights[count] = known[k, 0], known[k, 1], known_weights[k]
        if known_from <= k <= known_to:
            position, _ = _closest_place(seen, known[k, 0], known[k, 1])
            # What lies beside an end of the seen way is not what it saw.
            if 0.0 < position < last_seen or k in (known_from, known_to):
                x, y = _point_of(seen, position)
                weight = _weight_at(seen_weights, position)
                if known_from > 0.0:
                    weight *= _ramp(_length_between(known, known_from, float(k)), blend)
                if known_to < last_known:
                    weight *= _ramp(_length_between(known, float(k), known_to), blend)
                shift_x, shift_y = _shift(x, y, weight, known[k, 0], known[k, 1], known_weights[k])
                points[count, 0] += shift_x
                points[count, 1] += shift_y
                weights[count] = min(known_weights[k] + weight, most_weight)
        count += 1
    if tail:
        x, y = _point_of(seen, seen_to)
        end = known.shape[0] - 1
        offset_x, offset_y = _shift(
            known[end, 0], known[end, 1], known_weights[end], x, y, _weight_at(seen_weights, seen_to)
        )
        for k in range(int(math.floor(seen_to)) + 1, seen.shape[0]):
            fade = max(1.0 - _length_between(seen, seen_to, float(k)) / blend, 0.0)
            points[count, 0], points[count, 1] = seen[k, 0] + fade * offset_x, seen[k, 1] + fade * offset_y
            weights[count] = seen_weights[k]
            count += 1
    return count, head or tail


@kernel
def _ramp(length: float, blend: float) -> float:
    """Return the weight share of a seen polyline at a distance from its end.

    It avoids a step where the known one goes on alone.
    """
    return min((length + 1e-3) / blend, 1.0)


@kernel
def _shift(x: float, y: float, weight: float, from_x: float, from_y: float, from_weight: float) -> tuple[float, float]:
    """Return how the weighted mean of two points differs from the second."""
    share = weight / (weight + from_weight)
    return share * (x - from_x), share * (y - from_y)
