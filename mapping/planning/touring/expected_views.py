"""Views of a map of probabilities: how much unseen area is probably seen from where, and places that see all of it.

A cell is seen with the probability that all cells before it on the ray are free.
"""

import math

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
    rays = _rays(GAIN_RAYS), _rays(MARK_RAYS)
    chosen, gains = _cover(free, unseen.copy(), places, rays, reach, least, spare, most)
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
    return np.asarray(_shares_left(free, unseen, stops, views, (_rays(GAIN_RAYS), _rays(MARK_RAYS)), reach))


def _rays(count: int) -> NDArray[np.float64]:
    angles = (np.arange(count) + 0.5) * (2.0 * math.pi / count)
    return np.stack([np.sin(angles), np.cos(angles)], axis=1)


@kernel
def _area(free: Array, worth: Array, row: int, column: int, rays: Array, reach: int) -> float:
    """Return the expected area in view, weighted by the worth of its cells [cells]."""
    rows, columns = free.shape
    area = 0.0
    for ray in range(rays.shape[0]):
        passed = 1.0
        for step in range(1, reach + 1):
            at_row = int(math.floor(row + 0.5 + step * rays[ray, 0]))
            at_column = int(math.floor(column + 0.5 + step * rays[ray, 1]))
            if not (0 <= at_row < rows and 0 <= at_column < columns):
                break
            area += passed * worth[at_row, at_column] * step
            passed *= free[at_row, at_column]
            if passed < DIMMEST:
                break
    return float(area * (2.0 * math.pi / rays.shape[0]))


@kernel
def _mark(free: Array, row: int, column: int, rays: Array, reach: int, seen: Array) -> None:
    """Raise the probability with which each cell is seen."""
    rows, columns = free.shape
    seen[row, column] = 1.0
    for ray in range(rays.shape[0]):
        passed = 1.0
        for step in range(1, reach + 1):
            at_row = int(math.floor(row + 0.5 + step * rays[ray, 0]))
            at_column = int(math.floor(column + 0.5 + step * rays[ray, 1]))
            if not (0 <= at_row < rows and 0 <= at_column < columns):
                break
            seen[at_row, at_column] = max(seen[at_row, at_column], passed)
            passed *= free[at_row, at_column]
            if passed < DIMMEST:
                break


@kernel
def _window(row: int, column: int, reach: int, shape: tuple[int, int]) -> tuple[int, int, int, int]:
    return (
        max(row - reach - 1, 0),
        min(row + reach + 2, shape[0]),
        max(column - reach - 1, 0),
        min(column + reach + 2, shape[1]),
    )


@kernel
def _cover(
    free: Array,
    unseen: Array,
    places: Array,
    rays: tuple[Array, Array],
    reach: int,
    least: float,
    spare: float,
    most: int,
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    count = len(places)
    bounds = np.empty(count)
    for k in range(count):
        bounds[k] = _area(free, unseen, places[k, 0], places[k, 1], rays[0], reach)
    chosen, gains = np.empty(most, np.int64), np.empty(most)
    is_fresh = np.ones(count, np.bool_)
    number, left_area = 0, unseen.sum()
    seen = np.zeros(free.shape, np.float32)
    while number < most and left_area > spare:
        # What is left to see from a place only shrinks: the greatest bound that is fresh is the greatest of all.
        best = 0
        while True:
            best = int(np.argmax(bounds))
            if bounds[best] < least or is_fresh[best]:
                break
            bounds[best] = _area(free, unseen, places[best, 0], places[best, 1], rays[0], reach)
            is_fresh[best] = True
        if bounds[best] < least:
            break
        row, column = places[best, 0], places[best, 1]
        chosen[number], gains[number] = best, bounds[best]
        number += 1
        bounds[best] = -1.0
        is_fresh[:] = False
        _mark(free, row, column, rays[1], reach, seen)
        low, high, left, right = _window(row, column, reach, free.shape)
        for i in range(low, high):
            for j in range(left, right):
                left_area -= unseen[i, j] * seen[i, j]
                unseen[i, j] *= np.float32(1.0) - seen[i, j]
                seen[i, j] = 0.0
    return chosen[:number], gains[:number]


@kernel
def _shares_left(
    free: Array, unseen: Array, stops: Array, views: Array, rays: tuple[Array, Array], reach: int
) -> NDArray[np.float64]:
    shares = np.ones((len(views), len(stops)))
    shown = np.empty(len(stops))
    for s in range(len(stops)):
        shown[s] = _area(free, unseen, stops[s, 0], stops[s, 1], rays[0], reach)
    seen = np.zeros(free.shape, np.float32)
    rest = unseen.copy()
    for v in range(len(views)):
        row, column = views[v, 0], views[v, 1]
        _mark(free, row, column, rays[1], reach, seen)
        low, high, left, right = _window(row, column, reach, free.shape)
        for i in range(low, high):
            for j in range(left, right):
                rest[i, j] = unseen[i, j] * (np.float32(1.0) - seen[i, j])
        for s in range(len(stops)):
            if max(abs(stops[s, 0] - row), abs(stops[s, 1] - column)) <= 2 * reach and shown[s] > 0.0:
                shares[v, s] = _area(free, rest, stops[s, 0], stops[s, 1], rays[0], reach) / shown[s]
        for i in range(low, high):
            for j in range(left, right):
                rest[i, j], seen[i, j] = unseen[i, j], 0.0
    return shares
