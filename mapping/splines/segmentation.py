"""Segmentation of clusters of points at their corners.

Split, merge, and a comparison of the directions on both sides.

Points are split if one lies too far from the line through the ends, again and again; neighbouring parts
that fit one line are merged. Straight leaves remain. If the wall turns sharply between two of
them, the cluster is cut, so that each curve is smooth; if it bends gently, as a round wall does, it is
not.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.splines.settings import CORNER_RULES, SegmentationSettings


@kernel
def _fit_line(points: Array, first: int, last: int) -> tuple[float, float, float, float, float]:
    """Fit a line to points first .. last by total least squares.

    Returns middle x, y, direction along the points [rad], half length, rms [m].
    """
    count = last - first + 1
    x, y = 0.0, 0.0
    for k in range(first, last + 1):
        x += points[k, 0]
        y += points[k, 1]
    x, y = x / count, y / count
    xx, xy, yy = 0.0, 0.0, 0.0
    for k in range(first, last + 1):
        dx, dy = points[k, 0] - x, points[k, 1] - y
        xx += dx * dx
        xy += dx * dy
        yy += dy * dy
    theta = 0.5 * np.arctan2(2.0 * xy, xx - yy)
    if (
        np.cos(theta) * (points[last, 0] - points[first, 0]) + np.sin(theta) * (points[last, 1] - points[first, 1])
        < 0.0
    ):
        theta += np.pi if theta <= 0.0 else -np.pi
    cosine, sine = np.cos(theta), np.sin(theta)
    low, high, across = np.inf, -np.inf, 0.0
    for k in range(first, last + 1):
        dx, dy = points[k, 0] - x, points[k, 1] - y
        along, aside = cosine * dx + sine * dy, cosine * dy - sine * dx
        low, high = min(low, along), max(high, along)
        across += aside * aside
    middle = (low + high) / 2.0
    return x + cosine * middle, y + sine * middle, theta, (high - low) / 2.0, np.sqrt(across / count)


@kernel
def _farthest(points: Array, sigmas: Array, first: int, last: int, limit: float, noise_sigmas: float) -> int:
    """Return the point farthest from the line through the ends.

    If it is too far, else -1.
    """
    x, y = points[first, 0], points[first, 1]
    dx, dy = points[last, 0] - x, points[last, 1] - y
    length = np.sqrt(dx * dx + dy * dy)
    best, farthest = -1, 0.0
    for k in range(first + 1, last):
        px, py = points[k, 0] - x, points[k, 1] - y
        distance = abs(dx * py - dy * px) / length if length > 0.0 else np.sqrt(px * px + py * py)
        excess = distance - max(limit, noise_sigmas * sigmas[k])
        if excess > 0.0 and distance > farthest:
            best, farthest = k, distance
    return best


@kernel
def _split_runs(points: Array, sigmas: Array, limit: float, noise_sigmas: float, ends: Array) -> int:
    """Write the ends of the leaves, first and last point included.

    Return the number of leaves.
    """
    stack = np.empty(points.shape[0] + 1, np.int64)
    ends[0], stack[0] = 0, points.shape[0] - 1
    height, count, first = 1, 0, 0
    while height > 0:
        last = stack[height - 1]
        at = _farthest(points, sigmas, first, last, limit, noise_sigmas)
        if at > first:
            stack[height] = at
            height += 1
        else:
            count += 1
            ends[count] = last
            first = last
            height -= 1
    return count


@kernel
def _merge_runs(
    points: Array, sigmas: Array, limit: float, noise_sigmas: float, collinear: float, ends: Array, count: int
) -> int:
    """Join neighbouring leaves until no two fit one line; return their number.

    Joined leaves have about one direction, and their points fit one line.
    """
    is_changed = True
    while is_changed and count > 1:
        is_changed = False
        k = 1
        while k < count:
            before, after = _fit_line(points, ends[k - 1], ends[k]), _fit_line(points, ends[k], ends[k + 1])
            turn = abs(np.arctan2(np.sin(after[2] - before[2]), np.cos(after[2] - before[2])))
            joined = _fit_line(points, ends[k - 1], ends[k + 1])
            cosine, sine = np.cos(joined[2]), np.sin(joined[2])
            is_straight = turn <= collinear
            for i in range(ends[k - 1], ends[k + 1] + 1):
                aside = abs(cosine * (points[i, 1] - joined[1]) - sine * (points[i, 0] - joined[0]))
                if aside > max(limit, noise_sigmas * sigmas[i]):
                    is_straight = False
                    break
            if is_straight:
                for i in range(k, count):
                    ends[i] = ends[i + 1]
                count -= 1
                is_changed = True
            else:
                k += 1
    return count


_REACH_SIGMAS = 10.0


_NEAR_CORNER = 0.15


_SURE_TURN = math.radians(45.0)


_ROUND_RATIO = 1.7


@dataclass(frozen=True, slots=True, eq=False)
class Cut:
    """A cluster, cut.

    Attributes
    ----------
    pieces : (p, 2) int64
        First and last point of each smooth piece, both inclusive; neighbours share the point of the corner.
    leaves : (l, 2) int64
        First and last point of each straight leaf.
    lines : (l, 5) float64
        Of each leaf: middle x, y, direction [rad], half its length and the root mean square of the distances
        from it [m].
    corners : (p - 1, 2) float64
        Intersections of the lines on both sides of a corner [m].
    corner_points : (p - 1,) int64
        The points at which pieces are cut.
    """

    pieces: NDArray[np.int64]
    leaves: NDArray[np.int64]
    lines: NDArray[np.float64]
    corners: NDArray[np.float64]
    corner_points: NDArray[np.int64]


def split_merge(
    points: NDArray[np.float64],
    sigmas: NDArray[np.float64] | None = None,
    settings: SegmentationSettings | None = None,
) -> Cut:
    """Cut a cluster at its corners.

    Parameters
    ----------
    points : (n, 2) float64
        In order, at least 2 [m].
    sigmas : (n,) float64 or None
        Standard deviations of their noise [m]; none if None.
    settings : SegmentationSettings or None
        When points are split, and the definition of a corner.

    Returns
    -------
    Cut
        Pieces, leaves and corners.

    Raises
    ------
    ValueError
        If there are fewer than 2 points.
    """
    settings = settings or SegmentationSettings()
    positions = np.ascontiguousarray(points, np.float64)
    if positions.ndim != 2 or positions.shape[1] != 2 or len(positions) < 2:
        raise ValueError(f"points of a cluster have shape {positions.shape}; want (n, 2) with n >= 2")
    noise = np.zeros(len(positions)) if sigmas is None else np.ascontiguousarray(sigmas, np.float64)
    ends = np.empty(len(positions) + 1, np.int64)
    lines, corners = np.empty((len(positions), 5)), np.empty((len(positions), 2))
    is_corner = np.zeros(len(positions) + 1, np.bool_)
    rule = _CornerRule(
        settings.split_distance,
        settings.split_sigmas,
        settings.collinear_angle,
        settings.corner_angle,
        settings.corner_reach,
        settings.least_points,
        CORNER_RULES.index(settings.corner_rule),
    )
    count = _cut(positions, noise, rule, ends, lines, corners, is_corner)
    inner = np.flatnonzero(is_corner[: count + 1])
    cut_at = ends[inner]
    is_corner[0] = is_corner[count] = True
    return Cut(
        _pairs(ends[: count + 1][is_corner[: count + 1]]),
        _pairs(ends[: count + 1]),
        lines[:count].copy(),
        corners[inner].copy(),
        cut_at.copy(),
    )


def _pairs(ends: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return pairs (n, 2) of consecutive numbers of (n + 1,).

    Each number but the last with the one after it.
    """
    pairs = np.empty((len(ends) - 1, 2), np.int64)
    pairs[:, 0], pairs[:, 1] = ends[:-1], ends[1:]
    return pairs


