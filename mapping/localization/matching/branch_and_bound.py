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
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.localization.matching.scan_search import angle_step
from lidarium.mapping.localization.matching.submaps import FULL_LEVEL, AgreementGrid

SPARED_LEVELS = 2
"""A search begins so many levels below that of blocks as large as its window.

Such blocks bound nothing; a few by a few do.
"""


CHILDREN = 4
"""Blocks into which a block is divided."""


COLUMN, ROW, TURN, SUM = range(4)
"""Places in what is found."""


class _CoarseLevels(NamedTuple):
    """Coarse maps, see ``Pyramid``."""

    maxima: NDArray[np.uint8]
    shapes: NDArray[np.int64]


class _Window(NamedTuple):
    """Placements among which a search chooses.

    Attributes
    ----------
    headings : (turns,) float64
        Their headings [rad].
    corner : (2,) float64
        Column and row of the robot in the first of them [cells].
    width : int
        How many there are along columns, and along rows.
    """

    headings: NDArray[np.float64]
    corner: NDArray[np.float64]
    width: int


@kernel
def _bound(maxima: Array, begin: int, rows: int, columns: int, level: int, cells: Array, column: int, row: int) -> int:
    """Return an upper bound of the agreement of a block of placements.

    It sums over points the most each can agree by. The block begins at (column, row).
    """
    total = 0
    shift = 1 if level > 0 else 0
    for k in range(cells.shape[0]):
        j = ((cells[k, 0] + column) >> level) + shift
        i = ((cells[k, 1] + row) >> level) + shift
        if 0 <= j < columns and 0 <= i < rows:
            total += int(maxima[begin + i * columns + j])
    return total


@kernel
def _is_avoided(avoided: Array, column: int, row: int, heading: float) -> bool:
    if avoided[3] <= 0.0:
        return False
    turn = heading - avoided[2]
    turn -= 2.0 * math.pi * math.floor(turn / (2.0 * math.pi) + 0.5)
    away = (column - avoided[0]) ** 2 + (row - avoided[1]) ** 2
    return bool(away < avoided[3] * avoided[3] and abs(turn) < avoided[4])


@kernel
def _find_placements(
    coarse: _CoarseLevels,
    points: Array,
    window: _Window,
    least: float,
    evaluations: int,
    avoided: Array,
    found: Array,
) -> bool:
    """Find the best placement with at least a given sum.

    Notes its column, row, heading index and sum; returns whether all placements were decided.
    """
    top = _top_level(coarse, window.width)
    blocks = (window.width + (1 << top) - 1) >> top
    cells = _cells_of(points, window)
    bounds = _bounds_of_blocks(coarse, cells, top, blocks)
    examined = bounds.shape[0]
    best = least
    stack = np.empty((CHILDREN * (top + 2) + CHILDREN, 5), np.int64)
    children = np.empty((CHILDREN, 3), np.int64)
    for root in np.argsort(-bounds, kind="mergesort"):
        if bounds[root] <= best:
            break
        turn, i, j = root // (blocks * blocks), (root // blocks) % blocks, root % blocks
        _push(stack, 0, (bounds[root], top, turn, j << top, i << top))
        depth = 1
        while depth > 0:
            depth -= 1
            bound, level, turn, column, row = stack[depth]
            if bound <= best:
                continue
            if level == 0:
                if not _is_avoided(avoided, column, row, window.headings[turn]):
                    best = bound
                    found[COLUMN], found[ROW], found[TURN], found[SUM] = column, row, turn, bound
                continue
            if examined >= evaluations:
                return False
            block = (level, column, row)
            number, examined = _divide(coarse, cells[turn], block, window.width, best, children)
            examined += examined
            for k in range(number):
                _push(stack, depth, (children[k, 0], level - 1, turn, children[k, 1], children[k, 2]))
                depth += 1
    return True


@kernel
def _top_level(coarse: _CoarseLevels, width: int) -> int:
    """Return the level at which a search begins."""
    top = 0
    while top < coarse.shapes.shape[0] - 1 and (1 << top) < width:
        top += 1
    return max(top - SPARED_LEVELS, 0)


