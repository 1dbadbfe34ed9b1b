"""Match of a scan with a local map, from a nearby pose.

By Gauss and Newton's method.

The agreement of a point is the map's, smoothed by a cubic B-spline, which has a gradient everywhere and is
not drawn to cells.

References
----------
Kohlbrecher et al., A flexible and scalable SLAM system with full 3D motion estimation (SSRR 2011), here with
an agreement that keeps fractions of cells, and odometry as a prior.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.small_matrices import inverse, solved, squared
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.localization.matching.submaps import FREE_LEVEL, FULL_LEVEL, UNSEEN, AgreementGrid

LEVEL_RANGE = float(FULL_LEVEL - FREE_LEVEL)
"""Levels from no agreement to full agreement."""

NEAR_CELLS = 3
"""A cell is near another within so many rows and columns."""


@kernel(forceinline=True, nrt=False)
def _spline_weights(t: float) -> tuple[float, float, float, float]:
    """Return the weights of four neighbouring cells in a cubic B-spline.

    t runs from 0 to 1 between the middle two.
    """
    u, square, cube = 1.0 - t, t * t, t * t * t
    return (
        u * u * u / 6.0,
        (3.0 * cube - 6.0 * square + 4.0) / 6.0,
        (-3.0 * cube + 3.0 * square + 3.0 * t + 1.0) / 6.0,
        cube / 6.0,
    )


@kernel(forceinline=True, nrt=False)
def _spline_slopes(t: float) -> tuple[float, float, float, float]:
    """Return the slopes of the weights."""
    u, square = 1.0 - t, t * t
    return -0.5 * u * u, 1.5 * square - 2.0 * t, -1.5 * square + t + 0.5, 0.5 * square


@kernel(forceinline=True, nrt=False)
def _agreement(levels: Array, x: float, y: float) -> tuple[float, float, float]:
    """Return the smoothed agreement at x, y [cells] and its slopes [1/cell] (kernel).

    Zero where the map ends.
    """
    u, v = x - 0.5, y - 0.5
    column, row = int(math.floor(u)), int(math.floor(v))
    if not (1 <= column < levels.shape[1] - 2 and 1 <= row < levels.shape[0] - 2):
        return 0.0, 0.0, 0.0
    across, across_slopes = _spline_weights(u - column), _spline_slopes(u - column)
    along, along_slopes = _spline_weights(v - row), _spline_slopes(v - row)
    value, slope_x, slope_y = 0.0, 0.0, 0.0
    for i in range(4):
        line, line_slope = 0.0, 0.0
        for j in range(4):
            level = max(float(levels[row + i - 1, column + j - 1]) - FREE_LEVEL, 0.0)
            line += across[j] * level
            line_slope += across_slopes[j] * level
        value += along[i] * line
        slope_x += along[i] * line_slope
        slope_y += along_slopes[i] * line
    return value / LEVEL_RANGE, slope_x / LEVEL_RANGE, slope_y / LEVEL_RANGE


@kernel(forceinline=True, nrt=False)
def _is_unseen(levels: Array, x: float, y: float) -> bool:
    """Whether the map has not observed the cell at x, y [cells] (kernel)."""
    column, row = int(math.floor(x)), int(math.floor(y))
    return not (0 <= column < levels.shape[1] and 0 <= row < levels.shape[0]) or levels[row, column] == UNSEEN


@kernel(nrt=False)
def _extremes_around(levels: Array, column: int, row: int) -> tuple[int, int]:
    """Return the lowest and the highest level within three cells (kernel).

    Cells outside of the map are unobserved.
    """
    rows, columns = levels.shape
    lowest, highest = FULL_LEVEL, UNSEEN
    for i in range(row - NEAR_CELLS, row + NEAR_CELLS + 1):
        for j in range(column - NEAR_CELLS, column + NEAR_CELLS + 1):
            level = int(levels[i, j]) if 0 <= i < rows and 0 <= j < columns else UNSEEN
            lowest, highest = min(lowest, level), max(highest, level)
    return lowest, highest


SURFACE_GAP = 0.3
"""Largest gap between neighbouring points on one surface.

As a share of their distance, or in metres.
"""

MAX_BEND = 0.15
"""Largest ratio of the points' variance across the surface to that along it.

