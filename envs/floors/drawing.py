"""Exact drawing of polygons and thin walls into grids of cells.

A shape is a set of closed rings; a cell belongs to it if its centre is inside, by default by the even-odd rule. A
centre that lies exactly on an edge belongs to the shape on its right and above, so that two shapes that share an edge
share no cell.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import kernel
from lidarium.mapping.kernels.ordering import stable_order

Rings = list[NDArray[np.float64]]

# Corners are rounded to a millionth of a cell, so that a wall on a cell's centre line is drawn alike on all
# machines.
_SNAP = 1e6

_FEW = 16  # up to this number values are sorted fastest by insertion


def ring_edges(ring: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the edges of a closed ring.

    Parameters
    ----------
    ring : (N, 2) float64
        Corners in order [m].

    Returns
    -------
    (N, 4) float64
        x1, y1, x2, y2 per edge [m].
    """
    return np.concatenate([ring, np.concatenate([ring[1:], ring[:1]])], axis=1)


def fill_shapes(
    cells: NDArray[np.uint8],
    origin: tuple[float, float],
    resolution: float,
    shapes: Sequence[NDArray[np.float64]] | NDArray[np.float64],
    value: int,
    *,
    is_nonzero: bool = False,
) -> None:
    """Set the cells whose centre is inside a shape, in place.

    Parameters
    ----------
    cells : (rows, columns) uint8
        Grid to draw into; row 0 at the lowest y.
    origin, resolution : (float, float), float
        Lower left corner of cell (0, 0) and side of a cell [m].
    shapes : sequence of (E, 4) float64
        Edges x1, y1, x2, y2 of each shape [m]; together they close its rings.
    is_nonzero : bool, optional
        Whether to use the nonzero rule: overlaps of rings with the same direction are inside. False by default, which
        is the even-odd rule: where two rings overlap is outside.
    """
    if not len(shapes):
        return
    edges = (np.concatenate(shapes) - np.tile(origin, 2)) / resolution - 0.5
    ends = np.cumsum([len(shape) for shape in shapes], dtype=np.int64)
    _fill(cells, np.rint(edges * _SNAP) / _SNAP, ends, np.uint8(value), is_nonzero)


def draw_segments(
    cells: NDArray[np.uint8],
    origin: tuple[float, float],
    resolution: float,
    segments: NDArray[np.float64],
    value: int,
) -> None:
    """Set every cell that a segment crosses, in place.

    The line is 4-connected, so no ray slips through it.

    Parameters
    ----------
    segments : (N, 4) float64
        x1, y1, x2, y2 per segment [m].
    """
    scaled = (np.asarray(segments, dtype=np.float64).reshape(-1, 4) - np.tile(origin, 2)) / resolution
    _draw_lines(cells, np.rint(scaled * _SNAP) / _SNAP, np.uint8(value))


def strip(segment: NDArray[np.float64], thickness: float, overhang: float = 0.0) -> NDArray[np.float64]:
    """Return the rectangle around a segment.

    Parameters
    ----------
    segment : (4,) float64
        x1, y1, x2, y2 [m].
    thickness : float
        Width of the rectangle [m].
    overhang : float
        Additional length beyond both ends [m].

    Returns
    -------
    (4, 2) float64
        Corners, counter-clockwise [m].
    """
    start, end = segment[:2], segment[2:]
    length = math.hypot(*(end - start))
    along = (end - start) / length if length > 0.0 else np.array([1.0, 0.0])
    across = np.array([-along[1], along[0]]) * thickness / 2.0
    start, end = start - along * overhang, end + along * overhang
    return np.array([start - across, end - across, end + across, start + across])


def strip_edges(
    segments: NDArray[np.float64],
    thickness: float | NDArray[np.float64],
    overhang_share: float | NDArray[np.float64] = 0.0,
) -> NDArray[np.float64]:
    """Return the edges of the rectangles around many segments, as `fill_shapes` wants them.

    Parameters
    ----------
    segments : (N, 4) float64
        x1, y1, x2, y2 [m].
    thickness : float or (N,) float64
        Width of the rectangles [m].
    overhang_share : float or (N, 2) float64, optional
        Length beyond the start and the end of each, as a share of its width; none by default.

    Returns
    -------
    (N, 4, 4) float64
        x1, y1, x2, y2 of the four edges of each [m].
    """
    start, end = segments[:, :2], segments[:, 2:]
    steps = end - start
    lengths = np.hypot(steps[:, 0], steps[:, 1])[:, None]
    is_point = lengths == 0.0
    widths = np.broadcast_to(thickness, len(segments))[:, None]
    along = np.where(is_point, (1.0, 0.0), steps / np.where(is_point, 1.0, lengths)) * widths
    across = np.stack([-along[:, 1], along[:, 0]], axis=1) / 2.0
    shares = np.broadcast_to(overhang_share, (len(segments), 2))
    start, end = start - along * shares[:, :1], end + along * shares[:, 1:]
    corners = np.stack([start - across, end - across, end + across, start + across], axis=1)
    return np.concatenate([corners, np.roll(corners, -1, axis=1)], axis=2)


