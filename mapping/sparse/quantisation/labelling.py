"""The nearest code of every point, by bounds on the boxes of groups and tiles.

A code whose least distance to a box is above the greatest distance of another one is nearest to no point in
it. Bounds and distances are rounded alike, operation by operation, and rounding keeps order: labels are those
of an exhaustive search in float32, where of equal codes the one of the lowest number is nearest.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.simd.codes import TILE, nearest_in_tile
from lidarium.mapping.sparse.quantisation.tiles import GROUP, Tiles

NO_SQUARES = np.empty((0, TILE), np.float32)
"""Given where distances are not wanted."""


class Candidates(NamedTuple):
    """Codes that may be nearest, of which the first few count, with room for one more.

    Attributes
    ----------
    codes : (3, k + 1) float32
        Coordinates [m].
    numbers : (k + 1,) int32
        Numbers of the codes, ascending.
    bounds : (2, k + 1) float32
        Least and greatest squared distances to a box [m2].
    """

    codes: NDArray[np.float32]
    numbers: NDArray[np.int32]
    bounds: NDArray[np.float32]


def label_points(
    tiles: Tiles,
    codes: NDArray[np.float32],
    labels: NDArray[np.int32],
    squares: NDArray[np.float32],
    sums: NDArray[np.float64],
) -> None:
    """Find the nearest code of every point.

    Parameters
    ----------
    tiles : Tiles
        The points.
    codes : (k, 3) float32
        The codes [m].
    labels : (tiles, TILE) int32
        Takes the numbers of the nearest codes.
    squares : (tiles, TILE) float32, or NO_SQUARES
        Takes the squared distances to them [m2].
    sums : (k, 4) float64
        Takes the sums of each code's weighted coordinates, and of its weights.
    """
    every, some = _candidates(codes), _candidates(codes)
    last, numbers = np.empty((len(codes) + 1, 3), np.float32), np.empty(len(codes) + 1, np.int32)
    nearest = np.empty(TILE, np.float32)
    sums[:] = 0.0
    _label(tiles, (every, some, Candidates(last.T, numbers, some.bounds)), nearest, labels, squares, sums)


def _candidates(codes: NDArray[np.float32]) -> Candidates:
    """Return all codes as candidates."""
    count = len(codes)
    room = np.empty((3, count + 1), np.float32)
    room[:, :count] = codes.T
    return Candidates(room, np.arange(count + 1, dtype=np.int32), np.empty((2, count + 1), np.float32))


@kernel(nrt=False)
def _label(
    tiles: Tiles,
    candidates: tuple[Candidates, Candidates, Candidates],
    nearest: Array,
    labels: Array,
    squares: Array,
    sums: Array,
) -> None:
    """Narrow all codes down to those of a group, of a tile, and of its points."""
    every, some, last = candidates
    is_silent = len(squares) == 0
    for group in range(len(tiles.group_boxes)):
        found = _narrow(tiles.group_boxes[group], every, len(sums), some)
        for tile in range(group * GROUP, min((group + 1) * GROUP, len(tiles.boxes))):
            left = _narrow(tiles.boxes[tile], some, found, last)
            own, only = labels[tile], last.numbers[0]
            if left == 1:
                own[:] = only
                for j in range(4):
                    sums[only, j] += tiles.sums[tile, j]
                if is_silent:
                    continue
            reached = nearest if is_silent else squares[tile]
            reached[:] = np.inf
            nearest_in_tile(
                tiles.points[tile].ctypes.data,
                last.codes.ctypes.data,
                last.numbers.ctypes.data,
                left,
                reached.ctypes.data,
                own.ctypes.data,
            )
            if left > 1:
                _add_points(tiles.points[tile], tiles.weights[tile], own, sums)


@kernel(forceinline=True, nrt=False)
def _narrow(box: Array, candidates: Candidates, count: int, kept: Candidates) -> int:
    """Keep those of ``count`` candidates that may be nearest in a box; return how many.

    Each is written, and the next one over it where it is not kept: this takes no branch.
    """
    _bound(box, candidates.codes, count, candidates.bounds)
    lower, upper = candidates.bounds[0], candidates.bounds[1]
    least = upper[0]
    for j in range(1, count):
        least = min(least, upper[j])
    found = 0
    for j in range(count):
        for axis in range(3):
            kept.codes[axis, found] = candidates.codes[axis, j]
        kept.numbers[found] = candidates.numbers[j]
        found += 1 if lower[j] <= least else 0
    return found


@kernel(forceinline=True, nrt=False)
def _bound(box: Array, codes: Array, count: int, bounds: Array) -> None:
    """Bound the squared distances from codes to a box, from below and from above."""
    low, high = box[0], box[1]
    zero = np.float32(0.0)
    for j in range(count):
        x_low, x_high = low[0] - codes[0, j], codes[0, j] - high[0]
        y_low, y_high = low[1] - codes[1, j], codes[1, j] - high[1]
        z_low, z_high = low[2] - codes[2, j], codes[2, j] - high[2]
        x, y, z = max(max(x_low, x_high), zero), max(max(y_low, y_high), zero), max(max(z_low, z_high), zero)
        bounds[0, j] = x * x + y * y + z * z
        x, y, z = max(abs(x_low), abs(x_high)), max(abs(y_low), abs(y_high)), max(abs(z_low), abs(z_high))
        bounds[1, j] = x * x + y * y + z * z


@kernel(forceinline=True, nrt=False)
def _add_points(points: Array, weights: Array, labels: Array, sums: Array) -> None:
    """Add the points of a tile to the sums of their codes."""
    for lane in range(TILE):
        number, mass = labels[lane], float(weights[lane])
        for axis in range(3):
            sums[number, axis] += mass * points[axis, lane]
        sums[number, 3] += mass
