"""Codes whose box is mostly empty are cut: a box around a corner bars what lies inside of it.

The points of a code are parted at the plane across an axis that leaves least room in the boxes of both
sides, as trees of boxes are built; the parts likewise, as long as enough room is gained.

References
----------
I. Wald, "On fast construction of SAH-based bounding volume hierarchies", Symposium on Interactive Ray Tracing
2007: planes between bins of points.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel

BINS = 16
"""Slices of a box; it is cut between two of them."""

LEAST_GAIN = 0.25
"""Share of a box that both of its parts have to leave out."""

LEAST_POINTS = 3
"""Points that each part has to have."""

LEAST_SIDE_M = 0.05
"""A box with no longer side is left whole [m]."""


def cut_labels(
    points: NDArray[np.float64], labels: NDArray[np.int64], pad: float, most: int | None = None
) -> NDArray[np.int64]:
    """Return the labels of points after codes with much empty room were cut.

    Parameters
    ----------
    points : (N, 3) float64
        Points [m].
    labels : (N,) int64
        Code of each point, from 0; each code has one.
    pad : float
        By how much boxes are taken to be larger along each axis, as flat ones have no room [m].
    most : int or None
        How many cuts are made, those that gain most room; None for all.

    Returns
    -------
    (N,) int64
        Labels from 0; points of different codes still have different ones.
    """
    if most == 0:
        return labels
    order = np.argsort(labels, kind="stable")
    starts = np.append(np.flatnonzero(np.diff(labels[order], prepend=-1)), len(labels))
    ranked, found = points[order], np.empty(len(labels), np.int64)
    parts, gains = _cut(ranked, starts, pad, 0.0)
    if most is not None and len(gains) > most:
        # A part of what gains less than these is not reached: there may be fewer cuts, never more.
        parts, _ = _cut(ranked, starts, pad, float(np.nextafter(np.sort(gains)[-most - 1], np.inf)))
    found[order] = parts
    return np.unique(found, return_inverse=True)[1]


@kernel
def _cut(points: Array, starts: Array, pad: float, least: float) -> tuple[Array, Array]:
    """Cut points (N, 3) that are sorted by their codes; return the part of each, and what each cut gains."""
    count = points.shape[0]
    order, other = np.arange(count), np.empty(count, np.int64)
    bounds, parts = np.empty((BINS + 2, 6)), np.empty(count, np.int64)
    firsts, lasts = np.empty(count, np.int64), np.empty(count, np.int64)
    gains, cuts = np.empty(count), 0
    for code in range(starts.shape[0] - 1):
        firsts[0], lasts[0], waiting = starts[code], starts[code + 1], 1
        while waiting > 0:
            waiting -= 1
            first, last = firsts[waiting], lasts[waiting]
            axis, plane, gain = _best_plane(points, order[first:last], pad, bounds)
            middle = first
            if axis >= 0 and gain >= least:
                middle = _part(points[:, axis], order, first, last, plane, other)
            if middle - first < LEAST_POINTS or last - middle < LEAST_POINTS:
                for place in range(first, last):
                    parts[order[place]] = first
                continue
            gains[cuts] = gain
            cuts += 1
            firsts[waiting], lasts[waiting] = first, middle
            firsts[waiting + 1], lasts[waiting + 1] = middle, last
            waiting += 2
    return parts, gains[:cuts]


@kernel(nrt=False)
def _best_plane(points: Array, members: Array, pad: float, bounds: Array) -> tuple[int, float, float]:
    """Return axis and place of the plane that leaves least room, and the gain; -1 where that is too small."""
    whole, around = bounds[BINS], bounds[BINS + 1]
    _begin(whole)
    for member in members:
        _widen(whole, points[member], points[member])
    best_axis, best_plane, least = -1, 0.0, (1.0 - LEAST_GAIN) * _room(whole, pad)
    for axis in range(3):
        side = whole[axis + 3] - whole[axis]
        if side < LEAST_SIDE_M:
            continue
        for slot in range(BINS):
            _begin(bounds[slot])
        for member in members:
            slot = min(int((points[member, axis] - whole[axis]) / side * BINS), BINS - 1)
            _widen(bounds[slot], points[member], points[member])
        for plane in range(1, BINS):
            room = _room_of(bounds[:plane], pad, around) + _room_of(bounds[plane:BINS], pad, around)
            if room < least:
                best_axis, best_plane, least = axis, whole[axis] + side * plane / BINS, room
    return best_axis, best_plane, _room(whole, pad) - least


@kernel(nrt=False)
def _room_of(bounds: Array, pad: float, around: Array) -> Any:  # noqa: ANN401
    """Return the volume of the box around boxes (B, 6) [m3]; that box is written as well."""
    _begin(around)
    for slot in range(bounds.shape[0]):
        if bounds[slot, 0] <= bounds[slot, 3]:
            _widen(around, bounds[slot, :3], bounds[slot, 3:])
    return _room(around, pad)


@kernel(nrt=False)
def _begin(box: Array) -> None:
    """Make a box that holds nothing."""
    for axis in range(3):
        box[axis], box[axis + 3] = np.inf, -np.inf


@kernel(nrt=False)
def _widen(box: Array, low: Array, high: Array) -> None:
    for axis in range(3):
        box[axis] = min(box[axis], low[axis])
        box[axis + 3] = max(box[axis + 3], high[axis])


@kernel(nrt=False)
def _room(box: Array, pad: float) -> Any:  # noqa: ANN401
    if box[0] > box[3]:
        return 0.0
    return (box[3] - box[0] + pad) * (box[4] - box[1] + pad) * (box[5] - box[2] + pad)


@kernel(nrt=False)
def _part(values: Array, order: Array, first: int, last: int, plane: float, other: Array) -> int:
    """Sort those below a plane before the others, each in their order; return where the others begin."""
    low, high = first, 0
    for place in range(first, last):
        member = order[place]
        if values[member] < plane:
            order[low] = member
            low += 1
        else:
            other[high] = member
            high += 1
    for k in range(high):
        order[low + k] = other[k]
    return low