@kernel
def _reach(points: Array, at: int, step: int, length: float) -> int:
    """Return the last point within a length of another one, going by steps of 1 or -1."""
    k = at
    while 0 <= k + step < points.shape[0]:
        dx, dy = points[k + step, 0] - points[at, 0], points[k + step, 1] - points[at, 1]
        if dx * dx + dy * dy > length * length:
            break
        k += step
    return k


@kernel
def _is_round(points: Array, first: int, low: int, high: int, last: int, reach: float, least: int, turn: float) -> bool:
    """Return whether a wall goes on turning beyond a corner, as a round one does.

    The turn [rad] was estimated from the parts low .. high.

    Directions a reach farther on differ no more than those at a corner do, and three times as much on an arc.
    Only slight turns are in doubt; leaves first .. last bound the search.
    """
    if abs(math.atan2(math.sin(turn), math.cos(turn))) > _SURE_TURN:
        return False
    before, after = max(_reach(points, low, -1, reach), first), min(_reach(points, high, 1, reach), last)
    if low - before + 1 < least or after - high + 1 < least:
        return False
    farther = _fit_line(points, high, after)[2] - _fit_line(points, before, low)[2]
    ratio = math.atan2(math.sin(farther), math.cos(farther)) / math.atan2(math.sin(turn), math.cos(turn))
    return ratio > _ROUND_RATIO


