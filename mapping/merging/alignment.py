"""From matched corners to transforms: each match proposes one, the others vote, and the walls refine it."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels import Array, kernel
from lidarium.mapping.map_files import FREE, OCCUPIED
from lidarium.mapping.merging.corners import Corners
from lidarium.mapping.merging.correspondence import Matches
from lidarium.mapping.merging.described_map import DescribedMap
from lidarium.mapping.merging.rigid import Transform, fit

INLIER_RULES = ("distance", "ratio")
REFINEMENTS = ("sweep", "least_squares", "walls")


@dataclass(frozen=True, slots=True, kw_only=True)
class AlignmentSettings:
    """How a transform is found.

    Attributes
    ----------
    inlier_rule : str
        ``distance``: matched corners come together within the tolerance below; ``ratio``: their coordinates, in cells from the corner of
        the map, differ by less than 8 % each (as it was printed: far from that corner a tolerance of half a metre, near it none).
    tolerance_m : float
        Distance at which corners come together beside the match that proposes the transform [m].
    angle_uncertainty : float
        Error of the proposed rotation [rad]; the tolerance grows with the distance by its tangent, and rotations of inliers differ by at
        most twice as much.
    ratio : float
        Least quotient of coordinates for ``ratio``.
    least_inliers : int
        Fewest inliers of a transform, the proposing match among them; each corner takes part in one.
    inlier_share : float
        Fewest inliers as a share of the smaller number of corners.
    candidates : int
        Number of transforms that are refined and looked at more closely.
    refinements : tuple of str
        Done in this order: ``sweep`` of the rotation over 7 degrees to either side, ``least_squares`` of the inliers, ``walls`` on walls.
    refinement_reach_m : float
        Distance to walls within which ``walls`` pulls at first [m].
    wall_samples : int
        Number of wall cells that are compared while transforms are ranked and refined.
    """

    inlier_rule: str = "distance"
    tolerance_m: float = 0.12
    angle_uncertainty: float = math.radians(3.0)
    ratio: float = 0.92
    least_inliers: int = 3
    inlier_share: float = 0.0
    candidates: int = 8
    refinements: tuple[str, ...] = ("least_squares", "walls")
    refinement_reach_m: float = 0.4
    wall_samples: int = 400

    def __post_init__(self) -> None:
        if self.inlier_rule not in INLIER_RULES:
            raise ValueError(f"inlier_rule is {self.inlier_rule!r}; want one of {', '.join(INLIER_RULES)}")
        if not set(self.refinements) <= set(REFINEMENTS):
            raise ValueError(f"refinements are {self.refinements}; want some of {', '.join(REFINEMENTS)}")
        for name, low, high in (
            ("tolerance_m", 0.0, math.inf),
            ("angle_uncertainty", 0.0, math.pi / 4.0),
            ("ratio", 0.0, 1.0),
            ("inlier_share", 0.0, 1.0),
            ("refinement_reach_m", 1e-3, math.inf),
        ):
            if not low <= getattr(self, name) <= high:
                raise ValueError(f"{name} of alignment is {getattr(self, name)}; want {low:g} to {high:.4g}")
        if min(self.least_inliers, self.candidates, self.wall_samples) < 1:
            raise ValueError("least_inliers, candidates and wall_samples of alignment want one or more each")


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A transform that may join two maps.

    Attributes
    ----------
    a_from_b : Transform
        Maps points of map b into map a.
    inliers : (n,) int64
        Indices of the matches that agree with it; none where it was not found by corners.
    """

    a_from_b: Transform
    inliers: NDArray[np.int64]


def propose(first: Corners, second: Corners, matches: Matches) -> NDArray[np.float64]:
    """Return the transform that each match proposes, shape (n, 3): x, y [m], theta [rad]."""
    p, q = first.points[matches.first], second.points[matches.second]
    cosine, sine = np.cos(matches.rotation), np.sin(matches.rotation)
    x = p[:, 0] - (cosine * q[:, 0] - sine * q[:, 1])
    y = p[:, 1] - (sine * q[:, 0] + cosine * q[:, 1])
    return np.stack([x, y, matches.rotation], axis=1)


