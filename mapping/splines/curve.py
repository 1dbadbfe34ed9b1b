"""A curve of the map.

A spline, how well each part of it is known, and quantities derived from it once.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.splines.curves.basis import ORDER
from lidarium.mapping.splines.curves.bspline import Spline
from lidarium.mapping.splines.curves.fitting import fit_bspline
from lidarium.mapping.splines.curves.settings import FitSettings, MapSettings
from lidarium.mapping.splines.joining import Way, lengths_along

STRAIGHT = 0.02
"""A curve that stays this close to its chord is a line [m]."""

Box = tuple[float, float, float, float]
"""Least x, y and greatest x, y [m]."""

_END_WEIGHT = 4.0

LEAST_LINE = 0.4
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
        Middle x, y, direction [rad] and half length [m], where the curve is a line.
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


def make_curve(
    spline: Spline, weights: NDArray[np.float64], count: int, last_seen: int, spacing: float
) -> Curve:
    """Return a curve whose way has points ``spacing`` apart [m].

    Raises
    ------
    ValueError
        Where there are not as many weights as control points.
    """
    if np.shape(weights) != (len(spline.control_points),):
        raise ValueError(
            f"weights have shape {np.shape(weights)}; the curve has {len(spline.control_points)} control "
            "points"
        )
    parameters = spline.sample_parameters(spacing)
    points = spline.evaluate(parameters)
    way = Way(points, np.interp(parameters, control_parameters(spline.knots), weights))
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
    shares = control_parameters(spline.knots) / spline.domain[1]
    weights = np.interp(shares * lengths[-1], lengths, way.weights)
    return make_curve(spline, weights, count, last_seen, settings.sample_spacing)


def curves_in(curves: list[Curve], box: Box) -> list[int]:
    """Return the numbers of the curves whose boxes meet a box."""
    low_x, low_y, high_x, high_y = box
    # A loop over some tens of curves takes less time than numpy needs to gather their boxes.
    return [
        index
        for index, curve in enumerate(curves)
        if curve.box[0] <= high_x
        and curve.box[2] >= low_x
        and curve.box[1] <= high_y
        and curve.box[3] >= low_y
    ]


def control_parameters(knots: NDArray[np.float64]) -> NDArray[np.float64]:
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
    if not (length >= LEAST_LINE and highest - lowest <= STRAIGHT):
        return False
    mean = total / (last + 1)
    line[0] = (points[0, 0] + points[last, 0]) / 2.0 - mean * y / length
    line[1] = (points[0, 1] + points[last, 1]) / 2.0 + mean * x / length
    line[2], line[3] = math.atan2(y, x), length / 2.0
    return True
