"""Fast lookup of the piece of a curve nearest to a place.

A grid of cells around the robot holds the nearest piece of each.
"""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.splines.curve import Curve, curves_in

CELL = 0.05
"""Side of a cell [m]."""

PIECE, STRAIGHT = 0.5, 0.001
"""Largest length of straight pieces, and their deviation from the curve [m].

Curves are looked up as such pieces; the length is approximate.
"""


class CurveLookup:
    """The curves of a map around a place.

    Parameters
    ----------
    reach : float
        How far from the place curves are known [m].
    distance : float
        How far from a curve a place may be to know it [m].

    Attributes
    ----------
    pieces : (n, 5) float64
        Middle x, y, unit vector along, half length [m].
    nearest : (cells, cells) int32
        Nearest piece of each cell, -1 where there is none; row 0 at the lowest y.
    frame : (3,) float64
        x, y of the lower left corner of cell (0, 0), and the distance up to which a piece counts [m].
    """

    def __init__(self, reach: float, distance: float) -> None:
        self.reach, self.distance = reach, distance
        cells = 2 * math.ceil((reach + 1.0) / CELL)
        self.nearest = np.full((cells, cells), -1, np.int32)
        self._gaps = np.empty((cells, cells), np.float32)
        self.pieces = np.empty((0, 5))
        self.frame = np.array([0.0, 0.0, distance])
        self._centre = np.full(2, np.inf)

    def covers(self, place: NDArray[np.float64]) -> bool:
        """Return whether the curves within reach of a place (2,) are known."""
        return bool(np.abs(place - self._centre).max() <= 1.0)

    def renew(self, curves: list[Curve], place: NDArray[np.float64]) -> None:
        """Take the curves around a place (2,) [m]."""
        side = self.nearest.shape[0] * CELL
        self._centre = np.array(place, np.float64)
        self.frame[:2] = self._centre - side / 2.0
        low_x, low_y = self.frame[:2].tolist()
        ways = [
            curves[index].way.points
            for index in curves_in(curves, (low_x, low_y, low_x + side, low_y + side))
        ]
        ends = np.cumsum(np.array([len(way) for way in ways], np.int64))
        self.pieces = _pieces_of(np.concatenate([np.empty((0, 2)), *ways]), ends)
        self.nearest.fill(-1)
        self._gaps.fill(np.inf)
        _stamp(self.pieces, self.frame, self.nearest, self._gaps)

    def look_up(self, points: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return the nearest pieces of points (m, 2), and the distances [m].

        Each is (m,). Without a piece: -1, and inf as its distance.
        """
        pieces, gaps = np.empty(len(points), np.int64), np.empty(len(points))
        _look_up(
            np.ascontiguousarray(points, np.float64), self.pieces, self.nearest, self.frame, pieces, gaps
        )
        return pieces, gaps


@kernel
def _pieces_of(points: Array, ends: Array) -> Array:
    """Return the straight pieces of polylines stored one after another.

    They lie in ``points``, each up to its number of ``ends``.
    """
    pieces = np.empty((points.shape[0], 5))
    count, first = 0, 0
    for way in range(ends.shape[0]):
        last = ends[way] - 1
        while first < last:
            end = first + 1
            while end < last and _is_straight(points, first, end + 1):
                end += 1
            x, y = points[end, 0] - points[first, 0], points[end, 1] - points[first, 1]
            length = max(math.sqrt(x * x + y * y), 1e-9)
            pieces[count, 0], pieces[count, 1] = points[first, 0] + x / 2.0, points[first, 1] + y / 2.0
            pieces[count, 2], pieces[count, 3], pieces[count, 4] = x / length, y / length, length / 2.0
            count += 1
            first = end
        first = last + 1
    return pieces[:count].copy()


@kernel
def _is_straight(points: Array, first: int, last: int) -> bool:
    """Return whether a polyline is straight and short enough to be one piece.

    Between two of its points.
    """
    x, y = points[last, 0] - points[first, 0], points[last, 1] - points[first, 1]
    squared = x * x + y * y
    if squared > PIECE * PIECE:
        return False
    for k in range(first + 1, last):
        aside = x * (points[k, 1] - points[first, 1]) - y * (points[k, 0] - points[first, 0])
        if aside * aside > STRAIGHT * STRAIGHT * squared:
            return False
    return True


@kernel(forceinline=True)
def piece_distance(pieces: Array, piece: int, x: float, y: float) -> float:
    """Return the distance of a point from a straight piece [m]."""
    dx, dy = x - pieces[piece, 0], y - pieces[piece, 1]
    along = abs(dx * pieces[piece, 2] + dy * pieces[piece, 3]) - pieces[piece, 4]
    aside = dy * pieces[piece, 2] - dx * pieces[piece, 3]
    if along <= 0.0:
        return float(abs(aside))
    return math.sqrt(aside * aside + along * along)


@kernel(forceinline=True)
def piece_at(nearest: Array, frame: Array, x: float, y: float) -> int:
    """Return the nearest piece of a place, -1 where there is none."""
    column, row = int((x - frame[0]) * (1.0 / CELL)), int((y - frame[1]) * (1.0 / CELL))
    if x < frame[0] or y < frame[1] or row >= nearest.shape[0] or column >= nearest.shape[1]:
        return -1
    return int(nearest[row, column])


@kernel
def _look_up(points: Array, pieces: Array, nearest: Array, frame: Array, found: Array, gaps: Array) -> None:
    for k in range(points.shape[0]):
        piece = piece_at(nearest, frame, points[k, 0], points[k, 1])
        gap = piece_distance(pieces, piece, points[k, 0], points[k, 1]) if piece >= 0 else math.inf
        found[k], gaps[k] = (piece, gap) if gap <= frame[2] else (-1, math.inf)


@kernel
def _stamp(pieces: Array, frame: Array, nearest: Array, gaps: Array) -> None:
    """Write to each cell near a piece the piece nearest to the cell's middle."""
    rows, columns = nearest.shape
    reach = frame[2] + CELL
    for k in range(pieces.shape[0]):
        half_x, half_y = abs(pieces[k, 2]) * pieces[k, 4] + reach, abs(pieces[k, 3]) * pieces[k, 4] + reach
        x, y = pieces[k, 0] - frame[0], pieces[k, 1] - frame[1]
        first_row, last_row = max(int((y - half_y) / CELL), 0), min(int((y + half_y) / CELL), rows - 1)
        first_column, last_column = (
            max(int((x - half_x) / CELL), 0),
            min(int((x + half_x) / CELL), columns - 1),
        )
        for row in range(first_row, last_row + 1):
            for column in range(first_column, last_column + 1):
                middle_x, middle_y = frame[0] + (column + 0.5) * CELL, frame[1] + (row + 0.5) * CELL
                gap = piece_distance(pieces, k, middle_x, middle_y)
                if gap <= reach and gap < gaps[row, column]:
                    gaps[row, column] = gap
                    nearest[row, column] = k
