"""A curve of the map.

A spline, how well each part of it is known, and quantities derived from it once.

A grid of cells around the robot holds the nearest piece of each cell, for fast lookup.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.splines.association import Way, lengths_along
from lidarium.mapping.splines.bspline import ORDER, Spline
from lidarium.mapping.splines.fitting import fit_bspline
from lidarium.mapping.splines.settings import FitSettings, MapSettings

STRAIGHT = 0.02
"""A curve that stays this close to its chord is a line [m]."""

Box = tuple[float, float, float, float]
"""Least x, y and greatest x, y [m]."""

_END_WEIGHT = 4.0

MIN_LINE = 0.4
"""Shorter lines have no clear direction [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """A wall as the map has it.

    Attributes
    ----------
    spline : Spline
        Its shape.
    weights : (n,) float64
        How much is known at each control point, as a number of observations with a standard deviation of 1
        cm.
    count : int
        How many scans have seen it.
    last_seen : int
        The map's update that saw it last.
    way : Way
        Points along it, for comparisons.
    box : (float, float, float, float)
        Least x, y and greatest x, y [m].
    line : (4,) float64 or None
        Middle x, y, direction [rad] and half length [m], if the curve is a line.
    """

    spline: Spline
    weights: NDArray[np.float64]
    count: int
    last_seen: int
    way: Way
    box: Box
    line: NDArray[np.float64] | None

    def moved(self, pose: Transform) -> "Curve":
        """Return the curve in the frame in which its own has a pose."""
        points = pose.apply(self.way.points)
        line = np.empty(4)
        return Curve(
            Spline(self.spline.knots, pose.apply(self.spline.control_points)),
            self.weights,
            self.count,
            self.last_seen,
            Way(points, self.way.weights),
            box_of(points),
            line if _find_line(points, line) else None,
        )


def make_curve(spline: Spline, weights: NDArray[np.float64], count: int, last_seen: int, spacing: float) -> Curve:
    """Return a curve with points of its way ``spacing`` apart [m]."""
    if np.shape(weights) != (len(spline.control_points),):
        raise ValueError(
            f"weights have shape {np.shape(weights)}; the curve has {len(spline.control_points)} control points"
        )
    parameters = spline.sample_parameters(spacing)
    points = spline.evaluate(parameters)
    way = Way(points, np.interp(parameters, _control_parameters(spline.knots), weights))
    line = np.empty(4)
    is_line = _find_line(points, line)
    return Curve(
        spline,
        np.asarray(weights, np.float64),
        count,
        last_seen,
        way,
        box_of(points),
        line if is_line else None,
    )


def fit_curve(way: Way, count: int, last_seen: int, fit: FitSettings, settings: MapSettings) -> Curve:
    """Fit a curve to a way."""
    fitting = FitSettings(
        spacing=fit.spacing,
        finest_spacing=fit.finest_spacing,
        rms=settings.rms,
        explained=0.0,
        is_sparse=fit.is_sparse,
        stiffness=fit.stiffness,
    )
    weights = way.weights.copy()
    # An end of little weight would be left to the rest of the curve, and run away fit by fit.
    weights[[0, -1]] = _END_WEIGHT * weights.max()
    spline = fit_bspline(way.points, fitting, 0.01 / np.sqrt(weights)).spline
    lengths = lengths_along(way.points)
    shares = _control_parameters(spline.knots) / spline.domain[1]
    weights = np.interp(shares * lengths[-1], lengths, way.weights)
    return make_curve(spline, weights, count, last_seen, settings.sample_spacing)


def curves_in(curves: list[Curve], box: Box) -> list[int]:
    """Return the indices of the curves with boxes that meet a box."""
    low_x, low_y, high_x, high_y = box
    # A loop over some tens of curves takes less time than numpy needs to gather their boxes.
    return [
        index
        for index, curve in enumerate(curves)
        if curve.box[0] <= high_x and curve.box[2] >= low_x and curve.box[1] <= high_y and curve.box[3] >= low_y
    ]


def _control_parameters(knots: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the parameter at which each control point acts most, (n,) [m].

    The mean of its three inner knots (Greville).
    """
    count = len(knots) - ORDER
    return np.asarray((knots[1 : count + 1] + knots[2 : count + 2] + knots[3 : count + 3]) / 3.0)


@kernel
def box_of(points: Array) -> Box:
    """Return the box around points (n, 2)."""
    low_x, low_y, high_x, high_y = math.inf, math.inf, -math.inf, -math.inf
    for k in range(points.shape[0]):
        low_x, low_y = min(low_x, points[k, 0]), min(low_y, points[k, 1])
        high_x, high_y = max(high_x, points[k, 0]), max(high_y, points[k, 1])
    return low_x, low_y, high_x, high_y


@kernel
def _find_line(points: Array, line: Array) -> bool:
    """Write the line through a way.

    Return whether the way is long and straight enough to be one.
    """
    last = points.shape[0] - 1
    x, y = points[last, 0] - points[0, 0], points[last, 1] - points[0, 1]
    length = math.sqrt(x * x + y * y)
    lowest, highest, total = 0.0, 0.0, 0.0
    for k in range(last + 1):
        aside = (x * (points[k, 1] - points[0, 1]) - y * (points[k, 0] - points[0, 0])) / length
        lowest, highest, total = min(lowest, aside), max(highest, aside), total + aside
    if not (length >= MIN_LINE and highest - lowest <= STRAIGHT):
        return False
    mean = total / (last + 1)
    line[0] = (points[0, 0] + points[last, 0]) / 2.0 - mean * y / length
    line[1] = (points[0, 1] + points[last, 1]) / 2.0 + mean * x / length
    line[2], line[3] = math.atan2(y, x), length / 2.0
    return True


CELL = 0.05
"""Side of a cell [m]."""

PIECE, NEARLY_STRAIGHT = 0.5, 0.001
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
        Nearest piece of each cell, -1 if there is none; row 0 at the lowest y.
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
        ways = [curves[index].way.points for index in curves_in(curves, (low_x, low_y, low_x + side, low_y + side))]
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
        _look_up(np.ascontiguousarray(points, np.float64), self.pieces, self.nearest, self.frame, pieces, gaps)
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
        if aside * aside > NEARLY_STRAIGHT * NEARLY_STRAIGHT * squared:
            return False
    return True


@kernel(forceinline=True)
def _piece_distance(pieces: Array, piece: int, x: float, y: float) -> float:
    """Return the distance of a point from a straight piece [m]."""
    dx, dy = x - pieces[piece, 0], y - pieces[piece, 1]
    along = abs(dx * pieces[piece, 2] + dy * pieces[piece, 3]) - pieces[piece, 4]
    aside = dy * pieces[piece, 2] - dx * pieces[piece, 3]
    if along <= 0.0:
        return float(abs(aside))
    return math.sqrt(aside * aside + along * along)


@kernel(forceinline=True)
def _piece_at(nearest: Array, frame: Array, x: float, y: float) -> int:
    """Return the nearest piece of a place, -1 if there is none."""
    column, row = int((x - frame[0]) * (1.0 / CELL)), int((y - frame[1]) * (1.0 / CELL))
    if x < frame[0] or y < frame[1] or row >= nearest.shape[0] or column >= nearest.shape[1]:
        return -1
    return int(nearest[row, column])


@kernel
def _look_up(points: Array, pieces: Array, nearest: Array, frame: Array, found: Array, gaps: Array) -> None:
    for k in range(points.shape[0]):
        piece = _piece_at(nearest, frame, points[k, 0], points[k, 1])
        gap = _piece_distance(pieces, piece, points[k, 0], points[k, 1]) if piece >= 0 else math.inf
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
                gap = _piece_distance(pieces, k, middle_x, middle_y)
                if gap <= reach and gap < gaps[row, column]:
                    gaps[row, column] = gap
                    nearest[row, column] = k
