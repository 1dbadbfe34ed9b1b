"""Least-squares fits of cubic B-splines to ordered points."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lidarium.mapping.splines.curves.banded import factorize, solve
from lidarium.mapping.splines.curves.basis import ORDER
from lidarium.mapping.splines.curves.bspline import Spline
from lidarium.mapping.splines.curves.curve_kernels import curve_length
from lidarium.mapping.splines.curves.fit_kernels import (
    Closeness,
    ControlRule,
    Samples,
    average_knots,
    chord_lengths,
    fit_curve,
)
from lidarium.mapping.splines.curves.settings import FitSettings

_SHORTEST = 1e-9


_WINDOWS, _LEAST_WINDOW = 8, 6


_FINE = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """A curve through points, and how well it follows them.

    Attributes
    ----------
    spline : Spline
        The curve; its knots run along it in metres.
    rms : float
        Root mean square of how far the points lie beside the curve [m].
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
        if not factorize(factor):
            raise ValueError("the points do not determine the control points")
        for k in range(count):
            column = np.zeros((count, 1))
            column[k] = 1.0
            solve(factor, column)
            inverse[:, k] = column[:, 0]
        return inverse


def fit_bspline(
    points: ArrayLike, settings: FitSettings | None = None, sigmas: ArrayLike | None = None
) -> Fit:
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
        Standard deviation of each point across the curve [m]; 1 cm where None.

    Returns
    -------
    Fit
        The curve.

    Raises
    ------
    ValueError
        Where there are fewer than 4 points, or all are the same.
    """
    settings = settings or FitSettings()
    places = np.ascontiguousarray(points, np.float64)
    if places.ndim != 2 or places.shape[1] != 2 or len(places) < ORDER:
        raise ValueError(f"points have shape {places.shape}; want (m, 2) with m >= {ORDER}")
    deviations = np.full(len(places), 0.01) if sigmas is None else np.ascontiguousarray(sigmas, np.float64)
    if deviations.shape != (len(places),) or not deviations.min() > 0.0:
        raise ValueError(f"sigmas have shape {deviations.shape} or are not positive; want ({len(places)},)")
    parameters = np.empty(len(places))
    noise = settings.explained * deviations if sigmas is not None else np.zeros(len(places))
    length = float(chord_lengths(places, noise, parameters))
    if not _SHORTEST < length < math.inf:
        raise ValueError("points are all the same, or not finite; want points along a curve")
    is_noisy = sigmas is not None and settings.explained > 0.0
    wanted = (
        max(settings.rms, settings.explained * math.sqrt(float(deviations @ deviations) / len(places)))
        if is_noisy
        else settings.rms
    )
    window = max(len(places) // _WINDOWS, _LEAST_WINDOW) if is_noisy else 1
    scales = np.hypot(deviations, _FINE * settings.rms) if is_noisy else np.full(len(places), settings.rms)
    control_points, knots, normal, rms = fit_curve(
        Samples(places, deviations, parameters),
        length,
        Closeness(wanted, scales, window),
        ControlRule(settings.spacing, settings.finest_spacing, settings.is_sparse, settings.stiffness),
    )
    # The way through the points is longer than the curve; another scale of the parameter leaves the curve as
    # it is.
    curve = curve_length(knots, control_points)
    return Fit(
        Spline(knots * (curve / length) if curve > _SHORTEST else knots, control_points), float(rms), normal
    )


def averaged_knots(parameters: ArrayLike, count: int) -> NDArray[np.float64]:
    """Return knots (count + 4,) for so many control points.

    Every span has its share of the parameters (m,).
    """
    knots = np.empty(count + ORDER)
    average_knots(np.ascontiguousarray(parameters, np.float64), count, knots)
    return knots
