"""Transforms from matched corners.

Each match proposes one, the others vote, and the walls refine it.
"""

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.bounds import Count, Distance, check_settings, share, shown, within
from lidarium.mapping.geometry.rigid import Transform, fit
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.merging.corners import Corners
from lidarium.mapping.merging.correspondence import Matches
from lidarium.mapping.merging.described_map import DescribedMap
from lidarium.mapping.merging.wall_alignment import refine_on_walls

INLIER_RULES = ("distance", "ratio")
REFINEMENTS = ("sweep", "least_squares", "walls")


@dataclass(frozen=True, slots=True, kw_only=True)
class AlignmentSettings:
    """How a transform is found.

    Attributes
    ----------
    inlier_rule : str
        ``distance``: matched corners come together within the tolerance below; ``ratio``: their coordinates,
        in cells from the corner of the map, differ by less than 8 % each (as it was printed: far from that
        corner a tolerance of half a metre, near it none).
    tolerance_m : float, default 0.12
        Distance at which corners besides the match that proposes the transform coincide [m].
    angle_uncertainty : float
        Error of the proposed rotation [rad]; the tolerance grows with the distance by its tangent, and
        rotations of inliers differ by at most twice as much.
    ratio : float, default 0.92
        Least quotient of coordinates for ``ratio``.
    least_inliers : int, default 3
        Fewest inliers of a transform, the proposing match among them; each corner takes part in one.
    inlier_share : float, default 0.0
        Fewest inliers as a share of the smaller number of corners.
    candidates : int, default 8
        Number of transforms that are refined and examined more closely.
    refinements : tuple of str
        Done in this order: ``sweep`` of the rotation over 7 degrees to either side, ``least_squares`` of the
        inliers, ``walls`` on walls.
    refinement_reach_m : float, default 0.4
        Distance to walls within which ``walls`` pulls at first [m].
    wall_samples : int, default 400
        Number of wall cells that are compared while transforms are ranked and refined.
    """

    inlier_rule: str = "distance"
    tolerance_m: Distance = 0.12
    angle_uncertainty: Annotated[float, within(0.0, math.pi / 4.0)] = math.radians(3.0)
    ratio: Annotated[float, share()] = 0.92
    least_inliers: Count = 3
    inlier_share: Annotated[float, share()] = 0.0
    candidates: Count = 8
    refinements: tuple[str, ...] = ("least_squares", "walls")
    refinement_reach_m: Annotated[float, within(1e-3, 1000.0)] = 0.4
    wall_samples: Count = 400

    def __post_init__(self) -> None:
        check_settings(self, "alignment")
        if self.inlier_rule not in INLIER_RULES:
            raise ValueError(f"inlier_rule is {self.inlier_rule!r}; want one of {', '.join(INLIER_RULES)}")
        is_list = isinstance(self.refinements, tuple | list)
        if not is_list or not all(each in REFINEMENTS for each in self.refinements):
            raise ValueError(f"refinements are {shown(self.refinements)}; want some of {', '.join(REFINEMENTS)}")


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A transform that may join two maps.

    Attributes
    ----------
    a_from_b : Transform
        Maps points of map b into map a.
    inliers : (n,) int64
        Indices of the matches that agree with it; none if it was not found by corners.
    """

    a_from_b: Transform
    inliers: NDArray[np.int64]


def _propose(first: Corners, second: Corners, matches: Matches) -> NDArray[np.float64]:
    """Return the transform that each match proposes, shape (n, 3).

    x, y [m], theta [rad].
    """
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
    proposals = _propose(first, second, matches)
    is_inlier = np.zeros((len(matches), len(matches)), np.bool_)
    tangent = math.tan(settings.angle_uncertainty)
    pairs = _Pairs(first.points[matches.first], second.points[matches.second], matches.first, matches.second)
    rule = _InlierRule(
        settings.tolerance_m,
        tangent,
        2.0 * settings.angle_uncertainty,
        settings.ratio if settings.inlier_rule == "ratio" else 0.0,
    )
    _vote(proposals, pairs, (len(first), len(second)), rule, resolution, is_inlier)
    return proposals, is_inlier


class _Pairs(NamedTuple):
    """Matched corners: points (n, 2) of maps a and b [m], and their indices (n,)."""

    p: Array
    q: Array
    first: Array
    second: Array


class _InlierRule(NamedTuple):
    """Who agrees with a proposal; a ratio above 0 chooses the rule of coordinates.

    Tolerance of distances [m], its growth with the distance, tolerance of rotations [rad].
    """

    tolerance: float
    tangent: float
    angle: float
    ratio: float


@kernel
def _vote(
    proposals: Array,
    pairs: _Pairs,
    counts: tuple[int, int],
    rule: _InlierRule,
    resolution: float,
    is_inlier: Array,
) -> None:
    """Mark the inliers of each proposal."""
    p, q, first, second = pairs
    tolerance, tangent, angle, ratio = rule
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
                agrees = _is_alike(x / resolution, p[m, 0] / resolution, ratio) and _is_alike(
                    y / resolution, p[m, 1] / resolution, ratio
                )
            else:
                turn = abs((proposals[m, 2] - proposals[k, 2] + math.pi) % (2.0 * math.pi) - math.pi)
                reach = tolerance + math.hypot(q[m, 0] - q[k, 0], q[m, 1] - q[k, 1]) * tangent
                agrees = turn <= angle and math.hypot(x - p[m, 0], y - p[m, 1]) <= reach
            if agrees:
                is_inlier[k, m] = True
                first_taken_by[first[m]], second_taken_by[second[m]] = k, k


@kernel(forceinline=True)
def _is_alike(a: float, b: float, ratio: float) -> bool:
    """Return whether the smaller coordinate is more than a share of the larger one."""
    low, high = min(abs(a), abs(b)), max(abs(a), abs(b))
    return bool(high == 0.0 or (a * b > 0.0 and low / high > ratio))


def distinct(
    proposals: NDArray[np.float64],
    order: NDArray[np.int64],
    at: NDArray[np.float64],
    count: int,
    apart: tuple[float, float],
) -> list[int]:
    """Return the first few distinct proposals, in an order.

    They differ from one another by more than a distance [m] or an angle [rad].
    """
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


def refine(
    a: DescribedMap, b: DescribedMap, matches: Matches, candidate: Candidate, settings: AlignmentSettings
) -> Candidate:
    """Return a candidate with its transform improved by each refinement in turn.

    The refinements are those of the settings.
    """
    transform = candidate.a_from_b
    p, q = (
        a.corners.points[matches.first[candidate.inliers]],
        b.corners.points[matches.second[candidate.inliers]],
    )
    for step in settings.refinements:
        if step == "walls":
            transform = refine_on_walls(a, b, transform, settings.refinement_reach_m, settings.wall_samples)
        elif step == "sweep" and len(p) > 0:
            transform = _sweep_rotation(p, q, transform)
        elif step == "least_squares" and len(p) > 1:
            transform = fit(q, p)
    return Candidate(transform, candidate.inliers)


def _sweep_rotation(p: NDArray[np.float64], q: NDArray[np.float64], a_from_b: Transform) -> Transform:
    """Return the transform with the rotation that best aligns the inliers.

    Of 29 rotations within 7 degrees, the one that brings q of map b nearest to p of map a.

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
