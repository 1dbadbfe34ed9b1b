"""K-means by exact bounds on tiles: seeding, labelling, Lloyd's iterations, summaries of points."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.simd.codes import TILE, nearest_in_tile
from lidarium.mapping.kernels.views import scratch_grid, scratch_vector
from lidarium.mapping.sparse.quantisation.tiles import GROUP, Tiles

NO_SQUARES = np.empty((0, TILE), np.float32)
"""Given if distances are not wanted."""


class _Candidates(NamedTuple):
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


def _label_points(
    tiles: Tiles,
    codes: NDArray[np.float32],
    labels: NDArray[np.int32],
    squares: NDArray[np.float32],
    sums: NDArray[np.float64],
) -> None:
    """Find the nearest code of every point.

    Parameters
    ----------
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
    _label(tiles, (every, some, _Candidates(last.T, numbers, some.bounds)), nearest, labels, squares, sums)


def _candidates(codes: NDArray[np.float32]) -> _Candidates:
    """Return all codes as candidates."""
    count = len(codes)
    room = np.empty((3, count + 1), np.float32)
    room[:, :count] = codes.T
    return _Candidates(room, np.arange(count + 1, dtype=np.int32), np.empty((2, count + 1), np.float32))


@kernel(nrt=False)
def _label(
    tiles: Tiles,
    candidates: tuple[_Candidates, _Candidates, _Candidates],
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
def _narrow(box: Array, candidates: _Candidates, count: int, kept: _Candidates) -> int:
    """Keep those of ``count`` candidates that may be nearest in a box; return how many.

    Each is written, and the next one overwrites it if it is not kept: this needs no branch.
    """
    _bound(box, candidates.codes, count, candidates.bounds)
    lower, upper = candidates.bounds[0], candidates.bounds[1]
    minimum = upper[0]
    for j in range(1, count):
        minimum = min(minimum, upper[j])
    found = 0
    for j in range(count):
        for axis in range(3):
            kept.codes[axis, found] = candidates.codes[axis, j]
        kept.numbers[found] = candidates.numbers[j]
        found += 1 if lower[j] <= minimum else 0
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


def _nearest_of_none(tiles: Tiles) -> Nearest:
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


def drawn_codes(tiles: Tiles, count: int, generator: np.random.Generator) -> tuple[NDArray[np.float32], Nearest]:
    """Draw codes among the points by K-means++.

    Returns
    -------
    codes : (count, 3) float32
        Different points.
    """
    nearest, codes = _nearest_of_none(tiles), np.empty((count, 3), np.float32)
    found = _draw_codes(tiles, generator.random(count), codes, nearest)
    if found < count:
        raise ValueError(f"points are at {found:,} different places; want at least {count:,}, one for each code")
    return codes, nearest


@kernel(nrt=False)
def _draw_codes(tiles: Tiles, draws: Array, codes: Array, nearest: Nearest) -> int:
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
        _come_nearer(tiles, codes[number], number, nearest)
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
def _come_nearer(tiles: Tiles, code: Array, number: int, nearest: Nearest) -> None:
    """Let the points that a new code is nearer to change to it."""
    numbers = scratch_vector(1, np.int32)
    numbers[0] = number
    for group in range(len(tiles.group_boxes)):
        if _min_square(tiles.group_boxes[group], code) >= nearest.group_worst[group]:
            continue
        error, worst, is_changed = 0.0, np.float32(0.0), False
        for tile in range(group * GROUP, min((group + 1) * GROUP, len(tiles.boxes))):
            if _min_square(tiles.boxes[tile], code) < nearest.worst[tile]:
                nearest_in_tile(
                    tiles.points[tile].ctypes.data,
                    code.ctypes.data,
                    numbers.ctypes.data,
                    1,
                    nearest.squares[tile].ctypes.data,
                    nearest.labels[tile].ctypes.data,
                )
                nearest.errors[tile], nearest.worst[tile] = _error_of(tiles.weights[tile], nearest.squares[tile])
                is_changed = True
            error += nearest.errors[tile]
            worst = max(worst, nearest.worst[tile])
        if is_changed:
            nearest.group_errors[group], nearest.group_worst[group] = error, worst


@kernel(forceinline=True, nrt=False)
def _min_square(box: Array, code: Array) -> Any:  # noqa: ANN401
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
        worst = max(worst, max(max(squares[lane], squares[lane + 1]), max(squares[lane + 2], squares[lane + 3])))
    return (first + second) + (third + fourth), worst


@kernel(nrt=False)
def _measure(tiles: Tiles, nearest: Nearest) -> None:
    """Make the sums and greatest ones of squares anew."""
    for group in range(len(tiles.group_boxes)):
        error, worst = 0.0, np.float32(0.0)
        for tile in range(group * GROUP, min((group + 1) * GROUP, len(tiles.boxes))):
            nearest.errors[tile], nearest.worst[tile] = _error_of(tiles.weights[tile], nearest.squares[tile])
            error += nearest.errors[tile]
            worst = max(worst, nearest.worst[tile])
        nearest.group_errors[group], nearest.group_worst[group] = error, worst


Codes = NDArray[np.float32]
Improve = Callable[[Tiles, Codes, int], Codes]
"""Takes Lloyd's steps: tiles, codes, and how many."""


def improved(tiles: Tiles, codes: Codes, steps: int, keeps_empty: bool = False) -> Codes:
    """Return codes after some of Lloyd's steps.

    Parameters
    ----------
    codes : (k, 3) float32
        Codes to start from [m].

    Returns
    -------
    (k, 3) float32
        The codes.
    """
    labels, sums = np.empty((len(tiles.boxes), TILE), np.int32), np.empty((len(codes), 4))
    for _ in range(steps):
        _label_points(tiles, codes, labels, NO_SQUARES, sums)
        codes = means_of(tiles, codes, sums, keeps_empty)
    return codes


def means_of(tiles: Tiles, codes: Codes, sums: NDArray[np.float64], keeps_empty: bool = False) -> Codes:
    """Return the means of codes' points; codes of none stay or go to far points."""
    masses = sums[:, 3:]
    is_empty = masses[:, 0] == 0.0
    if not is_empty.any():
        return (sums[:, :3] / masses).astype(np.float32)
    means = np.where(is_empty[:, None], codes, sums[:, :3] / np.where(masses == 0.0, 1.0, masses))
    moved = means.astype(np.float32)
    return moved if keeps_empty else at_far_points(tiles, moved, is_empty)


def at_far_points(tiles: Tiles, codes: Codes, is_empty: NDArray[np.bool_]) -> Codes:
    """Move some codes, one by one, to the point that is farthest from all others."""
    nearest, moved = nearest_codes(tiles, codes[~is_empty]), codes.copy()
    for number in np.flatnonzero(is_empty):
        farthest = _farthest_point(tiles, nearest)
        if len(farthest) == 0:
            raise ValueError(
                f"points are at fewer than {len(codes):,} different places; want at least one for each code"
            )
        moved[number] = farthest
        _come_nearer(tiles, farthest, number, nearest)
    return moved


def nearest_codes(tiles: Tiles, codes: Codes) -> Nearest:
    """Return the nearest code of every point, with the distance to it."""
    nearest = _nearest_of_none(tiles)
    _label_points(tiles, codes, nearest.labels, nearest.squares, np.empty((len(codes), 4)))
    _measure(tiles, nearest)
    return nearest


@kernel
def _farthest_point(tiles: Tiles, nearest: Nearest) -> Array:
    """Return the point farthest from its code, (3,); (0,) if all are at codes."""
    tile = int(np.argmax(nearest.worst))
    if nearest.worst[tile] == np.float32(0.0):
        return np.empty(0, np.float32)
    return tiles.points[tile, :, np.argmax(nearest.squares[tile])].copy()


AXES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""The axes of the six second moments."""

_FIRST_PRODUCT = 3
_MOMENTS = 9


class Summary(NamedTuple):
    """Sums over each code's points, with offsets of points from the code.

    Attributes
    ----------
    counts : (k,) int64
        Points.
    masses : (k,) float64
        Weights.
    errors : (k, 2) float64
        Weighted distances [m], and squared ones [m2].
    moments : (k, 9) float64
        Weighted offsets along three axes [m], and products of two, in the order of ``AXES`` [m2].
    boxes : (k, 2, 3) float32
        Least and greatest coordinates [m]; of no points, inf and -inf.
    radii : (k,) float32
        Greatest distance [m].
    """

    counts: NDArray[np.int64]
    masses: NDArray[np.float64]
    errors: NDArray[np.float64]
    moments: NDArray[np.float64]
    boxes: NDArray[np.float32]
    radii: NDArray[np.float32]

    def means(self, codes: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the means of codes' points, (k, 3) [m]; of no points, the code."""
        offsets = self.moments[:, :3] / np.maximum(self.masses, np.finfo(np.float64).tiny)[:, None]
        return (codes + offsets).astype(np.float32)

    def covariances(self) -> NDArray[np.float64]:
        """Return the covariances of each code's points, (k, 3, 3) [m2]; zero of no points."""
        parts = self.moments / np.maximum(self.masses, np.finfo(np.float64).tiny)[:, None]
        matrices = np.empty((len(parts), 3, 3))
        for place, (first, second) in enumerate(AXES):
            value = parts[:, _FIRST_PRODUCT + place] - parts[:, first] * parts[:, second]
            matrices[:, first, second] = matrices[:, second, first] = value
        return matrices


def summary_of(tiles: Tiles, codes: NDArray[np.float32], nearest: Nearest) -> Summary:
    """Sum up the statistics of the points of each code.

    Parameters
    ----------
    codes : (k, 3) float32
        The codes [m].
    """
    count = len(codes)
    boxes = np.empty((count, 2, 3), np.float32)
    boxes[:, 0], boxes[:, 1] = np.inf, -np.inf
    summary = Summary(
        np.zeros(count, np.int64),
        np.zeros(count),
        np.zeros((count, 2)),
        np.zeros((count, _MOMENTS)),
        boxes,
        np.zeros(count, np.float32),
    )
    _sum_up(tiles, len(tiles.order), codes, nearest, summary)
    return summary


@kernel(nrt=False)
def _sum_up(tiles: Tiles, count: int, codes: Array, nearest: Nearest, summary: Summary) -> None:
    """Add every point to the sums of its code, tiles of one code at once."""
    distances, offsets = scratch_vector(TILE, np.float32), scratch_grid(3, TILE, np.float64)
    own = scratch_vector(_MOMENTS, np.float64)
    for tile in range(len(tiles.boxes)):
        labels, weights = nearest.labels[tile], tiles.weights[tile]
        found = min(TILE, count - tile * TILE)
        changes = 0
        for lane in range(TILE):
            changes |= labels[lane] ^ labels[0]
            distances[lane] = np.sqrt(nearest.squares[tile, lane])
            for axis in range(3):
                side = tiles.points[tile, axis, lane]
                offsets[axis, lane] = float(side) - float(codes[labels[lane], axis])
        if changes == 0:
            number = labels[0]
            _stretch(summary.boxes[number], tiles.boxes[tile, 0], tiles.boxes[tile, 1])
            summary.counts[number] += found
            summary.masses[number] += tiles.sums[tile, 3]
            summary.errors[number, 1] += nearest.errors[tile]
            summary.radii[number] = max(summary.radii[number], np.sqrt(nearest.worst[tile]))
            _add_all(weights, distances, offsets, summary.errors[number], summary.moments[number])
            continue
        for lane in range(found):
            number, mass, reach = labels[lane], float(weights[lane]), distances[lane]
            point = tiles.points[tile, :, lane]
            _stretch(summary.boxes[number], point, point)
            summary.counts[number] += 1
            summary.masses[number] += mass
            summary.errors[number, 0] += mass * float(reach)
            summary.errors[number, 1] += mass * float(nearest.squares[tile, lane])
            summary.radii[number] = max(summary.radii[number], reach)
            _set_moments(offsets, lane, mass, own)
            for moment in range(_MOMENTS):
                summary.moments[number, moment] += own[moment]


@kernel(forceinline=True, nrt=False)
def _stretch(box: Array, low: Array, high: Array) -> None:
    """Stretch a box so that it holds another one."""
    for axis in range(3):
        box[0, axis] = min(box[0, axis], low[axis])
        box[1, axis] = max(box[1, axis], high[axis])


@kernel(forceinline=True, nrt=False)
def _set_moments(offsets: Array, lane: int, mass: float, own: Array) -> None:
    """Set the moments of a point."""
    x, y, z = offsets[0, lane], offsets[1, lane], offsets[2, lane]
    own[0], own[1], own[2] = mass * x, mass * y, mass * z
    own[3], own[4], own[5] = own[0] * x, own[1] * y, own[2] * z
    own[6], own[7], own[8] = own[0] * y, own[0] * z, own[1] * z


@kernel(forceinline=True, nrt=False)
def _add_all(weights: Array, distances: Array, offsets: Array, errors: Array, moments: Array) -> None:
    """Add the distances and moments of a tile's points to those of a code."""
    far, a, b, c, aa, bb, cc, ab, ac, bc = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for lane in range(TILE):
        mass = float(weights[lane])
        x, y, z = offsets[0, lane], offsets[1, lane], offsets[2, lane]
        u, v, w = mass * x, mass * y, mass * z
        far += mass * float(distances[lane])
        a, b, c = a + u, b + v, c + w
        aa, bb, cc = aa + u * x, bb + v * y, cc + w * z
        ab, ac, bc = ab + u * y, ac + u * z, bc + v * z
    errors[0] += far
    for moment, value in enumerate((a, b, c, aa, bb, cc, ab, ac, bc)):
        moments[moment] += value
