"""Kernels that insert a scan into the cells of a submap."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.grids.scan_geometry import beam_directions
from lidarium.mapping.grids.scan_polygon import (
    GRAZING,
    fill_scan_polygon,
    scan_ends,
    window_rows,
    window_words,
)
from lidarium.mapping.kernels.compilation import Array, kernel

MOST_BETWEEN = 10
"""Points of a surface between two ends of neighbouring beams.

Ends farther apart [cells] are not joined.
"""


class Cells(NamedTuple):
    """What a local map holds of its cells.

    Attributes
    ----------
    shares, weights : (rows, columns) float32
        The largest share that an end of the present scan has in a cell, zero between scans; and the sum of
        such shares over all scans.
    counts : (rows, columns) uint16
        How many scans observed it.
    levels : (rows, columns) uint8
        See ``AgreementGrid``.
    box : (4,) int64
        First and last row and column that were observed, the last ones excluded.
    """

    shares: NDArray[np.float32]
    weights: NDArray[np.float32]
    counts: NDArray[np.uint16]
    levels: NDArray[np.uint8]
    box: NDArray[np.int64]


@kernel
def insert_scan(
    cells: Cells,
    place: tuple[float, float, float],
    ranges: Array,
    geometry: tuple[float, float, float, float, float, float],
    unit_vectors: Array,
) -> None:
    """Take in a scan from x, y [cells], heading.

    ``geometry`` is (increment, reach [cells], cells per metre, full circle, how far walls behind an end count
    as seen through [cells], the same as a share of the range).
    """
    shares, weights, counts, levels, box = cells
    increment, reach, scale, full_circle, behind, behind_share = geometry
    beams = ranges.shape[0]
    directions = np.empty((4, beams))
    beam_directions(place[2], unit_vectors, directions)
    lengths, ends = np.empty(beams), np.empty((2, beams))
    is_hit = np.empty(beams, np.bool_)
    for beam in range(beams):
        value = float(ranges[beam])
        is_hit[beam] = math.isfinite(value) and 0.0 < value * scale <= reach
        lengths[beam] = 0.0 if math.isnan(value) else min(max(value, 0.0) * scale, reach)
    bits = np.zeros((window_rows(reach), window_words(reach)), np.uint64)
    margin = int(reach) + 3
    row_offset = int(math.floor(place[1])) - margin
    column_offset = ((int(math.floor(place[0])) - margin) >> 6) << 6
    local_x, local_y = place[0] - column_offset, place[1] - row_offset
    scan_ends(lengths, directions, local_x, local_y, ends)
    seen = fill_scan_polygon(lengths, directions, ends, local_x, local_y, increment, full_circle != 0.0, bits)
    points = _surface_points(lengths, ends, is_hit, increment, full_circle != 0.0)
    if behind_share > 0.0:
        seen = _mark_behind(
            weights, points, (local_x, local_y), (behind, behind_share), bits, seen, row_offset, column_offset
        )
    _count_ends(shares, weights, counts, levels, points, bits, row_offset, column_offset)
    _count_seen(weights, counts, levels, bits, seen, row_offset, column_offset)
    rows, columns = levels.shape
    # Ends are shared out among neighbours, which may lie a cell beyond what was seen.
    box[0], box[1] = (
        min(box[0], max(seen[0] + row_offset - 1, 0)),
        max(box[1], min(seen[1] + row_offset + 1, rows)),
    )
    low, high = 64 * seen[2] + column_offset, 64 * seen[3] + column_offset
    box[2], box[3] = min(box[2], max(low - 1, 0)), max(box[3], min(high + 1, columns))


@kernel
def _surface_points(
    lengths: Array, ends: Array, is_hit: Array, increment: float, is_full_circle: bool
) -> Array:
    """Return beam ends and points between them, shape (points, 2) [cells].

    Points lie a cell apart between neighbouring ends on one surface.
    """
    beams = lengths.shape[0]
    points = np.empty((beams * (MOST_BETWEEN + 1), 2))
    count = 0
    for beam in range(beams):
        if not is_hit[beam]:
            continue
        points[count, 0], points[count, 1] = ends[0, beam], ends[1, beam]
        count += 1
        follower = beam + 1
        if follower == beams:
            if not is_full_circle:
                continue
            follower = 0
        if not is_hit[follower]:
            continue
        if abs(lengths[follower] - lengths[beam]) > 1.0 + GRAZING * increment * min(
            lengths[follower], lengths[beam]
        ):
            continue
        gap_x, gap_y = ends[0, follower] - ends[0, beam], ends[1, follower] - ends[1, beam]
        between = int(math.sqrt(gap_x * gap_x + gap_y * gap_y))
        if between > MOST_BETWEEN:
            continue
        for k in range(1, between + 1):
            share = k / (between + 1.0)
            points[count, 0], points[count, 1] = ends[0, beam] + share * gap_x, ends[1, beam] + share * gap_y
            count += 1
    return points[:count]


@kernel
def _mark_behind(
    weights: Array,
    points: Array,
    laser: tuple[float, float],
    depths: tuple[float, float],
    bits: Array,
    seen: tuple[int, int, int, int],
    row_offset: int,
    column_offset: int,
) -> tuple[int, int, int, int]:
    """Set the bits of cells a little behind points of a surface.

    Only cells in which beams have ended before. Returns the rows and words with bits.
    """
    first_row, end_row, first_word, end_word = seen
    for k in range(points.shape[0]):
        x, y = points[k, 0] - laser[0], points[k, 1] - laser[1]
        distance = math.sqrt(x * x + y * y)
        if distance == 0.0:
            continue
        steps = 2.0 * max(depths[0], depths[1] * distance)
        step_x, step_y = 0.5 * x / distance, 0.5 * y / distance
        for step in range(1, int(steps) + 1):
            column, row = (
                int(math.floor(points[k, 0] + step * step_x)),
                int(math.floor(points[k, 1] + step * step_y)),
            )
            if not (
                0 <= row < bits.shape[0]
                and 0 <= column < min(64 * bits.shape[1], weights.shape[1] - column_offset)
            ):
                break
            if weights[row + row_offset, column + column_offset] > 0.0:
                bits[row, column >> 6] |= np.uint64(1) << np.uint64(column & 63)
                first_row, end_row = min(first_row, row), max(end_row, row + 1)
                first_word, end_word = min(first_word, column >> 6), max(end_word, (column >> 6) + 1)
    return first_row, end_row, first_word, end_word


@kernel
def _count_ends(
    shares: Array,
    weights: Array,
    counts: Array,
    levels: Array,
    points: Array,
    bits: Array,
    row_offset: int,
    column_offset: int,
) -> None:
    """Add to each cell the largest share that it has in a point of a surface, once.

    Take its bit out of what was seen through.

    ``shares`` is zero on entry and on return.
    """
    for k in range(points.shape[0]):
        x, y = points[k, 0] - 0.5, points[k, 1] - 0.5
        column, row = int(math.floor(x)), int(math.floor(y))
        right, up = x - column, y - row
        column, row = column + column_offset, row + row_offset
        shares[row, column] = max(shares[row, column], np.float32((1.0 - right) * (1.0 - up)))
        shares[row, column + 1] = max(shares[row, column + 1], np.float32(right * (1.0 - up)))
        shares[row + 1, column] = max(shares[row + 1, column], np.float32((1.0 - right) * up))
        shares[row + 1, column + 1] = max(shares[row + 1, column + 1], np.float32(right * up))
    for k in range(points.shape[0]):
        column, row = int(math.floor(points[k, 0] - 0.5)), int(math.floor(points[k, 1] - 0.5))
        for corner in range(4):
            i, j = row + (corner >> 1), column + (corner & 1)
            share = shares[i + row_offset, j + column_offset]
            if share > 0.0:
                bits[i, j >> 6] &= ~(np.uint64(1) << np.uint64(j & 63))
                _observe(weights, counts, levels, i + row_offset, j + column_offset, share)
                shares[i + row_offset, j + column_offset] = 0.0


@kernel
def _count_seen(
    weights: Array,
    counts: Array,
    levels: Array,
    bits: Array,
    seen: tuple[int, int, int, int],
    row_offset: int,
    column_offset: int,
) -> None:
    """Count the cells that the scan saw through."""
    for row in range(seen[0], seen[1]):
        for word in range(seen[2], seen[3]):
            value = bits[row, word]
            if value == np.uint64(0):
                continue
            first = 64 * word + column_offset
            for k in range(64):
                if (value >> np.uint64(k)) & np.uint64(1):
                    _observe(weights, counts, levels, row + row_offset, first + k, np.float32(0.0))


@kernel(forceinline=True)
def _observe(weights: Array, counts: Array, levels: Array, row: int, column: int, share: float) -> None:
    counts[row, column] += np.uint16(1)
    weight = weights[row, column] + np.float32(share)
    weights[row, column] = weight
    if weight > 0.0:
        levels[row, column] = np.uint8(1.5 + 254.0 * weight / counts[row, column])
    else:
        levels[row, column] = np.uint8(1)