Above this there is a corner.
"""

MIN_POINTS = 3
"""Fewer points have no axis of their own."""


@kernel(forceinline=True)
def _is_one_surface(points: Array, k: int) -> bool:
    """Whether a point and the next one lie on one surface."""
    gap = SURFACE_GAP * max(math.hypot(points[k, 0], points[k, 1]), 1.0)
    return bool(math.hypot(points[k + 1, 0] - points[k, 0], points[k + 1, 1] - points[k, 1]) <= gap)


@kernel
def _find_normals(points: Array, reach: float, normals: Array) -> None:
    """Fill ``normals`` (n, 2) with unit normals of the surfaces (kernel).

    The surface at each point is that of the point and its neighbours; zero for a point alone.

    Two neighbours give it if the surface bends; elsewhere all within reach do, since noise turns what lies
    between two near points.
    """
    count = points.shape[0]
    for k in range(count):
        before, after = k, k
        while before > 0 and _is_one_surface(points, before - 1) and _is_near(points, before - 1, k, reach):
            before -= 1
        while after + 1 < count and _is_one_surface(points, after) and _is_near(points, after + 1, k, reach):
            after += 1
        along_x, along_y, is_bent = _axis(points[before : after + 1])
        if is_bent:
            before = k - 1 if k > 0 and _is_one_surface(points, k - 1) else k
            after = k + 1 if k + 1 < count and _is_one_surface(points, k) else k
            along_x, along_y = points[after, 0] - points[before, 0], points[after, 1] - points[before, 1]
        length = math.hypot(along_x, along_y)
        if length > 0.0:
            normals[k, 0], normals[k, 1] = -along_y / length, along_x / length


@kernel(forceinline=True)
def _is_near(points: Array, k: int, m: int, reach: float) -> bool:
    return bool(math.hypot(points[k, 0] - points[m, 0], points[k, 1] - points[m, 1]) <= reach)


@kernel
def _axis(points: Array) -> tuple[float, float, bool]:
    """Return the axis of largest variance of points, and whether it is unclear.

    The axis is of unit length, zero for fewer than three points. Unclear if points do not lie along
    it, or are too few.
    """
    count = points.shape[0]
    if count < MIN_POINTS:
        return 0.0, 0.0, True
    x, y = 0.0, 0.0
    for k in range(count):
        x += points[k, 0] / count
        y += points[k, 1] / count
    xx, xy, yy = 0.0, 0.0, 0.0
    for k in range(count):
        xx += (points[k, 0] - x) * (points[k, 0] - x)
        xy += (points[k, 0] - x) * (points[k, 1] - y)
        yy += (points[k, 1] - y) * (points[k, 1] - y)
    half, middle = math.hypot(0.5 * (xx - yy), xy), 0.5 * (xx + yy)
    angle = 0.5 * math.atan2(2.0 * xy, xx - yy)
    return math.cos(angle), math.sin(angle), middle - half > MAX_BEND * (middle + half)


FULL_AGREEMENT = 2.0 / 3.0
"""Greatest smoothed agreement that a point can have.

It occurs in the middle of a wall that lies along a row of cells.

