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
    poses: NDArray[np.float64], edges: Edges, robust_scale: float, iterations: int
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
        At most so many steps.

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
    cost = _cost(best, edges, robust_scale)
    damping, hessian = 1e-9, None
    for _ in range(iterations):
        hessian, gradient = _normal_equations(best, edges, robust_scale)
        diagonal = scipy.sparse.diags(hessian.diagonal() * damping + 1e-12)
        step = scipy.sparse.linalg.splu((hessian + diagonal).tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
        move = step.solve(-gradient).reshape(-1, 3)
        trial = best.copy()
        trial[1:] += move
        trial_cost = _cost(trial, edges, robust_scale)
        if trial_cost <= cost:
            gain = cost - trial_cost
            best, cost, damping = trial, trial_cost, max(0.1 * damping, 1e-9)
            if gain < 1e-4 * cost + 1e-9:
                break
        else:
            damping = max(100.0 * damping, 1e-4)
            if damping > 1e6:
                break
    best[:, 2] = math.pi - (math.pi - best[:, 2]) % (2.0 * math.pi)
    return best, _last_covariance(best, edges, robust_scale)


def residuals(poses: NDArray[np.float64], edges: Edges) -> NDArray[np.float64]:
    """Return by how much b, as seen from a, differs from what was measured, shape (edges, 3) [m, rad]."""
    rest = relative(poses[edges.a], poses[edges.b]) - edges.measured
    rest[:, 2] = math.pi - (math.pi - rest[:, 2]) % (2.0 * math.pi)
    return np.asarray(rest)


def _squares(rest: NDArray[np.float64], edges: Edges) -> NDArray[np.float64]:
    return np.asarray(np.einsum("ki,kij,kj->k", rest, edges.information, rest))


def _cost(poses: NDArray[np.float64], edges: Edges, robust_scale: float) -> float:
    squares = _squares(residuals(poses, edges), edges)
    scale = robust_scale * robust_scale
    return float(np.where(edges.is_robust, scale * np.log1p(squares / scale), squares).sum())


def _normal_equations(poses: NDArray[np.float64], edges: Edges, robust_scale: float) -> tuple[scipy.sparse.csc_matrix, NDArray[np.float64]]:
    """Return Hessian and gradient for all poses but the first."""
    rest = residuals(poses, edges)
    weights = np.where(edges.is_robust, 1.0 / (1.0 + _squares(rest, edges) / (robust_scale * robust_scale)), 1.0)
    information = edges.information * weights[:, None, None]
    before, after = _jacobians(poses, edges)
    jacobians = np.stack([before, after], axis=1)
    ends = np.stack([edges.a, edges.b], axis=1) - 1
    blocks = np.einsum("kpia,kij,kqjb->kpqab", jacobians, information, jacobians)
    slopes = np.einsum("kpia,kij,kj->kpa", jacobians, information, rest)
    size = 3 * (len(poses) - 1)
    rows = np.broadcast_to(3 * ends[:, :, None, None, None] + np.arange(3)[:, None], blocks.shape)
    columns = np.broadcast_to(3 * ends[:, None, :, None, None] + np.arange(3), blocks.shape)
    is_free = (rows >= 0) & (columns >= 0)
    hessian = scipy.sparse.csc_matrix((blocks[is_free], (rows[is_free], columns[is_free])), shape=(size, size))
    gradient = np.zeros((len(poses), 3))
    np.add.at(gradient, ends + 1, slopes)
    return hessian, gradient[1:].ravel()


def _jacobians(poses: NDArray[np.float64], edges: Edges) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the derivatives (edges, 3, 3) of the residuals by the poses a and b."""
    a, b = poses[edges.a], poses[edges.b]
    cosine, sine = np.cos(a[:, 2]), np.sin(a[:, 2])
    x, y = (b - a)[:, 0], (b - a)[:, 1]
    after = np.zeros((len(a), 3, 3))
    after[:, 0, 0], after[:, 0, 1], after[:, 1, 0], after[:, 1, 1], after[:, 2, 2] = cosine, sine, -sine, cosine, 1.0
    before = -after
    before[:, 0, 2], before[:, 1, 2] = cosine * y - sine * x, -cosine * x - sine * y
    return before, after


def _last_covariance(poses: NDArray[np.float64], edges: Edges, robust_scale: float) -> NDArray[np.float64]:
    hessian, _ = _normal_equations(poses, edges, robust_scale)
    ends = np.zeros((hessian.shape[0], 3))
    ends[-3:] = np.eye(3)
    factor = scipy.sparse.linalg.splu(hessian, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
    covariance = factor.solve(ends)[-3:]
    return np.asarray(0.5 * (covariance + covariance.T))
