"""First codes: K-means++, which draws each next one by the squared distance to those before.

Source: D. Arthur, S. Vassilvitskii, "k-means++: the advantages of careful seeding", SODA 2007; the thesis's
algorithm 4, whose printed norm lacks the square. Sums of a tile's squares are kept, and only those of tiles
that a new code may come nearer to are made anew, so that draws are exact.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.simd.codes import TILE, nearest_in_tile
from lidarium.mapping.kernels.views import scratch_vector
from lidarium.mapping.sparse.quantisation.tiles import GROUP, Tiles


class Nearest(NamedTuple):
    """The nearest code of every point so far.

    Attributes
    ----------
    labels : (tiles, TILE) int32
        Its number.
    squares : (tiles, TILE) float32
        Squared distance to it [m2]; inf before there is a code.
    errors, group_errors : (tiles,) float64, (groups,) float64
        Sums of weighted squares [m2].
    worst, group_worst : (tiles,) float32, (groups,) float32
        Greatest squares [m2].
    """

    labels: NDArray[np.int32]
    squares: NDArray[np.float32]
    errors: NDArray[np.float64]
    group_errors: NDArray[np.float64]
    worst: NDArray[np.float32]
    group_worst: NDArray[np.float32]


def nearest_of_none(tiles: Tiles) -> Nearest:
    """Return the state before there is a code: the error of a tile is its weight."""
    count, groups = len(tiles.boxes), len(tiles.group_boxes)
    errors = tiles.sums[:, 3].copy()
    starts = np.arange(0, count, GROUP)
    return Nearest(
        np.zeros((count, TILE), np.int32),
        np.full((count, TILE), np.inf, np.float32),
        errors,
        np.add.reduceat(errors, starts),
        np.full(count, np.inf, np.float32),
        np.full(groups, np.inf, np.float32),
    )


def drawn_codes(
    tiles: Tiles, count: int, generator: np.random.Generator
) -> tuple[NDArray[np.float32], Nearest]:
    """Draw codes among the points by K-means++.

    Parameters
    ----------
    tiles : Tiles
        The points.
    count : int
        How many codes.
    generator : Generator
        Gives one number a code.

    Returns
    -------
    codes : (count, 3) float32
        Different points.
    nearest : Nearest
        The nearest of them of every point.

    Raises
    ------
    ValueError
        Where there are fewer different points.
    """
    nearest, codes = nearest_of_none(tiles), np.empty((count, 3), np.float32)
    found = draw_codes(tiles, generator.random(count), codes, nearest)
    if found < count:
        raise ValueError(
            f"points are at {found:,} different places; want at least {count:,}, one for each code"
        )
    return codes, nearest


@kernel(nrt=False)
def draw_codes(tiles: Tiles, draws: Array, codes: Array, nearest: Nearest) -> int:
    """Draw a code for each number in [0, 1); return for how many there were places."""
    shares = scratch_vector(TILE, np.float64)
    for number in range(len(draws)):
        total = 0.0
        for error in nearest.group_errors:
            total += error
        if total <= 0.0:
            return number
        group, rest = _reached(nearest.group_errors, draws[number] * total)
        first = group * GROUP
        tile, rest = _reached(nearest.errors[first : first + GROUP], rest)
        tile += first
        for lane in range(TILE):
            square = 1.0 if number == 0 else float(nearest.squares[tile, lane])
            shares[lane] = tiles.weights[tile, lane] * square
        lane, rest = _reached(shares, rest)
        for axis in range(3):
            codes[number, axis] = tiles.points[tile, axis, lane]
        come_nearer(tiles, codes[number], number, nearest)
    return len(draws)


@kernel(forceinline=True, nrt=False)
def _reached(shares: Array, wanted: float) -> tuple[int, float]:
    """Return in which share, never an empty one, a running sum is, and what is left."""
    chosen, left = 0, 0.0
    for place in range(len(shares)):
        if shares[place] > 0.0:
            chosen, left = place, wanted
            if wanted < shares[place]:
                break
            wanted -= shares[place]
    return chosen, left


@kernel(nrt=False)
def come_nearer(tiles: Tiles, code: Array, number: int, nearest: Nearest) -> None:
    """Let the points that a new code is nearer to change to it."""
    numbers = scratch_vector(1, np.int32)
    numbers[0] = number
    for group in range(len(tiles.group_boxes)):
        if _least_square(tiles.group_boxes[group], code) >= nearest.group_worst[group]:
            continue
        error, worst, is_changed = 0.0, np.float32(0.0), False
        for tile in range(group * GROUP, min((group + 1) * GROUP, len(tiles.boxes))):
            if _least_square(tiles.boxes[tile], code) < nearest.worst[tile]:
                nearest_in_tile(
                    tiles.points[tile].ctypes.data,
                    code.ctypes.data,
                    numbers.ctypes.data,
                    1,
                    nearest.squares[tile].ctypes.data,
                    nearest.labels[tile].ctypes.data,
                )
                nearest.errors[tile], nearest.worst[tile] = _error_of(
                    tiles.weights[tile], nearest.squares[tile]
                )
                is_changed = True
            error += nearest.errors[tile]
            worst = max(worst, nearest.worst[tile])
        if is_changed:
            nearest.group_errors[group], nearest.group_worst[group] = error, worst


@kernel(forceinline=True, nrt=False)
def _least_square(box: Array, code: Array) -> Any:  # noqa: ANN401
    """Return a lower bound of squared distances from a code to a box [m2]."""
    zero = np.float32(0.0)
    x = max(max(box[0, 0] - code[0], code[0] - box[1, 0]), zero)
    y = max(max(box[0, 1] - code[1], code[1] - box[1, 1]), zero)
    z = max(max(box[0, 2] - code[2], code[2] - box[1, 2]), zero)
    return x * x + y * y + z * z


@kernel(forceinline=True, nrt=False)
def _error_of(weights: Array, squares: Array) -> tuple[float, Any]:
    """Return the sum of a tile's weighted squares, and the greatest square.

    In four parts, none of which waits for the others.
    """
    first, second, third, fourth = 0.0, 0.0, 0.0, 0.0
    worst = np.float32(0.0)
    for lane in range(0, TILE, 4):
        first += float(weights[lane]) * float(squares[lane])
        second += float(weights[lane + 1]) * float(squares[lane + 1])
        third += float(weights[lane + 2]) * float(squares[lane + 2])
        fourth += float(weights[lane + 3]) * float(squares[lane + 3])
        worst = max(
            worst, max(max(squares[lane], squares[lane + 1]), max(squares[lane + 2], squares[lane + 3]))
        )
    return (first + second) + (third + fourth), worst


@kernel(nrt=False)
def measure(tiles: Tiles, nearest: Nearest) -> None:
    """Make the sums and greatest ones of squares anew."""
    for group in range(len(tiles.group_boxes)):
        error, worst = 0.0, np.float32(0.0)
        for tile in range(group * GROUP, min((group + 1) * GROUP, len(tiles.boxes))):
            nearest.errors[tile], nearest.worst[tile] = _error_of(tiles.weights[tile], nearest.squares[tile])
            error += nearest.errors[tile]
            worst = max(worst, nearest.worst[tile])
        nearest.group_errors[group], nearest.group_worst[group] = error, worst
