"""The best placement of a scan on a local map within a wide window.

It is found without evaluating most of the window.

A coarse map holds for each block of cells the most that a point in it could agree by, so the sum over the
points bounds what any placement within a block of placements can reach; blocks that cannot beat the best
placement known are never divided.

References
----------
Hess et al., Real-time loop closure in 2D LIDAR SLAM (ICRA 2016). Here the coarse maps are as small as their
blocks are large, which makes them a third of the map's size together instead of several times it, for
somewhat looser bounds.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.localization.matching.bound_search import CoarseLevels, Window, find_placements
from lidarium.mapping.localization.matching.scan_search import angle_step
from lidarium.mapping.localization.matching.submaps import FULL_LEVEL, AgreementGrid

LEVELS = 6
"""Coarse maps: the coarsest has blocks of 2^6 cells."""


@dataclass(frozen=True, slots=True, eq=False)
class Pyramid:
    """A local map with its coarse maps.

    Attributes
    ----------
    grid : AgreementGrid
        The map.
    maxima : (cells,) uint8
        All coarse maps one after the other: cell (i, j) of level h is the most in the 2 x 2 blocks of 2^h
        cells from block (i, j) on.
    shapes : (LEVELS + 1, 3) int64
        Where each level begins in ``maxima``, its rows and its columns; level 0 is the map itself.
    """

    grid: AgreementGrid
    maxima: NDArray[np.uint8]
    shapes: NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Placement:
    """What a search found.

    Attributes
    ----------
    pose : (3,) float64
        x, y, theta in the map's frame [m, rad].
    score : float
        Mean level of the cells in which the points lie, from 0 to 1.
    """

    pose: NDArray[np.float64]
    score: float


def pyramid(grid: AgreementGrid) -> Pyramid:
    """Return a local map with its coarse maps."""
    blocks = grid.levels
    maxima, shapes, begin = [grid.levels.ravel()], [(0, *grid.levels.shape)], grid.levels.size
    for _ in range(LEVELS):
        rows, columns = (-(-side // 2) for side in blocks.shape)
        padded = np.zeros((2 * rows, 2 * columns), np.uint8)
        padded[: blocks.shape[0], : blocks.shape[1]] = blocks
        blocks = padded.reshape(rows, 2, columns, 2).max(axis=(1, 3))
        # One more before the first: placements begin there that reach into it.
        wide = np.zeros((rows + 2, columns + 2), np.uint8)
        wide[1:-1, 1:-1] = blocks
        pairs = np.maximum(np.maximum(wide[:-1, :-1], wide[1:, :-1]), np.maximum(wide[:-1, 1:], wide[1:, 1:]))
        maxima.append(pairs.ravel())
        shapes.append((begin, *pairs.shape))
        begin += pairs.size
    return Pyramid(grid, np.concatenate(maxima), np.array(shapes, np.int64))


def place(
    coarse: Pyramid,
    points: NDArray[np.float64],
    around: NDArray[np.float64],
    reach: tuple[float, float],
    least_score: float,
    evaluations: int,
    apart: tuple[NDArray[np.float64], float, float] | None = None,
) -> tuple[Placement | None, bool]:
    """Find the best placement of points within a window.

    Parameters
    ----------
    coarse : Pyramid
        The map.
    points : (n, 2) float64
        Points in the robot's frame [m].
    around : (3,) float64
        Middle of the window: x, y, theta in the map's frame [m, rad].
    reach : (float, float)
        How far the window goes to each side [m, rad].
    least_score : float
        What a placement has to reach, from 0 to 1.
    evaluations : int
        At most so many placements and blocks of them are examined.
    apart : ((3,) float64, float, float) or None
        A pose of which placements keep away: by the first distance [m], or by the second angle [rad].

    Returns
    -------
    Placement or None
        The best, or None where none reaches the score.
    bool
        Whether the search came to its end.
    """
    if len(points) == 0:
        return None, True
    side = coarse.grid.resolution
    step = angle_step(points, side)
    steps, turns = math.ceil(reach[0] / side - 1e-9), math.ceil(reach[1] / step - 1e-9)
    headings = around[2] + step * np.arange(-turns, turns + 1)
    corner = np.array(
        [around[0] / side - coarse.grid.column - steps, around[1] / side - coarse.grid.row - steps]
    )
    avoided = np.zeros(5)
    if apart is not None:
        pose, distance, angle = apart
        avoided[:] = (
            (pose[0] - around[0]) / side + steps,
            (pose[1] - around[1]) / side + steps,
            pose[2],
            distance / side,
            angle,
        )
    found = np.full(4, -1.0)
    least, window = float(FULL_LEVEL) * least_score * len(points), Window(headings, corner, 2 * steps + 1)
    is_over = find_placements(
        CoarseLevels(coarse.maxima, coarse.shapes), points / side, window, least, evaluations, avoided, found
    )
    if found[3] < 0.0:
        return None, is_over
    pose = np.array(
        [
            around[0] + (found[0] - steps) * side,
            around[1] + (found[1] - steps) * side,
            headings[int(found[2])],
        ]
    )
    return Placement(pose, float(found[3]) / (float(FULL_LEVEL) * len(points))), is_over
