"""Floors with few corners, drawn from a seed, and what a robot's laser sees of them.

Halls have slanted walls, pillars and doors into closets; corridors have doors on both sides, into rooms of
unlike depths. No furniture stands in them.
"""

import math
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import FREE, OCCUPIED, UNKNOWN

SIDE_M = 0.05
"""Side of a cell [m]."""

KINDS = ("hall", "corridor")

_WALL = 3
_BEAMS, _REACH_M, _NOISE_M = 720, 8.0, 0.03
_STAND_M = 0.4


class View(NamedTuple):
    """What a robot has seen.

    Attributes
    ----------
    levels : (rows, columns) uint8
        Its map, in a frame of its own.
    map_from_floor : Transform
        How the floor lies in it.
    known : (rows, columns) bool
        Cells of the floor that it has seen.
    """

    levels: NDArray[np.uint8]
    map_from_floor: Transform
    known: NDArray[np.bool_]


def drawn_floor(kind: str, seed: int) -> NDArray[np.uint8]:
    """Return a floor in three levels, unknown outside.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    seed : int
        Of all draws.
    """
    generator = np.random.default_rng((KINDS.index(kind), seed))
    free = np.zeros((440, 640), np.uint8)
    (_draw_hall if kind == "hall" else _draw_corridor)(free, generator)
    walls = cv2.dilate(free, np.ones((2 * _WALL + 1, 2 * _WALL + 1), np.uint8))
    return np.where(free > 0, FREE, np.where(walls > 0, OCCUPIED, UNKNOWN)).astype(np.uint8)


def _draw_hall(free: NDArray[np.uint8], generator: np.random.Generator) -> None:
    """Draw a hall of five to seven slanted sides, with pillars and a closet or two."""
    count = int(generator.integers(5, 8))
    angles = (np.arange(count) + generator.uniform(-0.3, 0.3, count)) * (2.0 * math.pi / count)
    radii = generator.uniform(95, 150, count)
    corners = np.column_stack([320 + 1.4 * radii * np.cos(angles), 220 + radii * np.sin(angles)])
    cv2.fillPoly(free, [np.rint(corners).astype(np.int32)], (1,))
    for index in generator.choice(count, 2, replace=False).tolist():
        middle = 0.5 * (corners[index] + corners[(index + 1) % count])
        outwards = (middle - (320, 220)) / np.linalg.norm(middle - (320, 220))
        ends = np.array([middle - 6 * outwards, middle + (_WALL + 12) * outwards])
        cv2.polylines(free, [np.rint(ends).astype(np.int32)], False, (1,), 18)
        room = cv2.boxPoints(
            (
                tuple((middle + 40 * outwards).tolist()),
                (52.0, 52.0),
                math.degrees(math.atan2(outwards[1], outwards[0])),
            )
        )
        cv2.fillPoly(free, [np.rint(room).astype(np.int32)], (1,))
    for x, y in generator.uniform((250, 170), (390, 270), (3, 2)).astype(int).tolist():
        cv2.circle(free, (x, y), 5, (0,), -1)


def _draw_corridor(free: NDArray[np.uint8], generator: np.random.Generator) -> None:
    """Draw a corridor with rooms on both sides, each behind a door."""
    half = int(generator.integers(16, 24))
    length = int(generator.integers(380, 520))
    free[220 - half : 220 + half, 60 : 60 + length] = 1
    for side in (-1, 1):
        left = 60
        while left < 60 + length - 50:
            width = min(int(generator.integers(50, 110)), 60 + length - left)
            depth = int(generator.integers(50, 110))
            near, far = 220 + side * (half + _WALL), 220 + side * (half + _WALL + depth)
            free[min(near, far) : max(near, far), left : left + width] = 1
            door = left + int(generator.integers(6, width - 24))
            gap = 220 + side * half, near
            free[min(gap) : max(gap), door : door + int(generator.integers(16, 21))] = 1
            left += width + _WALL


def seen_by(
    floor: NDArray[np.uint8], share: tuple[float, float], map_from_floor: Transform, seed: tuple[int, ...]
) -> View:
    """Return what a robot sees from places within a part of a floor.

    Parameters
    ----------
    floor : (rows, columns) uint8
        The floor.
    share : (from, to)
        The part, along its columns.
    map_from_floor : Transform
        How it lies in the robot's map.
    seed : tuple of int
        Of places and noise.
    """
    generator = np.random.default_rng(seed)
    clear = cv2.distanceTransform((floor == FREE).astype(np.uint8), cv2.DIST_L2, 5) * SIDE_M
    rows, columns = np.nonzero(clear > _STAND_M)
    low, high = np.quantile(columns, share)
    places = np.flatnonzero((columns >= low) & (columns <= high))
    shape = (820, 820)
    known, levels = np.zeros(floor.shape, np.bool_), np.full(shape, UNKNOWN, np.uint8)
    for place in generator.choice(places, 9, replace=False).tolist():
        middle = (np.array((columns[place], rows[place])) + 0.5) * SIDE_M
        free, hits = _scan(floor, middle, generator)
        for points, level in ((free, FREE), (hits, OCCUPIED)):
            x, y = np.floor(points / SIDE_M).astype(np.int64).T
            known[np.clip(y, 0, floor.shape[0] - 1), np.clip(x, 0, floor.shape[1] - 1)] = True
            x, y = np.floor(map_from_floor.apply(points) / SIDE_M).astype(np.int64).T
            is_on = (x >= 0) & (y >= 0) & (x < shape[1]) & (y < shape[0])
            levels[y[is_on], x[is_on]] = np.where(levels[y[is_on], x[is_on]] == OCCUPIED, OCCUPIED, level)
    return View(levels, map_from_floor, known)


def _scan(
    floor: NDArray[np.uint8], middle: NDArray[np.float64], generator: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return points of free space along the beams, and where they end on walls, both (n, 2) [m]."""
    angles = np.arange(_BEAMS) * (2.0 * math.pi / _BEAMS)
    ahead = np.column_stack([np.cos(angles), np.sin(angles)])
    ranges = np.arange(0.0, _REACH_M, 0.5 * SIDE_M)
    points = middle + ranges[None, :, None] * ahead[:, None]
    cells = np.floor(points / SIDE_M).astype(np.int64)
    x = np.clip(cells[..., 0], 0, floor.shape[1] - 1)
    y = np.clip(cells[..., 1], 0, floor.shape[0] - 1)
    is_wall = floor[y, x] != FREE
    ends = np.where(is_wall.any(axis=1), is_wall.argmax(axis=1), len(ranges))
    measured = ranges[np.minimum(ends, len(ranges) - 1)] + generator.normal(0.0, _NOISE_M, _BEAMS)
    is_hit = ends < len(ranges)
    is_free = ranges[None] < measured[:, None] - SIDE_M
    return points[is_free], (middle + measured[:, None] * ahead)[is_hit]
