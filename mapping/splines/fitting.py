"""Least-squares fits of cubic B-splines to ordered points.

The systems of equations are banded: a symmetric matrix is kept by its lower band, (n, 4), and row i holds
columns i, i - 1, i - 2, i - 3.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.splines.bspline import ORDER, Spline, basis_of_span, curve_length, find_span, point_at
from lidarium.mapping.splines.settings import FitSettings


@kernel
def _factorize(band: Array) -> bool:
    """Replace a banded matrix by its Cholesky factor, band for band.

    Return False if it is not positive definite.
    """
    for i in range(band.shape[0]):
        for back in range(min(i, ORDER - 1), -1, -1):
            j = i - back
            value = band[i, back]
            for k in range(max(i - ORDER + 1, j - ORDER + 1, 0), j):
                value -= band[i, i - k] * band[j, j - k]
            if back > 0:
                band[i, back] = value / band[j, 0]
            elif value <= 1e-14 * band[i, 0] or value <= 0.0:
                return False
            else:
                band[i, 0] = math.sqrt(value)
    return True


@kernel
def _solve(factor: Array, right: Array) -> None:
    """Solve for all columns of the right side, in place."""
    count = factor.shape[0]
    for column in range(right.shape[1]):
        for i in range(count):
            value = right[i, column]
            for back in range(1, min(i, ORDER - 1) + 1):
                value -= factor[i, back] * right[i - back, column]
            right[i, column] = value / factor[i, 0]
        for i in range(count - 1, -1, -1):
            value = right[i, column]
            for ahead in range(1, min(count - 1 - i, ORDER - 1) + 1):
                value -= factor[i + ahead, ahead] * right[i + ahead, column]
            right[i, column] = value / factor[i, 0]


STEP_SIGMAS = 4.0

MAX_BIAS = 3.5


class _Samples(NamedTuple):
    """Points that a curve is fitted to, in order.

    Attributes
    ----------
    points : (m, 2) float64
        Their positions [m].
    sigmas : (m,) float64
        Their standard deviations [m].
    parameters : (m,) float64
        How far along the chords each lies [m].
    """

    points: Array
    sigmas: Array
    parameters: Array


class _Closeness(NamedTuple):
    """How closely a curve has to follow its points.

    Attributes
    ----------
    rms : float
        Largest root mean square of the distances [m].
    scales : (m,) float64
        Distances that count as mere noise [m].
    window : int
        Number of neighbours over which signed distances must not add up.
    """

    rms: float
    scales: Array
    window: int


class _ControlRule(NamedTuple):
    """How many control points a curve may have, and how stiff it is.

    Attributes
    ----------
    spacing, finest : float
        Length of curve to a control point at first, and at least [m].
    is_sparse : bool
        Whether to begin with as few as there can be.
    stiffness : float
        Weight of the second differences of the control points.
    """

    spacing: float
    finest: float
    is_sparse: bool
    stiffness: float


@kernel
def _chord_lengths(points: Array, noise: Array, parameters: Array) -> float:
    """Write how far along the way each point lies; return the length of the way [m].

    Noise makes a way through the points longer, the more the denser they are. It is therefore measured from
    point to point over steps that are long against the noise; within a step points are evenly spaced.
    """
    count = points.shape[0]
    anchors = np.empty(count, np.int64)
    anchors[0], used = 0, 1
    for k in range(1, count):
        x, y = points[k, 0] - points[anchors[used - 1], 0], points[k, 1] - points[anchors[used - 1], 1]
        least = STEP_SIGMAS * noise[k]
        if x * x + y * y >= least * least:
            anchors[used] = k
            used += 1
    if anchors[used - 1] != count - 1:
        # The last step would be a short one: it joins the one before.
        used = max(used, 2)
        anchors[used - 1] = count - 1
    parameters[0] = 0.0
    for j in range(1, used):
        first, last = anchors[j - 1], anchors[j]
        x, y = points[last, 0] - points[first, 0], points[last, 1] - points[first, 1]
        length = math.sqrt(x * x + y * y)
        begin = parameters[first]
        for k in range(first + 1, last + 1):
            parameters[k] = begin + length * (k - first) / (last - first)
    return float(parameters[count - 1])


@kernel
def _average_knots(parameters: Array, count: int, knots: Array) -> None:
    """Knots by averaging, after Piegl and Tiller, equations 9.68 and 9.69."""
    total = parameters.shape[0]
    knots[:ORDER], knots[count:] = parameters[0], parameters[total - 1]
    share = total / (count - ORDER + 1)
    for j in range(1, count - ORDER + 1):
        i = int(j * share)
        part = j * share - i
        knots[ORDER - 1 + j] = (1.0 - part) * parameters[i - 1] + part * parameters[i]


@kernel
def _fit_curve(
    samples: _Samples, length: float, closeness: _Closeness, rule: _ControlRule
) -> tuple[Array, Array, Array, float]:
    """Fit with more and more control points until the curve follows.

    Return control points, knots, normal matrix, rms.
    """
    points, sigmas, parameters = samples
    spacing, finest, is_sparse, stiffness = rule
    wanted = closeness.rms
    total = points.shape[0]
    enough = max(total // 2 + 1, ORDER) if is_sparse else total
    usual = min(max(int(math.floor(length / spacing + 0.5)) + ORDER - 1, ORDER), enough)
    most = max(min(int(length / finest) + ORDER - 1, enough), usual)
    count = ORDER if is_sparse else usual
    is_straight = is_sparse
    while True:
        knots = np.empty(count + ORDER)
        _average_knots(parameters, count, knots)
        normal, control_points = np.zeros((count, ORDER)), np.zeros((count, 2))
        _accumulate(samples, knots, stiffness, normal, control_points)
        if is_straight:
            is_straight = False
            line = _fit_straight(points, sigmas)
            rms, bias = _misfit(samples, knots, line, closeness)
            if rms <= wanted and bias <= MAX_BIAS:
                return line, knots, normal, rms
        factor = normal.copy()
        # With the stiffness there always is a solution; without, more control points than the points
        # determine have none.
        if _factorize(factor):
            _solve(factor, control_points)
            rms, bias = _misfit(samples, knots, control_points, closeness)
            if (rms <= wanted and bias <= MAX_BIAS) or count >= most:
                return control_points, knots, normal, rms
            count = min(2 * count - ORDER + 1, most)
        elif count > ORDER:
            most = count = count - 1
        else:
            return control_points, knots, normal, math.inf


@kernel
def _fit_straight(points: Array, sigmas: Array) -> Array:
    """Return control points of the straight curve nearest to the points.

    They lie evenly along a line fitted by total least squares.
    """
    total, x, y = 0.0, 0.0, 0.0
    for k in range(points.shape[0]):
        weight = 1.0 / (sigmas[k] * sigmas[k])
        total += weight
        x += weight * points[k, 0]
        y += weight * points[k, 1]
    x, y = x / total, y / total
    xx, xy, yy = 0.0, 0.0, 0.0
    for k in range(points.shape[0]):
        weight, dx, dy = 1.0 / (sigmas[k] * sigmas[k]), points[k, 0] - x, points[k, 1] - y
        xx += weight * dx * dx
        xy += weight * dx * dy
        yy += weight * dy * dy
    theta = 0.5 * math.atan2(2.0 * xy, xx - yy)
    cosine, sine = math.cos(theta), math.sin(theta)
    last = points.shape[0] - 1
    begin = cosine * (points[0, 0] - x) + sine * (points[0, 1] - y)
    end = cosine * (points[last, 0] - x) + sine * (points[last, 1] - y)
    line = np.empty((ORDER, 2))
    for r in range(ORDER):
        along = begin + (end - begin) * r / (ORDER - 1.0)
        line[r, 0], line[r, 1] = x + cosine * along, y + sine * along
    return line


@kernel
def _accumulate(samples: _Samples, knots: Array, stiffness: float, normal: Array, right: Array) -> None:
    """Sum up the normal matrix's lower band (n, 4) and the right side (n, 2).

    Row i holds columns i .. i - 3.
    """
    points, sigmas, parameters = samples
    count = normal.shape[0]
    values = np.empty(ORDER)
    total = 0.0
    for k in range(points.shape[0]):
        weight = 1.0 / (sigmas[k] * sigmas[k])
        total += weight
        span = find_span(knots, count, parameters[k])
        basis_of_span(knots, span, parameters[k], 0, values)
        first = span - ORDER + 1
        for r in range(ORDER):
            for s in range(r + 1):
                normal[first + r, r - s] += weight * values[r] * values[s]
            right[first + r, 0] += weight * values[r] * points[k, 0]
            right[first + r, 1] += weight * values[r] * points[k, 1]
    scale = stiffness * total / count
    for i in range(1, count - 1):
        normal[i - 1, 0] += scale
        normal[i, 0] += 4.0 * scale
        normal[i + 1, 0] += scale
        normal[i, 1] -= 2.0 * scale
        normal[i + 1, 1] -= 2.0 * scale
        normal[i + 1, 2] += scale


@kernel
def _misfit(samples: _Samples, knots: Array, control_points: Array, closeness: _Closeness) -> tuple[float, float]:
    """Return the distances of points from the curve at their parameters.

    Along it, parameters are but estimates.

    Returns
    -------
    rms : float
        Root mean square of the distances [m].
    bias : float
        Greatest sum of so many neighbouring signed distances, each in units of its scale, over what it would
        be for mere noise. A bend that is cut short shows here where the rest of a long curve hides it in the
        root mean square.
    """
    points, parameters = samples.points, samples.parameters
    scales, window = closeness.scales, closeness.window
    count = points.shape[0]
    values, ratios = np.empty(ORDER), np.empty(count)
    total, in_window, greatest = 0.0, 0.0, 0.0
    for k in range(count):
        x, y = point_at(knots, control_points, parameters[k], 0, values)
        dx, dy = point_at(knots, control_points, parameters[k], 1, values)
        x, y = x - points[k, 0], y - points[k, 1]
        speed = math.sqrt(dx * dx + dy * dy)
        aside = (dx * y - dy * x) / speed if speed > 0.0 else math.sqrt(x * x + y * y)
        total += aside * aside
        ratios[k] = aside / scales[k]
        in_window += ratios[k]
        if k >= window:
            in_window -= ratios[k - window]
        greatest = max(greatest, abs(in_window))
    return math.sqrt(total / count), greatest / math.sqrt(window)


_SHORTEST = 1e-9


_WINDOWS, _MIN_WINDOW = 8, 6


_FINE = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """A curve through points, and how well it follows them.

    Attributes
    ----------
    spline : Spline
        The curve; its knots run along it in metres.
    rms : float
        Root mean square of the distances of the points from the curve [m].
    normal : (n, 4) float64
        The lower band of the weighted normal matrix, weights in 1 / m2.
    """

    spline: Spline
    rms: float
    normal: NDArray[np.float64]

    @property
    def covariance(self) -> NDArray[np.float64]:
        """Covariance (n, n) [m2] of either coordinate of the control points.

        The inverse of the normal matrix.
        """
        count = len(self.normal)
        inverse = np.empty((count, count))
        factor = self.normal.copy()
        if not _factorize(factor):
            raise ValueError("the points do not determine the control points")
        for k in range(count):
            column = np.zeros((count, 1))
            column[k] = 1.0
            _solve(factor, column)
            inverse[:, k] = column[:, 0]
        return inverse


def fit_bspline(points: ArrayLike, settings: FitSettings | None = None, sigmas: ArrayLike | None = None) -> Fit:
    """Fit a curve to ordered points.

    Parameters are lengths along the chords. Knots lie where each span has its share of the points, so that
    all control points are determined (Schoenberg and Whitney).

    Parameters
    ----------
    points : (m, 2)
        In order along the curve, at least 4 [m].
    settings : FitSettings or None
        How many control points.
    sigmas : (m,) or None
        Standard deviation of each point across the curve [m]; 1 cm if None.

    Returns
    -------
    Fit
        The curve.

    Raises
    ------
    ValueError
        If there are fewer than 4 points, all are the same, or they do not determine a curve without stiffness.
    """
    settings = settings or FitSettings()
    positions = np.ascontiguousarray(points, np.float64)
    if positions.ndim != 2 or positions.shape[1] != 2 or len(positions) < ORDER:
        raise ValueError(f"points have shape {positions.shape}; want (m, 2) with m >= {ORDER}")
    deviations = np.full(len(positions), 0.01) if sigmas is None else np.ascontiguousarray(sigmas, np.float64)
    if deviations.shape != (len(positions),) or not deviations.min() > 0.0:
        raise ValueError(f"sigmas have shape {deviations.shape} or are not positive; want ({len(positions)},)")
    parameters = np.empty(len(positions))
    noise = settings.explained * deviations if sigmas is not None else np.zeros(len(positions))
    length = float(_chord_lengths(positions, noise, parameters))
    if not _SHORTEST < length < math.inf:
        raise ValueError("points are all the same, or not finite; want points along a curve")
    is_noisy = sigmas is not None and settings.explained > 0.0
    wanted = (
        max(settings.rms, settings.explained * math.sqrt(float(deviations @ deviations) / len(positions)))
        if is_noisy
        else settings.rms
    )
    window = max(len(positions) // _WINDOWS, _MIN_WINDOW) if is_noisy else 1
    scales = np.hypot(deviations, _FINE * settings.rms) if is_noisy else np.full(len(positions), settings.rms)
    control_points, knots, normal, rms = _fit_curve(
        _Samples(positions, deviations, parameters),
        length,
        _Closeness(wanted, scales, window),
        _ControlRule(settings.spacing, settings.finest_spacing, settings.is_sparse, settings.stiffness),
    )
    if rms == math.inf:
        raise ValueError("the points do not determine a curve; want 4 that differ, or stiffness above 0")
    # The way through the points is longer than the curve; another scale of the parameter leaves the curve as
    # it is.
    curve = curve_length(knots, control_points)
    return Fit(Spline(knots * (curve / length) if curve > _SHORTEST else knots, control_points), float(rms), normal)


def _averaged_knots(parameters: ArrayLike, count: int) -> NDArray[np.float64]:
    """Return knots (count + 4,) for ``count`` control points.

    Every span has its share of the parameters (m,).
    """
    knots = np.empty(count + ORDER)
    _average_knots(np.ascontiguousarray(parameters, np.float64), count, knots)
    return knots