With less, points in the middle of such a wall would agree too well, and scans would come to lie beside it.
"""

MAX_STEPS = 30
"""Steps of the descent at most."""

FIRST_DAMPING, MAX_DAMPING = 1e-3, 1e3
"""Share by which curvature is raised: at first, and at most before giving up."""

EASING, TIGHTENING = 0.3, 8.0
"""Factors of damping after a step that led down, and after one that did not."""

MIN_CURVATURE = 1e-9
"""Curvature that is added, so that equations can be solved [1/m^2, 1/rad^2]."""

STILL_M, STILL_ANGLE = 1e-4, 1e-5
"""Smaller steps end the descent [m, rad]."""

PROBES = 4
"""Places around a pose at which curvature is measured, half a cell to each side."""


class _Objective(NamedTuple):
    """Terms of the cost of a pose.

    Attributes
    ----------
    grid : AgreementGrid
        The map.
    points, normals : (n, 2) float64
        Points in the robot's frame [m], and unit normals of their surfaces; zero if there is none.
    prior, information : (3,), (3, 3) float64
        Pose by odometry, and its weight.
    weight : float
        How much full disagreement of one point counts.
    unseen : float
        Squared disagreement of a point in cells that the map has not observed.
    """

    grid: AgreementGrid
    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    prior: NDArray[np.float64]
    information: NDArray[np.float64]
    weight: float
    unseen: float


@dataclass(frozen=True, slots=True, eq=False)
class Match:
    """Pose of a scan on a local map.

    Attributes
    ----------
    pose : (3,) float64
        x, y, theta in the map's frame [m, rad].
    score : float
        Mean agreement, from 0 to 1, of the points near observed cells of the map.
    overlap : float
        Share of the points that do.
    contradiction : float
        Share of the points that lie in free cells of the map.
    information, prior : (3, 3) float64
        Information of the points alone on the pose, and prior information [1/m^2, 1/(m rad), 1/rad^2].
    """

    pose: NDArray[np.float64]
    score: float
    overlap: float
    contradiction: float
    information: NDArray[np.float64]
    prior: NDArray[np.float64]

    @property
    def covariance(self) -> NDArray[np.float64]:
        """Covariance of the pose, (3, 3) [m^2, m rad, rad^2].

        At most a metre and a radian, for unmeasured directions.
        """
        return inverse(self.information + self.prior + np.eye(3))


def refine(
    grid: AgreementGrid,
    points: NDArray[np.float64],
    start: NDArray[np.float64],
    prior: NDArray[np.float64],
    information: NDArray[np.float64],
    weight: float,
    unseen: float,
    surface_m: float = 0.25,
) -> Match:
    """Return the pose near a start at which the points agree best with the map.

    Minimises ``weight / n sum (1 - agreement_k)^2 + d^T information d``, d the difference of the pose from a
    prior one; a point in unobserved cells counts as ``unseen``. Points move across the surfaces
    that they lie on, not along: if a wall goes on beyond the observed part, the points there
    would draw the scan back to where the map ends, and a robot in a corridor with them.

    Parameters
    ----------
    grid : AgreementGrid
        The map.
    points : (n, 2) float64
        Points in the robot's frame, in the order of the beams [m].
    start, prior : (3,) float64
        Initial pose, and pose by odometry: x, y, theta in the map's frame [m, rad].
    information : (3, 3) float64
        How much that counts [1/m^2, 1/(m rad), 1/rad^2]; zero for not at all.
    weight : float
        How much full disagreement of all points counts: independent points / variance of the disagreement of
        one.
    unseen : float
        Squared disagreement of a point in cells that the map has not observed. As that of most points, it
        speaks neither for nor against a pose; if it counted in full, a wall that goes on beyond where the map
        ends would hold the robot back to where the scan covers the known part of it, and in a bare corridor
        nothing else speaks.
    surface_m : float
        Points of a surface so near to a point give its direction there; 0 for the nearest two [m].
    """
    pose, hessian, judgement = np.array(start, np.float64), np.empty((3, 3)), np.zeros(3)
    count = len(points)
    if count == 0:
        return Match(pose, 0.0, 0.0, 0.0, np.zeros((3, 3)), information)
    normals = np.zeros((count, 2))
    _find_normals(points, surface_m, normals)
    objective = _Objective(grid, points, normals, prior, information, weight / count, unseen)
    _refine(objective, pose, hessian, judgement)
    score, overlap, contradiction = judgement.tolist()
    return Match(pose, score, overlap, contradiction, hessian, information)


@kernel
def _refine(objective: _Objective, pose: Array, hessian: Array, judgement: Array) -> None:
    """Move a pose to the minimum of the cost.

    Return the Hessian and the result of ``_judge``.
    """
    _descend(objective, pose, hessian)
    _curve_around(objective, pose, hessian)
    _judge(objective.grid, objective.points, pose, judgement)


@kernel
def _descend(objective: _Objective, pose: Array, hessian: Array) -> None:
    """Move a pose to the minimum of the cost (Levenberg and Marquardt)."""
    prior, information, weight = objective.prior, objective.information, objective.weight
    gradient, trial_gradient, trial_hessian = np.empty(3), np.empty(3), np.empty((3, 3))
    trial, right = np.empty(3), np.empty((3, 1))
    away = pose - prior
    cost = weight * _normal_equations(objective, pose, hessian, gradient) + squared(information, away)
    damping = FIRST_DAMPING
    for _ in range(MAX_STEPS):
        whole = weight * hessian + information
        for k in range(3):
            whole[k, k] += damping * whole[k, k] + MIN_CURVATURE
        for i in range(3):
            right[i, 0] = weight * gradient[i]
            for k in range(3):
                right[i, 0] -= information[i, k] * away[k]
        move = solved(whole, right)[:, 0]
        trial[:] = pose + move
        trial_away = trial - prior
        trial_cost = weight * _normal_equations(objective, trial, trial_hessian, trial_gradient)
        trial_cost += squared(information, trial_away)
        if trial_cost < cost:
            pose[:], away[:] = trial, trial_away
            hessian[:], gradient[:] = trial_hessian, trial_gradient
            is_still = abs(move[0]) + abs(move[1]) < STILL_M and abs(move[2]) < STILL_ANGLE
            cost, damping = trial_cost, EASING * damping
            if is_still:
                break
        else:
            damping *= TIGHTENING
            if damping > MAX_DAMPING:
                break


@kernel
def _curve_around(objective: _Objective, pose: Array, hessian: Array) -> None:
    """Fill the weighed Hessian from half a cell around a pose.

    On the crest of a wall slopes vanish: how steep it is, is seen half a cell away.
    """
    side, weight = objective.grid.resolution, objective.weight
    trial, trial_gradient, trial_hessian = np.empty(3), np.empty(3), np.empty((3, 3))
    hessian[:] = 0.0
    for k in range(PROBES):
        trial[:] = pose
        trial[k >> 1] += 0.5 * side if k & 1 else -0.5 * side
        _normal_equations(objective, trial, trial_hessian, trial_gradient)
        hessian += 1.0 / PROBES * weight * trial_hessian


@kernel(nrt=False)
def _normal_equations(objective: _Objective, pose: Array, hessian: Array, gradient: Array) -> float:
    """Fill the normal equations of the points' disagreement at a pose.

    Return the sum of its squares.
    """
    levels, first_column, first_row, side = objective.grid
    points, normals, unseen = objective.points, objective.normals, objective.unseen
    cosine, sine = math.cos(pose[2]), math.sin(pose[2])
    hessian[:], gradient[:] = 0.0, 0.0
    cost = 0.0
    for k in range(points.shape[0]):
        x, y = cosine * points[k, 0] - sine * points[k, 1], sine * points[k, 0] + cosine * points[k, 1]
        u, v = (x + pose[0]) / side - first_column, (y + pose[1]) / side - first_row
        value, slope_x, slope_y = _agreement(levels, u, v)
        if value == 0.0 and _is_unseen(levels, u, v):
            cost += unseen
            continue
        rest = 1.0 - value / FULL_AGREEMENT
        cost += rest * rest
        scale = 1.0 / (side * FULL_AGREEMENT)
        a, b = slope_x * scale, slope_y * scale
        if normals[k, 0] != 0.0 or normals[k, 1] != 0.0:
            across_x = cosine * normals[k, 0] - sine * normals[k, 1]
            across_y = sine * normals[k, 0] + cosine * normals[k, 1]
            slope = a * across_x + b * across_y
            a, b = slope * across_x, slope * across_y
        c = b * x - a * y
        gradient[0] += a * rest
        gradient[1] += b * rest
        gradient[2] += c * rest
        hessian[0, 0] += a * a
        hessian[0, 1] += a * b
        hessian[0, 2] += a * c
        hessian[1, 1] += b * b
        hessian[1, 2] += b * c
        hessian[2, 2] += c * c
    hessian[1, 0], hessian[2, 0], hessian[2, 1] = hessian[0, 1], hessian[0, 2], hessian[1, 2]
    return cost


@kernel(nrt=False)
def _judge(grid: AgreementGrid, points: Array, pose: Array, judgement: Array) -> None:
    """Compute agreement and shares of points that are known or in free space.

    Mean agreement of the points near observed cells, their share, and the share of points in free space.
    """
    levels, first_column, first_row, side = grid
    cosine, sine = math.cos(pose[2]), math.sin(pose[2])
    agreeing, known, contradicting = 0.0, 0, 0
    for k in range(points.shape[0]):
        x = (cosine * points[k, 0] - sine * points[k, 1] + pose[0]) / side - first_column
        y = (sine * points[k, 0] + cosine * points[k, 1] + pose[1]) / side - first_row
        value, _, _ = _agreement(levels, x, y)
        agreeing += min(value / FULL_AGREEMENT, 1.0)
        if value > 0.0:
            known += 1
        else:
            lowest, highest = _extremes_around(levels, int(math.floor(x)), int(math.floor(y)))
            known += highest > UNSEEN
            contradicting += lowest == FREE_LEVEL and highest == FREE_LEVEL
    judgement[0], judgement[1], judgement[2] = (
        agreeing / max(known, 1),
        known / points.shape[0],
        contradicting / points.shape[0],
    )
