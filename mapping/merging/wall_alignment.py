"""Walls of one map aligned with those of another.

They distinguish good transforms from bad ones, and improve good ones.
"""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.geometry.small_matrices import solved
from lidarium.mapping.grids.occupancy import FREE, OCCUPIED
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.merging.described_map import FACING_DISTANCE_M, DescribedMap, faces_away


def wall_sample(walls: int, count: int) -> NDArray[np.int64]:
    """Return the indices of a number of a map's walls, spread over all of them.

    Of all if there are no more.
    """
    return np.linspace(0, walls - 1, min(walls, count)).astype(np.int64)


def rank_by_walls(
    a: DescribedMap, b: DescribedMap, proposals: NDArray[np.float64], samples: int, near_m: float = 0.15
) -> NDArray[np.int64]:
    """Return per proposal how many walls of b lie on those of a, less conflicts.

    Walls of map b that lie in the free space of map a are subtracted twice. A proposal is x, y [m], theta
    [rad], and, if there is a fourth column, by how much map b grows.
    """
    scores = np.empty(len(proposals), np.int64)
    walls = b.walls[wall_sample(len(b.walls), samples)]
    grown = proposals
    if proposals.shape[1] == 3:
        grown = np.column_stack([proposals, np.ones(len(proposals))])
    _score_walls(a.levels, a.distance, 1.0 / a.resolution, walls, grown, near_m, scores)
    return scores


@kernel
def _score_walls(
    levels: Array, distance: Array, scale: float, walls: Array, proposals: Array, near: float, scores: Array
) -> None:
    rows, columns = levels.shape
    for k in range(proposals.shape[0]):
        grown = scale * proposals[k, 3]
        cosine, sine = math.cos(proposals[k, 2]) * grown, math.sin(proposals[k, 2]) * grown
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


def refine_on_walls(a: DescribedMap, b: DescribedMap, a_from_b: Transform, reach_m: float, samples: int) -> Transform:
    """Return the transform that aligns walls of map b with those of map a.

    By least squares, on walls that face the same direction.

    For each wall, the nearest wall of map a is searched along its normal, up to a reach that shrinks to four
    cells; walls that find none do not count: there the other map may know nothing.
    """
    sample = wall_sample(len(b.walls), samples)
    if len(sample) == 0:
        return a_from_b
    pose = np.array([a_from_b.x, a_from_b.y, a_from_b.theta])
    _settle(
        a.levels,
        a.distance,
        a.resolution,
        b.walls[sample],
        b.normals[sample],
        pose,
        reach_m,
        min(4.0 * a.resolution, reach_m),
    )
    return Transform(*pose.tolist())


@kernel
def _settle(
    levels: Array,
    distance: Array,
    side: float,
    walls: Array,
    normals: Array,
    pose: Array,
    reach: float,
    last_reach: float,
) -> None:
    """Move a pose so that walls meet walls along their normals."""
    rounds = 10
    count = walls.shape[0]
    positions, facing, gaps = np.empty((count, 2)), np.empty((count, 2)), np.empty(count)
    for step in range(rounds):
        # Half of the rounds narrow the reach, the others settle.
        share = min(2.0 * step / rounds, 1.0)
        steps = int(reach * (last_reach / reach) ** share / side)
        cosine, sine = math.cos(pose[2]), math.sin(pose[2])
        found, centre_x, centre_y = 0, 0.0, 0.0
        for i in range(count):
            x = (cosine * walls[i, 0] - sine * walls[i, 1] + pose[0]) / side
            y = (sine * walls[i, 0] + cosine * walls[i, 1] + pose[1]) / side
            u, v = (
                cosine * normals[i, 0] - sine * normals[i, 1],
                sine * normals[i, 0] + cosine * normals[i, 1],
            )
            gap = gap_to_wall(levels, distance, side, x, y, u, v, steps)
            if gap <= steps:
                positions[found, 0], positions[found, 1] = x, y
                facing[found, 0], facing[found, 1] = u, v
                gaps[found] = gap
                found += 1
                centre_x += x
                centre_y += y
        if found < 3:
            return
        centre_x /= found
        centre_y /= found
        move = _best_move(positions[:found], facing[:found], gaps[:found], centre_x, centre_y)
        cosine, sine = math.cos(move[2]), math.sin(move[2])
        x, y = pose[0] / side - centre_x, pose[1] / side - centre_y
        pose[0] = (centre_x + cosine * x - sine * y + move[0]) * side
        pose[1] = (centre_y + sine * x + cosine * y + move[1]) * side
        pose[2] += move[2]
        if share == 1.0 and abs(move[0]) + abs(move[1]) < 0.02 and abs(move[2]) < 1e-4:
            return


@kernel
def _best_move(places: Array, facing: Array, gaps: Array, centre_x: float, centre_y: float) -> Array:
    """Return the motion that closes the gaps best, by damped least squares.

    It is x, y [cells] and theta [rad] about the centre.
    """
    xx, xy, yy, xt, yt, tt = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    bx, by, bt = 0.0, 0.0, 0.0
    for i in range(gaps.shape[0]):
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
    damping = 1e-3 * gaps.shape[0]
    hessian = np.array([[xx + damping, xy, xt], [xy, yy + damping, yt], [xt, yt, tt * 1.001 + damping]])
    move: Array = solved(hessian, np.array([[bx], [by], [bt]]))[:, 0]
    return move


@kernel(forceinline=True)
def gap_to_wall(
    levels: Array, distance: Array, side: float, x: float, y: float, u: float, v: float, steps: int
) -> float:
    """Return the distance along the normal to the nearest wall [cells].

    The wall faces the same direction; more than ``steps`` if there is none.
    """
    rows, columns = levels.shape
    column, row = int(math.floor(x)), int(math.floor(y))
    # Near the border nothing is known; this spares a check of each step.
    if not (steps < column < columns - steps - 1 and steps < row < rows - steps - 1):
        return steps + 1.0
    nearest = distance[row, column] / side - 1.5
    if nearest > steps:
        return steps + 1.0
    ahead = FACING_DISTANCE_M / side
    for k in range(max(int(nearest), 0), steps + 1):
        for sign in range(-1 if k > 0 else 1, 2, 2):
            gap = float(sign * k)
            if (
                levels[int(y + gap * v), int(x + gap * u)] == OCCUPIED
                and levels[int(y + (gap + 1.0) * v), int(x + (gap + 1.0) * u)] == FREE
                and not faces_away(levels, x + gap * u, y + gap * v, ahead * u, ahead * v)
            ):
                return gap
    return steps + 1.0
