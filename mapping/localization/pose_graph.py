"""Poses that agree best with what was measured between them, by least squares on sparse matrices.

Minimises the sum over the edges of ``rho(e^T W e)``, e the difference of the pose of b as seen from a from what was measured, W its
information; rho is the identity for motions, and Cauchy's for closures, of which one may be wrong.

References
----------
Grisetti et al., A tutorial on graph-based SLAM (IEEE ITS Magazine 2010).
"""

import math
from dataclasses import dataclass

import numpy as np
import scipy.sparse
import scipy.sparse.linalg
from numpy.typing import NDArray

from lidarium.mapping.rigid import relative


@dataclass(frozen=True, slots=True, eq=False)
class Edges:
    """What was measured between poses.

    Attributes
    ----------
    a, b : (edges,) int64
        Numbers of the poses.
    measured : (edges, 3) float64
        Pose b as seen from pose a: x, y, theta [m, rad].
    information : (edges, 3, 3) float64
        How well, in the frame of a.
    is_robust : (edges,) bool
        Whether the edge may be wrong.
    """

    a: NDArray[np.int64]
    b: NDArray[np.int64]
    measured: NDArray[np.float64]
    information: NDArray[np.float64]
    is_robust: NDArray[np.bool_]


def optimised(
    poses: NDArray[np.float64], edges: Edges, robust_scale: float, iterations: int, newest: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the poses that agree best with the edges, the first kept, and the covariance of the last.

    Parameters
    ----------
    poses : (poses, 3) float64
        Where to begin: x, y, theta [m, rad]; every pose but the first is joined with the first by edges.
    edges : Edges
        What was measured.
    robust_scale : float
        Residual, in standard deviations, from which on an edge that may be wrong counts less.
    iterations : int
        At most so many steps for each scale, at least 1.
    newest : int
        So many of the last edges have not had their say yet. Where they pull hard, they count fully at first, and what others
        contradict is let go little by little.

    Returns
    -------
    (poses, 3) float64
        The poses; those given where no step makes them better.
    (3, 3) float64
        Covariance of the last pose against the first [m^2, m rad, rad^2].
    """
    if len(poses) < 2:
        return poses.copy(), np.zeros((3, 3))
    best = poses.copy()
    squares = _squares(residuals(best, edges), edges)[len(edges.a) - newest :]
    scale = max(robust_scale, math.sqrt(float(squares.max())) if len(squares) else 0.0)
    while True:
        best, factor = _settled(best, edges, scale, iterations)
        if scale <= robust_scale:
            break
        scale = max(0.2 * scale, robust_scale)
    best[:, 2] = math.pi - (math.pi - best[:, 2]) % (2.0 * math.pi)
    return best, _last_covariance(factor)


def _settled(
    poses: NDArray[np.float64], edges: Edges, robust_scale: float, iterations: int
) -> tuple[NDArray[np.float64], scipy.sparse.linalg.SuperLU]:
    """Return the poses of least cost near given ones (Levenberg and Marquardt), and the factors of the last Hessian."""
    best, cost = poses, _cost(poses, edges, robust_scale)
    damping, step = 1e-9, 0
    while True:
        step += 1
        hessian, gradient = _normal_equations(best, edges, robust_scale)
        damped = (hessian + scipy.sparse.diags(hessian.diagonal() * damping)).tocsc()
        factor = scipy.sparse.linalg.splu(damped, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
        move = factor.solve(-gradient).reshape(-1, 3)
        trial = best.copy()
        trial[1:] += move
        trial_cost = _cost(trial, edges, robust_scale)
        if trial_cost <= cost:
            gain = cost - trial_cost
            best, cost, damping = trial, trial_cost, max(0.1 * damping, 1e-9)
            is_over = gain < 3e-3 * cost + 1e-9
        else:
            damping = max(100.0 * damping, 1e-4)
            is_over = damping > 1e6
        if is_over or step >= iterations:
            return best, factor


def residuals(poses: NDArray[np.float64], edges: Edges) -> NDArray[np.float64]:
    """Return by how much b, as seen from a, differs from what was measured, shape (edges, 3) [m, rad]."""
    rest = relative(poses[edges.a], poses[edges.b]) - edges.measured
    rest[:, 2] = math.pi - (math.pi - rest[:, 2]) % (2.0 * math.pi)
    return np.asarray(rest)


def _squares(rest: NDArray[np.float64], edges: Edges) -> NDArray[np.float64]:
    return np.asarray(((rest[:, None, :] @ edges.information)[:, 0] * rest).sum(axis=1))


def _cost(poses: NDArray[np.float64], edges: Edges, robust_scale: float) -> float:
    squares = _squares(residuals(poses, edges), edges)
    scale = robust_scale * robust_scale
    return float(np.where(edges.is_robust, scale * np.log1p(squares / scale), squares).sum())


def _normal_equations(poses: NDArray[np.float64], edges: Edges, robust_scale: float) -> tuple[scipy.sparse.csc_matrix, NDArray[np.float64]]:
    """Return Hessian and gradient for all poses but the first."""
    rest = residuals(poses, edges)
    weights = np.where(edges.is_robust, 1.0 / (1.0 + _squares(rest, edges) / (robust_scale * robust_scale)), 1.0)
    information = edges.information * weights[:, None, None]
    jacobians = _jacobians(poses, edges)
    weighted = jacobians.swapaxes(1, 2) @ information
    blocks = weighted @ jacobians
    slopes = (weighted @ rest[:, :, None])[:, :, 0]
    places = np.concatenate([3 * edges.a[:, None] + np.arange(-3, 0), 3 * edges.b[:, None] + np.arange(-3, 0)], axis=1)
    size = 3 * (len(poses) - 1)
    rows, columns = np.broadcast_to(places[:, :, None], blocks.shape), np.broadcast_to(places[:, None, :], blocks.shape)
    is_free = (rows >= 0) & (columns >= 0)
    hessian = scipy.sparse.csc_matrix((blocks[is_free], (rows[is_free], columns[is_free])), shape=(size, size))
    gradient = np.bincount((places + 3).ravel(), slopes.ravel(), size + 3)
    return hessian, np.asarray(gradient[3:], np.float64)


def _jacobians(poses: NDArray[np.float64], edges: Edges) -> NDArray[np.float64]:
    """Return the derivatives (edges, 3, 6) of the residuals by the poses a and then b."""
    a, b = poses[edges.a], poses[edges.b]
    cosine, sine = np.cos(a[:, 2]), np.sin(a[:, 2])
    x, y = (b - a)[:, 0], (b - a)[:, 1]
    after = np.zeros((len(a), 3, 3))
    after[:, 0, 0], after[:, 0, 1], after[:, 1, 0], after[:, 1, 1], after[:, 2, 2] = cosine, sine, -sine, cosine, 1.0
    before = -after
    before[:, 0, 2], before[:, 1, 2] = cosine * y - sine * x, -cosine * x - sine * y
    return np.concatenate([before, after], axis=2)


def _last_covariance(factor: scipy.sparse.linalg.SuperLU) -> NDArray[np.float64]:
    """Return the covariance of the last pose, of the factors of the last Hessian."""
    ends = np.zeros((factor.shape[0], 3))
    ends[-3:] = np.eye(3)
    covariance = factor.solve(ends)[-3:]
    return np.asarray(0.5 * (covariance + covariance.T))
