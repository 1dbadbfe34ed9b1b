"""Distance of believed poses from the true ones.

Poses are x, y, theta [m, m, rad] of one robot at the same times.

References
----------
Best fit: Umeyama (PAMI 1991), without scale. ATE and RPE: Sturm et al., A benchmark for the evaluation of
RGB-D SLAM systems (IROS 2012).
"""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import composed, fit, relative

Poses = NDArray[np.float64]
"""Poses in the order of time, (times, 3) float64 [m, m, rad]."""


def _wrapped(angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return angles in (-pi, pi] [rad]."""
    return np.asarray(math.pi - np.mod(math.pi - np.asarray(angles, np.float64), 2.0 * math.pi))


def best_transform(points: NDArray[np.float64], onto: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the motion x, y, theta that brings points nearest to others, (3,).

    It solves ``min sum |R(theta) p_k + (x, y) - q_k|^2``.

    Parameters
    ----------
    points, onto : (times, 2 or more) float64
        Positions x, y first [m], at least one.
    """
    fitted = fit(np.asarray(points, np.float64)[:, :2], np.asarray(onto, np.float64)[:, :2])
    return np.array([fitted.x, fitted.y, fitted.theta])


def moved(poses: Poses, transform: NDArray[np.float64]) -> Poses:
    """Return poses moved by a transform x, y, theta [m, m, rad]."""
    return composed(np.asarray(transform, np.float64), np.asarray(poses, np.float64))


def absolute_error(believed: Poses, true: Poses, is_aligned: bool = True) -> float:
    """Return ``ATE = sqrt(mean_k |t_k - S b_k|^2)`` [m].

    S is the best motion of the believed positions onto the true ones.

    Parameters
    ----------
    believed, true : (times, 3) float64
        Believed and true poses at the same times, at least one.
    """
    fitted = moved(believed, best_transform(believed, true)) if is_aligned else np.asarray(believed, np.float64)
    gaps = fitted[:, :2] - np.asarray(true, np.float64)[:, :2]
    return math.sqrt(float((gaps**2).sum(axis=1).mean()))


def relative_error(believed: Poses, true: Poses, steps: int) -> tuple[float, float] | None:
    """Return RPE: ``sqrt(mean |trans(E_k)|^2)`` [m] and ``mean |angle(E_k)|`` [rad].

    None if the poses do not span the steps.

    ``E_k = (Q_k^-1 Q_(k+d))^-1 (P_k^-1 P_(k+d))`` of true poses Q and believed ones P; no frames have to agree.

    Parameters
    ----------
    believed, true : (times, 3) float64
        Believed and true poses at the same times.
    """
    if len(believed) <= steps:
        return None
    motion, truth = _motions(believed, steps), _motions(true, steps)
    # The rotation of Q_k^-1 Q_(k+d) turns the gap of translations and leaves its length.
    gaps = motion[:, :2] - truth[:, :2]
    return math.sqrt(float((gaps**2).sum(axis=1).mean())), float(np.abs(_wrapped(motion[:, 2] - truth[:, 2])).mean())


def _motions(poses: Poses, steps: int) -> Poses:
    """Return the motions from each pose to the one that many steps later.

    They are in the frame of the former.
    """
    poses = np.asarray(poses, np.float64)
    return relative(poses[:-steps], poses[steps:])
