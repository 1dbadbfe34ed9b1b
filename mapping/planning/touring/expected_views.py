"""Views of a map of probabilities: how much unseen area is probably seen from where, and places that see all of it.

A cell is seen with the probability that all cells before it on the ray are free.
"""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel

GAIN_RAYS, MARK_RAYS = 48, 180
"""Numbers of rays by which an area is measured, and by which cells are marked as seen."""

DIMMEST = 0.1
"""Rays end where they pass with a smaller probability."""


def cover(
    free: NDArray[np.float32],
    unseen: NDArray[np.float32],
    places: NDArray[np.int64],
    reach: int,
    least: float,
    spare: float,
    most: int,
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return places from which the unseen area is seen, the one that shows most first.

    They are chosen greedily (set cover); each counts what those before it leave.

    Parameters
    ----------
    free : (rows, columns) float32
        Probability that a cell is free.
    unseen : (rows, columns) float32
        Probability that a cell is free and not seen yet.
    places : (n, 2) int64
        Cells (row, column) to choose from.
    reach : int
        Range of the sensor [cells].
    least : float
        Places that show less are left out [cells].
    spare : float
        Area that may be left unseen [cells].
    most : int
        Maximum number of places.

    Returns
    -------
    (m,) int64, (m,) float64
        Numbers of the places, and the area that each shows [cells].
    """
    if len(places) == 0:
        return np.zeros(0, np.int64), np.zeros(0)
    field = _field(free, unseen, reach)
    chosen, gains = _cover(field, _cells_of(places, field), least, spare, most)
    return chosen, gains


def shares_left(
    free: NDArray[np.float32],
    unseen: NDArray[np.float32],
    stops: NDArray[np.int64],
    views: NDArray[np.int64],
    reach: int,
) -> NDArray[np.float64]:
    """Return which share of the unseen area of each stop is not seen from each view, (views, stops).

    ``stops`` (m, 2) and ``views`` (n, 2) int64 are cells (row, column); the others as in ``cover``.
    """
    field = _field(free, unseen, reach)
    return np.asarray(_shares_left(field, _cells_of(stops, field), _cells_of(views, field)))


class _Field(NamedTuple):
    """Maps with a border that no ray passes, as wide as a ray is long, and the cells that rays meet.

    Attributes
    ----------
    free, unseen : (rows * width,) float32
        The maps, row by row.
    width, reach : int
        Columns with the border, and range of the sensor [cells].
    gain_rays, mark_rays : (rays, reach) int64
        Cells that each ray meets, counted from the one where it begins.
    """

    free: NDArray[np.float32]
    unseen: NDArray[np.float32]
    width: int
    reach: int
    gain_rays: NDArray[np.int64]
    mark_rays: NDArray[np.int64]


def _field(free: NDArray[np.float32], unseen: NDArray[np.float32], reach: int) -> _Field:
    bordered = [np.pad(each, reach + 1) for each in (free, unseen)]
    width = bordered[0].shape[1]
    rays = [_rays(count, reach, width) for count in (GAIN_RAYS, MARK_RAYS)]
    return _Field(bordered[0].reshape(-1), bordered[1].reshape(-1), width, reach, *rays)


def _cells_of(places: NDArray[np.int64], field: _Field) -> NDArray[np.int64]:
    row, column = (places + field.reach + 1).T
    return np.asarray(row * field.width + column, np.int64)


@lru_cache(maxsize=8)
def _rays(count: int, reach: int, width: int) -> NDArray[np.int64]:
    angles = (np.arange(count)[:, None] + 0.5) * (2.0 * math.pi / count)
    row, column = (np.floor(0.5 + np.arange(1, reach + 1) * way(angles)) for way in (np.sin, np.cos))
    return np.asarray(row * width + column, np.int64)


@kernel(nrt=False)
def _area(free: Array, worth: Array, cell: int, rays: Array) -> float:
    """Return the expected area in view, weighted by the worth of its cells [cells]."""
    area = 0.0
    for ray in range(rays.shape[0]):
        passed = 1.0
        for step in range(rays.shape[1]):
            at = cell + rays[ray, step]
            area += passed * worth[at] * (step + 1)
            passed *= free[at]
            if passed < DIMMEST:
                break
    return float(area * (2.0 * math.pi / rays.shape[0]))


@kernel(nrt=False)
def _mark(free: Array, cell: int, rays: Array, seen: Array) -> None:
    """Raise the probability with which each cell is seen."""
    seen[cell] = 1.0
    for ray in range(rays.shape[0]):
        passed = 1.0
        for step in range(rays.shape[1]):
            at = cell + rays[ray, step]
            seen[at] = max(seen[at], passed)
            passed *= free[at]
            if passed < DIMMEST:
                break


@kernel
def _cover(
    field: _Field, places: Array, least: float, spare: float, most: int
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Choose places; the unseen area of the field is written."""
    free, unseen, count = field.free, field.unseen, len(places)
    bounds = np.empty(count)
    for k in range(count):
        bounds[k] = _area(free, unseen, places[k], field.gain_rays)
    chosen, gains = np.empty(most, np.int64), np.empty(most)
    is_fresh = np.ones(count, np.bool_)
    number, left_area = 0, unseen.sum()
    seen = np.zeros(len(free), np.float32)
    while number < most and left_area > spare:
        # What is left to see from a place only shrinks: the greatest bound that is fresh is the greatest of all.
        best = 0
        while True:
            best = int(np.argmax(bounds))
            if bounds[best] < least or is_fresh[best]:
                break
            bounds[best] = _area(free, unseen, places[best], field.gain_rays)
            is_fresh[best] = True
        if bounds[best] < least:
            break
        chosen[number], gains[number] = best, bounds[best]
        number += 1
        bounds[best] = -1.0
        is_fresh[:] = False
        _mark(free, places[best], field.mark_rays, seen)
        for row in range(-field.reach - 1, field.reach + 2):
            middle = places[best] + row * field.width
            for at in range(middle - field.reach - 1, middle + field.reach + 2):
                left_area -= unseen[at] * seen[at]
                unseen[at] *= np.float32(1.0) - seen[at]
                seen[at] = 0.0
    return chosen[:number], gains[:number]


@kernel
def _shares_left(field: _Field, stops: Array, views: Array) -> NDArray[np.float64]:
    free, unseen, width, reach = field.free, field.unseen, field.width, field.reach
    shares = np.ones((len(views), len(stops)))
    shown = np.empty(len(stops))
    for s in range(len(stops)):
        shown[s] = _area(free, unseen, stops[s], field.gain_rays)
    seen = np.zeros(len(free), np.float32)
    rest = unseen.copy()
    for v in range(len(views)):
        _mark(free, views[v], field.mark_rays, seen)
        for row in range(-reach - 1, reach + 2):
            middle = views[v] + row * width
            for at in range(middle - reach - 1, middle + reach + 2):
                rest[at] = unseen[at] * (np.float32(1.0) - seen[at])
        for s in range(len(stops)):
            rows, columns = stops[s] // width - views[v] // width, stops[s] % width - views[v] % width
            if max(abs(rows), abs(columns)) <= 2 * reach and shown[s] > 0.0:
                shares[v, s] = _area(free, rest, stops[s], field.gain_rays) / shown[s]
        for row in range(-reach - 1, reach + 2):
            middle = views[v] + row * width
            for at in range(middle - reach - 1, middle + reach + 2):
                rest[at], seen[at] = unseen[at], 0.0
    return shares
