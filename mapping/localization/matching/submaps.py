"""Local maps: the consensus of neighbouring scans, in a frame of their own.

A cell's agreement is the mean, over the scans that observed it, of the weight with which a beam ended there:
a beam's end is shared out among the four cells around it in the way of bilinear interpolation, so that the
middle of a wall is kept to a fraction of a cell; a scan that saw through counts as nothing. What moved,
fades. This is the counting model (Haehnel et al., IROS 2003) with shares in place of whole hits.

Scans record of a cell whether a beam that came as far ended there. With noise that share grows towards
the back of a wall, which hardly a beam passes: it is a hazard, and no density. If a beam ended, known
walls a little behind count as seen through, therefore; without that, they come to lie behind where they are,
and a robot that goes by them runs ahead of itself.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.grids.scan_geometry import ScanGeometry, beam_directions
from lidarium.mapping.grids.scan_polygon import GRAZING, fill_scan_polygon, scan_ends, window_rows, window_words
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.localization.settings import SubmapSettings

MAX_BETWEEN = 10
"""Points of a surface between two ends of neighbouring beams.

Ends farther apart [cells] are not joined.
"""


class _Cells(NamedTuple):
    """Cells of a local map.

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
def _insert_scan(
    cells: _Cells,
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
def _surface_points(lengths: Array, ends: Array, is_hit: Array, increment: float, is_full_circle: bool) -> Array:
    """Return beam ends and points between them, shape (points, 2) [cells].

    Points lie a cell apart between neighbouring ends on one surface.
    """
    beams = lengths.shape[0]
    points = np.empty((beams * (MAX_BETWEEN + 1), 2))
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
        if abs(lengths[follower] - lengths[beam]) > 1.0 + GRAZING * increment * min(lengths[follower], lengths[beam]):
            continue
        gap_x, gap_y = ends[0, follower] - ends[0, beam], ends[1, follower] - ends[1, beam]
        between = int(math.sqrt(gap_x * gap_x + gap_y * gap_y))
        if between > MAX_BETWEEN:
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
                0 <= row < bits.shape[0] and 0 <= column < min(64 * bits.shape[1], weights.shape[1] - column_offset)
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

    Take its bit out of the cells that were seen through.

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


UNSEEN, FREE_LEVEL, FULL_LEVEL = 0, 1, 255
"""Levels of agreement: unobserved, free, and full.

Full means that a beam ended in the middle of the cell each time.
"""


_MARGIN = 4


class AgreementGrid(NamedTuple):
    """A local map's agreement.

    Attributes
    ----------
    levels : (rows, columns) uint8
        ``UNSEEN``, or from ``FREE_LEVEL`` to ``FULL_LEVEL`` in proportion to the agreement. Row 0 at the
        lowest y.
    column, row : int
        Place of the first cell, in cells from the frame's origin.
    resolution : float
        Side of a cell [m].
    """

    levels: NDArray[np.uint8]
    column: int
    row: int
    resolution: float


class Submap:
    """A local map that grows by scans until it is finished.

    Parameters
    ----------
    settings : SubmapSettings
        How.
    reach_m : float
        Maximum distance of its cells from its origin [m].

    Attributes
    ----------
    scans : int
        How many it holds.
    """

    def __init__(self, settings: SubmapSettings, reach_m: float) -> None:
        resolution = settings.resolution
        half = math.ceil(reach_m / resolution) + _MARGIN
        # A multiple of 64, so that words of bits begin where cells do; memory is provided where it is touched
        # only.
        self._half = -(-half // 64) * 64
        side = 2 * self._half
        self._cells = _Cells(
            np.zeros((side, side), np.float32),
            np.zeros((side, side), np.float32),
            np.zeros((side, side), np.uint16),
            np.zeros((side, side), np.uint8),
            np.array([side, 0, side, 0], np.int64),
        )
        self._resolution = resolution
        self._behind = (settings.behind_m / resolution, settings.behind_share)
        self.scans = 0

    @property
    def grid(self) -> AgreementGrid:
        """Return the agreement, a view that changes with the next scan."""
        return AgreementGrid(self._cells.levels, -self._half, -self._half, self._resolution)

    def insert(
        self, pose: NDArray[np.float64], ranges: NDArray[np.float32], geometry: ScanGeometry, longest: float
    ) -> bool:
        """Take in a scan.

        Parameters
        ----------
        pose : (3,) float64
            x, y, theta of the laser in the local map's frame [m, rad].
        ranges : (beams,) float32
            The scan [m]; inf for no return, nan for an invalid beam.
        geometry : ScanGeometry
            Directions of the beams.
        longest : float
            Longest range that counts [m]; a return beyond it says that the way there is free.
        """
        scale = 1.0 / self._resolution
        reach = min(longest, geometry.range_max) * scale
        x, y = pose[0] * scale + self._half, pose[1] * scale + self._half
        side = 2 * self._half
        if not (reach + _MARGIN <= min(x, y) and max(x, y) <= side - reach - _MARGIN):
            return False
        numbers = (geometry.angle_increment, reach, scale, float(geometry.is_full_circle), *self._behind)
        _insert_scan(self._cells, (x, y, float(pose[2])), ranges, numbers, geometry.unit_vectors)
        self.scans += 1
        return True

    def finished(self) -> AgreementGrid:
        """Return the final agreement, cropped to the observed cells."""
        low_row, high_row, low_column, high_column = (int(value) for value in self._cells.box)
        if low_row >= high_row:
            return AgreementGrid(np.zeros((1, 1), np.uint8), 0, 0, self._resolution)
        levels = self._cells.levels[low_row:high_row, low_column:high_column].copy()
        return AgreementGrid(levels, low_column - self._half, low_row - self._half, self._resolution)