class _CornerRule(NamedTuple):
    """When points are split, and the definition of a corner; see ``SegmentationSettings``."""

    split_distance: float
    split_sigmas: float
    collinear_angle: float
    corner_angle: float
    corner_reach: float
    least_points: int
    by: int


@kernel
def _cut(
    points: Array,
    sigmas: Array,
    rule: _CornerRule,
    ends: Array,
    lines: Array,
    corners: Array,
    is_corner: Array,
) -> int:
    """Write leaves, their lines, and which of their ends are corners, with positions.

    Return the number of leaves.
    """
    limit, noise_sigmas, collinear, corner_angle, corner_reach, least, by = rule
    count = _split_runs(points, sigmas, limit, noise_sigmas, ends)
    count = _merge_runs(points, sigmas, limit, noise_sigmas, collinear, ends, count)
    for k in range(count):
        lines[k] = _fit_line(points, ends[k], ends[k + 1])
    last_cut = 0
    for k in range(1, count):
        at = ends[k]
        reach = max(corner_reach, _REACH_SIGMAS * sigmas[at])
        # Directions are measured on the wall nearby: the leaves of a round wall turn as much as those of a
        # corner do.
        low, high = max(_reach(points, at, -1, reach), last_cut), _reach(points, at, 1, reach)
        if at - low + 1 < least or high - at + 1 < least:
            continue
        before, after = _fit_line(points, low, at), _fit_line(points, at, high)
        turn = after[2] - before[2]
        if by == 1:
            is_sharp = abs(np.tan(after[2]) - np.tan(before[2])) > np.tan(corner_angle)
        else:
            is_sharp = abs(np.arctan2(np.sin(turn), np.cos(turn))) > corner_angle
        if not is_sharp or (by == 0 and _is_round(points, ends[k - 1], low, high, ends[k + 1], reach, least, turn)):
            continue
        is_corner[k] = True
        last_cut = at
        corners[k, 0], corners[k, 1] = points[at, 0], points[at, 1]
        across = np.sin(turn)
        if abs(across) > 0.1:
            dx, dy = after[0] - before[0], after[1] - before[1]
            along = (dx * np.sin(after[2]) - dy * np.cos(after[2])) / across
            x, y = before[0] + along * np.cos(before[2]), before[1] + along * np.sin(before[2])
            if (x - points[at, 0]) ** 2 + (y - points[at, 1]) ** 2 < _NEAR_CORNER**2:
                corners[k, 0], corners[k, 1] = x, y
    return int(count)