@kernel
def _fill(
    cells: NDArray[np.uint8],
    edges: NDArray[np.float64],
    ends: NDArray[np.int64],
    value: np.uint8,
    is_nonzero: bool,
) -> None:
    rows, columns = cells.shape
    first = 0
    for last in ends:
        low, high = rows, -1
        for k in range(first, last):
            low = min(low, math.ceil(min(edges[k, 1], edges[k, 3])))
            high = max(high, math.ceil(max(edges[k, 1], edges[k, 3])) - 1)
        low, high = max(low, 0), min(high, rows - 1)
        if low <= high:
            offsets = np.zeros(high - low + 2, np.int64)
            for k in range(first, last):
                bottom = max(math.ceil(min(edges[k, 1], edges[k, 3])), low)
                top = min(math.ceil(max(edges[k, 1], edges[k, 3])) - 1, high)
                for i in range(bottom, top + 1):
                    offsets[i - low + 1] += 1
            for i in range(1, len(offsets)):
                offsets[i] += offsets[i - 1]
            crossings, turns = np.empty(offsets[-1], np.float64), np.empty(offsets[-1], np.int64)
            position = offsets[:-1].copy()
            for k in range(first, last):
                x, y = edges[k, 0], edges[k, 1]
                bottom = max(math.ceil(min(y, edges[k, 3])), low)
                top = min(math.ceil(max(y, edges[k, 3])) - 1, high)
                for i in range(bottom, top + 1):
                    crossings[position[i - low]] = x + (i - y) * (edges[k, 2] - x) / (edges[k, 3] - y)
                    turns[position[i - low]] = 1 if edges[k, 3] > y else -1
                    position[i - low] += 1
            for i in range(low, high + 1):
                row = crossings[offsets[i - low] : offsets[i - low + 1]]
                turn = turns[offsets[i - low] : offsets[i - low + 1]]
                _sort(row, turn)
                winding = 0
                for k in range(len(row) - 1):
                    winding += turn[k]
                    is_inside = winding != 0 if is_nonzero else k % 2 == 0
                    if is_inside:
                        left = min(max(math.ceil(row[k]), 0), columns)
                        right = min(max(math.ceil(row[k + 1]), 0), columns)
                        cells[i, left:right] = value
        first = last


@kernel
def _sort(values: NDArray[np.float64], turns: NDArray[np.int64]) -> None:
    """Sort values in place, and turns in their order; rows of most shapes have two values."""
    if len(values) > _FEW:
        order = stable_order(values)
        values[:], turns[:] = values[order], turns[order]
        return
    for k in range(1, len(values)):
        value, turn, place = values[k], turns[k], k
        while place > 0 and values[place - 1] > value:
            values[place], turns[place] = values[place - 1], turns[place - 1]
            place -= 1
        values[place], turns[place] = value, turn


@kernel
def _draw_lines(cells: NDArray[np.uint8], segments: NDArray[np.float64], value: np.uint8) -> None:
    rows, columns = cells.shape
    for k in range(len(segments)):
        x, y, x_end, y_end = segments[k]
        i, j, i_end, j_end = math.floor(y), math.floor(x), math.floor(y_end), math.floor(x_end)
        i_step, j_step = (1 if i_end >= i else -1), (1 if j_end >= j else -1)
        dx, dy = abs(x_end - x), abs(y_end - y)
        # Steps to take are counted beforehand: a walk by distance alone may miss its last cell at a lattice
        # corner.
        i_left, j_left = abs(i_end - i), abs(j_end - j)
        to_side = (j + 1 - x) if j_step > 0 else (x - j)
        to_top = (i + 1 - y) if i_step > 0 else (y - i)
        while True:
            if 0 <= i < rows and 0 <= j < columns:
                cells[i, j] = value
            if i_left == 0 and j_left == 0:
                break
            if i_left == 0 or (j_left > 0 and to_side * dy <= to_top * dx):
                j += j_step
                j_left -= 1
                to_side += 1.0
            else:
                i += i_step
                i_left -= 1
                to_top += 1.0
