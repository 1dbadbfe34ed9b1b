"""Paths that planners return: how long, how straight, how far spread they are.

References
----------
Sparse mapper, section 10, with the corrections of its formulas. Turning and dispersion depend on how the
points of a path are spaced: paths are compared at equal arc lengths.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

SPACING_M = 0.05
"""Distance of the points of paths that are compared [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PathMeasures:
    """What is measured of a path.

    Attributes
    ----------
    length : float
        Length [m].
    points : int
        Points of the path as it was given.
    turning : float
        Sum of the angles by which the path turns at its points, the thesis's tortuosity [rad].
    dispersion : float
        Root of the mean squared distance of its points from their mean [m].
    """

    length: float
    points: int
    turning: float
    dispersion: float


def measure_path(path: NDArray[np.float64], spacing: float | None = SPACING_M) -> PathMeasures:
    """Measure a path.

    Parameters
    ----------
    path : (P, D) float64
        Its points, at least one [m].
    spacing : float or None
        Equal arc length to which points are set before turning and dispersion are measured [m]; None for the
        points as they are.

    Raises
    ------
    ValueError
        Where there is no point, or one is not finite.
    """
    points = np.asarray(path, np.float64)
    if points.ndim != 2 or len(points) == 0 or not np.isfinite(points).all():
        raise ValueError(f"the path has shape {points.shape}; want (P, D) with at least one finite point")
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    even = points if spacing is None else points_along(points, spacing)
    return PathMeasures(
        length=length, points=len(points), turning=turning_of(even), dispersion=dispersion_of(even)
    )


def points_along(path: NDArray[np.float64], spacing: float) -> NDArray[np.float64]:
    """Return points of a path (P, D) at equal arc lengths of at most ``spacing``, its ends among them [m]."""
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    lengths = np.concatenate([[0.0], np.cumsum(steps)])
    places = np.linspace(0.0, lengths[-1], max(math.ceil(lengths[-1] / spacing), 1) + 1)
    return np.stack([np.interp(places, lengths, column) for column in path.T], axis=1)


def turning_of(points: NDArray[np.float64]) -> float:
    """Return the sum of the angles at inner points (P, D), steps of no length left out [rad]."""
    steps = np.diff(points, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    units = steps[lengths > 1e-12] / lengths[lengths > 1e-12, None]
    # The arc cosine is blind to small angles; half the angle is the arc sine of half the chord.
    chords = np.linalg.norm(np.diff(units, axis=0), axis=1)
    return float(2.0 * np.arcsin(np.clip(0.5 * chords, 0.0, 1.0)).sum())


def dispersion_of(points: NDArray[np.float64]) -> float:
    """Return how far points (P, D) spread about their mean, with one degree of freedom less [m]."""
    if len(points) < 2:
        return 0.0
    gaps = points - points.mean(axis=0)
    return math.sqrt(float((gaps**2).sum()) / (len(points) - 1))
