"""Joint curve of two curves of one wall.

Their weighted mean where both run, and each of them where it runs alone.

Curves are joined as ways, points along them with weights. A weight is a number of observations with a
standard deviation of 1 cm.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.splines.association import closest_place, find_overlap, point_of
from lidarium.mapping.splines.curves.settings import AssociationSettings, MapSettings


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
    """Return where two ways run together, None where they are not of one wall."""
    seen_from, seen_to, known_from, known_to, length, distance, turn, _ = find_overlap(
        seen.points, known.points
    )
    if length < settings.least_overlap or distance > settings.mean_distance or turn > settings.mean_turn:
        return None
    return Places(seen_from, seen_to, known_from, known_to, length)


def join(seen: Way, known: Way, places: Places, settings: MapSettings) -> tuple[Way, bool]:
    """Return the joint polyline of both, and whether it extends the known one.

    It does where the seen one goes beyond an end of the known one.
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
        x, y = point_of(seen, seen_from)
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
            place, _ = closest_place(seen, known[k, 0], known[k, 1])
            # What lies beside an end of the seen way is not what it saw.
            if 0.0 < place < last_seen or k in (known_from, known_to):
                x, y = point_of(seen, place)
                weight = _weight_at(seen_weights, place)
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
        x, y = point_of(seen, seen_to)
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
def _shift(
    x: float, y: float, weight: float, from_x: float, from_y: float, from_weight: float
) -> tuple[float, float]:
    """Return how the weighted mean of two points differs from the second."""
    share = weight / (weight + from_weight)
    return share * (x - from_x), share * (y - from_y)