def find_inliers(
    first: Corners, second: Corners, matches: Matches, resolution: float, settings: AlignmentSettings
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Let the matches vote on the transform that each of them proposes.

    Parameters
    ----------
    first, second : Corners
        Of map a and map b.
    matches : Matches
        Between them.
    resolution : float
        Side of a cell [m].
    settings : AlignmentSettings
        Who agrees with whom.

    Returns
    -------
    proposals : (n, 3) float64
        x, y [m] and theta [rad] of ``a_from_b`` of each match.
    is_inlier : (n, n) bool
        Row: proposal, column: match that agrees with it; each corner takes part in at most one.
    """
    proposals = propose(first, second, matches)
    is_inlier = np.zeros((len(matches), len(matches)), np.bool_)
    tangent = math.tan(settings.angle_uncertainty)
    _vote(
        proposals,
        first.points[matches.first],
        second.points[matches.second],
        matches.first,
        matches.second,
        (len(first), len(second)),
        (settings.tolerance_m, tangent, 2.0 * settings.angle_uncertainty),
        settings.ratio if settings.inlier_rule == "ratio" else 0.0,
        resolution,
        is_inlier,
    )
    return proposals, is_inlier


@kernel
def _vote(
    proposals: Array,
    p: Array,
    q: Array,
    first: Array,
    second: Array,
    counts: tuple[int, int],
    tolerances: tuple[float, float, float],
    ratio: float,
    resolution: float,
    is_inlier: Array,
) -> None:
    """Mark the inliers of each proposal; a ratio above 0 chooses the rule of coordinates."""
    tolerance, tangent, angle = tolerances
    first_taken_by, second_taken_by = np.full(counts[0], -1), np.full(counts[1], -1)
    for k in range(proposals.shape[0]):
        cosine, sine = math.cos(proposals[k, 2]), math.sin(proposals[k, 2])
        is_inlier[k, k] = True
        first_taken_by[first[k]], second_taken_by[second[k]] = k, k
        for m in range(p.shape[0]):
            if first_taken_by[first[m]] == k or second_taken_by[second[m]] == k:
                continue
            x = cosine * q[m, 0] - sine * q[m, 1] + proposals[k, 0]
            y = sine * q[m, 0] + cosine * q[m, 1] + proposals[k, 1]
            if ratio > 0.0:
                agrees = _is_alike(x / resolution, p[m, 0] / resolution, ratio) and _is_alike(y / resolution, p[m, 1] / resolution, ratio)
            else:
                turn = abs((proposals[m, 2] - proposals[k, 2] + math.pi) % (2.0 * math.pi) - math.pi)
                reach = tolerance + math.hypot(q[m, 0] - q[k, 0], q[m, 1] - q[k, 1]) * tangent
                agrees = turn <= angle and math.hypot(x - p[m, 0], y - p[m, 1]) <= reach
            if agrees:
                is_inlier[k, m] = True
                first_taken_by[first[m]], second_taken_by[second[m]] = k, k


@kernel(inline=True)
def _is_alike(a: float, b: float, ratio: float) -> bool:
    """Return whether the smaller coordinate is more than a share of the larger one."""
    low, high = min(abs(a), abs(b)), max(abs(a), abs(b))
    return bool(high == 0.0 or (a * b > 0.0 and low / high > ratio))


def wall_sample(walls: int, count: int) -> NDArray[np.int64]:
    """Return the indices of so many of a map's walls, spread over all of them; of all where there are no more."""
    return np.linspace(0, walls - 1, min(walls, count)).astype(np.int64)


def rank_by_walls(
    a: DescribedMap, b: DescribedMap, proposals: NDArray[np.float64], samples: int, near_m: float = 0.15
) -> NDArray[np.int64]:
    """Return for each proposal how many of map b's walls come to lie on walls of map a, less twice those that lie in its free space."""
    scores = np.empty(len(proposals), np.int64)
    walls = b.walls[wall_sample(len(b.walls), samples)]
    _score_walls(a.levels, a.distance, 1.0 / a.resolution, walls, proposals, near_m, scores)
    return scores


@kernel
def _score_walls(levels: Array, distance: Array, scale: float, walls: Array, proposals: Array, near: float, scores: Array) -> None:
    rows, columns = levels.shape
    for k in range(proposals.shape[0]):
        cosine, sine = math.cos(proposals[k, 2]) * scale, math.sin(proposals[k, 2]) * scale
        x0, y0 = proposals[k, 0] * scale, proposals[k, 1] * scale
        hits, misses = 0, 0
        for i in range(walls.shape[0]):
            x = int(math.floor(cosine * walls[i, 0] - sine * walls[i, 1] + x0))
            y = int(math.floor(sine * walls[i, 0] + cosine * walls[i, 1] + y0))
            if 0 <= x < columns and 0 <= y < rows:
                if distance[y, x] <= near:
                    hits += 1
                elif levels[y, x] == FREE and distance[y, x] > 2.0 * near:
                    misses += 1
        scores[k] = hits - 2 * misses


def distinct(
    proposals: NDArray[np.float64], order: NDArray[np.int64], at: NDArray[np.float64], count: int, apart: tuple[float, float]
) -> list[int]:
    """Return the first few of the proposals, in an order, that differ from one another by more than a distance [m] or an angle [rad]."""
    chosen: list[int] = []
    images = np.stack(
        [
            np.cos(proposals[:, 2]) * at[0] - np.sin(proposals[:, 2]) * at[1] + proposals[:, 0],
            np.sin(proposals[:, 2]) * at[0] + np.cos(proposals[:, 2]) * at[1] + proposals[:, 1],
        ],
        axis=1,
    )
    is_near = np.zeros(len(proposals), np.bool_)
    for index in order.tolist():
        if not is_near[index]:
            chosen.append(index)
            if len(chosen) == count:
                break
            turn = np.abs((proposals[:, 2] - proposals[index, 2] + math.pi) % (2.0 * math.pi) - math.pi)
            is_near |= (np.linalg.norm(images - images[index], axis=1) <= apart[0]) & (turn <= apart[1])
    return chosen


def refine(a: DescribedMap, b: DescribedMap, matches: Matches, candidate: Candidate, settings: AlignmentSettings) -> Candidate:
    """Return a candidate with its transform made better by each of the settings' refinements in turn."""
    transform = candidate.a_from_b
    p, q = a.corners.points[matches.first[candidate.inliers]], b.corners.points[matches.second[candidate.inliers]]
    for step in settings.refinements:
        if step == "walls":
            transform = refine_on_walls(a, b, transform, settings.refinement_reach_m, settings.wall_samples)
        elif step == "sweep" and len(p) > 0:
            transform = sweep_rotation(p, q, transform)
        elif step == "least_squares" and len(p) > 1:
            transform = fit(q, p)
    return Candidate(transform, candidate.inliers)


def sweep_rotation(p: NDArray[np.float64], q: NDArray[np.float64], a_from_b: Transform) -> Transform:
    """Return the transform with the rotation, of 29 within 7 degrees, that brings the inliers q of map b nearest to p of map a.

    The translation follows from the centres of the inliers.
    """
    best, least = a_from_b, math.inf
    for step in range(-14, 15):
        turn = Transform(0.0, 0.0, a_from_b.theta + math.radians(0.5 * step))
        x, y = (p.mean(axis=0) - turn.apply(q.mean(axis=0))).tolist()
        moved = Transform(x, y, turn.theta)
        error = float(np.linalg.norm(moved.apply(q) - p, axis=1).sum())
        if error < least:
            best, least = moved, error
    return best


def refine_on_walls(a: DescribedMap, b: DescribedMap, a_from_b: Transform, reach_m: float, samples: int) -> Transform:
    """Return the transform that brings walls of map b onto those of map a that face the same way, by least squares.

    Each wall looks along its normal for the nearest wall of map a, as far as a reach, which shrinks to four cells; walls that find none
    do not count: there the other map may know nothing.
    """
    sample = wall_sample(len(b.walls), samples)
    if len(sample) == 0:
        return a_from_b
    pose = np.array([a_from_b.x, a_from_b.y, a_from_b.theta])
    _settle(a.levels, a.distance, a.resolution, b.walls[sample], b.normals[sample], pose, reach_m, min(4.0 * a.resolution, reach_m))
    return Transform(*pose.tolist())


@kernel
def _settle(
    levels: Array, distance: Array, side: float, walls: Array, normals: Array, pose: Array, reach: float, last_reach: float
) -> None:
    """Move a pose so that walls come to lie on walls along their normals."""
    rounds = 10
    count = walls.shape[0]
    places, facing, gaps = np.empty((count, 2)), np.empty((count, 2)), np.empty(count)
    for step in range(rounds):
        # Half of the rounds narrow the reach, the others settle.
        share = min(2.0 * step / rounds, 1.0)
        steps = int(reach * (last_reach / reach) ** share / side)
        cosine, sine = math.cos(pose[2]), math.sin(pose[2])
        found, centre_x, centre_y = 0, 0.0, 0.0
        for i in range(count):
            x = (cosine * walls[i, 0] - sine * walls[i, 1] + pose[0]) / side
            y = (sine * walls[i, 0] + cosine * walls[i, 1] + pose[1]) / side
            u, v = cosine * normals[i, 0] - sine * normals[i, 1], sine * normals[i, 0] + cosine * normals[i, 1]
            gap = _gap_to_wall(levels, distance, side, x, y, u, v, steps)
            if gap <= steps:
                places[found, 0], places[found, 1] = x, y
                facing[found, 0], facing[found, 1] = u, v
                gaps[found] = gap
                found += 1
                centre_x += x
                centre_y += y
        if found < 3:
            return
        centre_x /= found
        centre_y /= found
        xx, xy, yy, xt, yt, tt = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        bx, by, bt = 0.0, 0.0, 0.0
        for i in range(found):
            u, v, gap = facing[i, 0], facing[i, 1], gaps[i]
            # Rotation about the middle of the walls that count, so that it does not mix with the translation.
            t = v * (places[i, 0] - centre_x) - u * (places[i, 1] - centre_y)
            xx += u * u
            xy += u * v
            yy += v * v
            xt += u * t
            yt += v * t
            tt += t * t
            bx += u * gap
            by += v * gap
            bt += t * gap
        # Damped a little, so that what no wall holds stays where it is.
        damping = 1e-3 * found
        hessian = np.array([[xx + damping, xy, xt], [xy, yy + damping, yt], [xt, yt, tt * 1.001 + damping]])
        move = np.linalg.solve(hessian, np.array([bx, by, bt]))
        cosine, sine = math.cos(move[2]), math.sin(move[2])
        x, y = pose[0] / side - centre_x, pose[1] / side - centre_y
        pose[0] = (centre_x + cosine * x - sine * y + move[0]) * side
        pose[1] = (centre_y + sine * x + cosine * y + move[1]) * side
        pose[2] += move[2]
        if share == 1.0 and abs(move[0]) + abs(move[1]) < 0.02 and abs(move[2]) < 1e-4:
            return


@kernel(inline=True)
def _gap_to_wall(levels: Array, distance: Array, side: float, x: float, y: float, u: float, v: float, steps: int) -> float:
    """Return how far along the normal the nearest wall that faces the same way lies [cells], more than ``steps`` where there is none."""
    rows, columns = levels.shape
    column, row = int(math.floor(x)), int(math.floor(y))
    # Near the border nothing is known; this spares a check of each step.
    if not (steps < column < columns - steps - 1 and steps < row < rows - steps - 1):
        return steps + 1.0
    nearest = distance[row, column] / side - 1.5
    if nearest > steps:
        return steps + 1.0
    for k in range(max(int(nearest), 0), steps + 1):
        for sign in range(-1 if k > 0 else 1, 2, 2):
            gap = float(sign * k)
            if (
                levels[int(y + gap * v), int(x + gap * u)] == OCCUPIED
                and levels[int(y + (gap + 1.0) * v), int(x + (gap + 1.0) * u)] == FREE
            ):
                return gap
    return steps + 1.0