@kernel
def _cells_of(points: Array, window: _Window) -> Array:
    """Return the cells of points in the first placement of each heading.

    Points are in cells; the result is (headings, n, 2) int32.
    """
    headings, corner, count = window.headings, window.corner, points.shape[0]
    cells = np.empty((headings.shape[0], count, 2), np.int32)
    for turn in range(headings.shape[0]):
        cosine, sine = math.cos(headings[turn]), math.sin(headings[turn])
        for k in range(count):
            cells[turn, k, 0] = int(math.floor(cosine * points[k, 0] - sine * points[k, 1] + corner[0]))
            cells[turn, k, 1] = int(math.floor(sine * points[k, 0] + cosine * points[k, 1] + corner[1]))
    return cells


@kernel
def _bounds_of_blocks(coarse: _CoarseLevels, cells: Array, top: int, blocks: int) -> Array:
    """Return the bounds of all blocks of the top level.

    Heading by heading, row by row.
    """
    turns, maxima = cells.shape[0], coarse.maxima
    begin, rows, columns = coarse.shapes[top]
    bounds = np.empty(turns * blocks * blocks, np.int64)
    for turn in range(turns):
        for i in range(blocks):
            for j in range(blocks):
                bounds[(turn * blocks + i) * blocks + j] = _bound(
                    maxima, begin, rows, columns, top, cells[turn], j << top, i << top
                )
    return bounds


@kernel(forceinline=True)
def _push(stack: Array, depth: int, block: tuple[int, int, int, int, int]) -> None:
    """Put a block on a stack: its bound, level, heading index, column and row."""
    stack[depth, 0], stack[depth, 1], stack[depth, 2], stack[depth, 3], stack[depth, 4] = block


@kernel
def _divide(
    coarse: _CoarseLevels, cells: Array, block: tuple[int, int, int], width: int, best: float, children: Array
) -> tuple[int, int]:
    """Fill ``children`` with the parts of a block that can beat the best.

    They are in the order of their bounds; each is bound, column and row. Returns how many there are, and how
    many were examined.
    """
    level, column, row = block
    below, maxima = level - 1, coarse.maxima
    begin, rows, columns = coarse.shapes[below]
    half, number, examined = 1 << below, 0, 0
    for child in range(CHILDREN):
        x, y = column + (child & 1) * half, row + (child >> 1) * half
        if x >= width or y >= width:
            continue
        value = _bound(maxima, begin, rows, columns, below, cells, x, y)
        examined += 1
        if value > best:
            at = number
            while at > 0 and children[at - 1, 0] > value:
                children[at] = children[at - 1]
                at -= 1
            children[at, 0], children[at, 1], children[at, 2] = value, x, y
            number += 1
    return number, examined


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
        Index of each level's first in ``maxima``, its rows and its columns; level 0 is the map itself.
    """

    grid: AgreementGrid
    maxima: NDArray[np.uint8]
    shapes: NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class _Placement:
    """Result of a search.

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
) -> tuple[_Placement | None, bool]:
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
        Minimum score of a placement, from 0 to 1.
    evaluations : int
        Maximum number of examined placements and blocks of them.
    apart : ((3,) float64, float, float) or None
        A pose of which placements keep away: by the first distance [m], or by the second angle [rad].
    """
    if len(points) == 0:
        return None, True
    side = coarse.grid.resolution
    step = angle_step(points, side)
    steps, turns = math.ceil(reach[0] / side - 1e-9), math.ceil(reach[1] / step - 1e-9)
    headings = around[2] + step * np.arange(-turns, turns + 1)
    corner = np.array([around[0] / side - coarse.grid.column - steps, around[1] / side - coarse.grid.row - steps])
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
    least, window = float(FULL_LEVEL) * least_score * len(points), _Window(headings, corner, 2 * steps + 1)
    is_over = _find_placements(
        _CoarseLevels(coarse.maxima, coarse.shapes), points / side, window, least, evaluations, avoided, found
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
    return _Placement(pose, float(found[3]) / (float(FULL_LEVEL) * len(points))), is_over
