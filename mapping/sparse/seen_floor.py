"""The floor that was seen, cell by cell, and where a body may not go for want of it.

Cells of a map know whether floor was seen there, and how high the steps around them are. The rims of what was not
seen, and steps that a robot does not climb, become boxes of any height, so that graphs and paths avoid them as any
obstacle. A body whose middle is above seen floor and that touches no rim has seen floor below all of it.
"""

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
import scipy
from numpy.typing import NDArray

from lidarium.mapping.sparse.floor_plane import FloorPlane

CELL_M = 0.05
"""Side of a cell [m]; wider maps have larger ones."""

MAX_CELLS = 1_000_000
"""Most cells of a map."""

UNSEEN = 255
"""A cell without floor."""

LEAST_STEP_CM = 3
"""Lower steps are not kept: noise is as high."""

MAX_STEP_CM = 100

_FINE = 4
"""Cells of points along a cell."""

_NO_HEIGHT = 1e6

_CORNER = 0.6
"""Distance of a corner from the largest disc in it, as a share of the disc's radius, and some more."""

_NARROW = 1.5
"""Reach of the narrow closing, in mean distances of cells with points."""

_STANDS_M = 0.05
"""A box whose bottom is not higher than this above the points of the floor stands on it [m]."""


@dataclass(frozen=True, eq=False, slots=True)
class SeenFloor:
    """Cells of the floor of a map.

    Attributes
    ----------
    steps : (rows, columns) uint8
        Largest difference of height around each cell [cm], or ``UNSEEN``; row 0 has the lowest y.
    low : (2,) int64
        Number of the first cell along x and y: it begins at ``low * cell_m``.
    cell_m : float
        Side of a cell [m].
    """

    steps: NDArray[np.uint8]
    low: NDArray[np.int64]
    cell_m: float = CELL_M

    @property
    def area_m2(self) -> float:
        """Area of the floor that was seen, with that below boxes that stand on it [m2]."""
        return float(np.count_nonzero(self.steps != UNSEEN) * self.cell_m**2)

    def supports(self, max_step: float) -> "Support":
        """Return the cells that bear a robot which climbs steps up to a height [m]."""
        is_borne = np.pad((self.steps != UNSEEN) & (self.steps <= 100.0 * max_step + 1e-9), 1)
        return Support(is_borne, np.asarray((self.low - 1) * self.cell_m, np.float64), self.cell_m)

    def cleared(self, box: NDArray[np.float64]) -> "SeenFloor":
        """Return the floor with the unseen cells wholly within a box (2, 3) [m] taken for level floor."""
        first = np.ceil(box[0, :2] / self.cell_m - 1e-6).astype(np.int64)
        last = np.floor(box[1, :2] / self.cell_m + 1e-6).astype(np.int64)
        (column, row), (end_column, end_row) = np.maximum(first - self.low, 0), np.maximum(last - self.low, 0)
        steps = self.steps.copy()
        part = steps[row:end_row, column:end_column]
        part[part == UNSEEN] = 0
        return replace(self, steps=steps)

    def joined(self, other: "SeenFloor", motion: NDArray[np.float64]) -> "SeenFloor":
        """Return the floor that either has seen; ``motion`` (4, 4) maps points of the other into this one."""
        shape = other.steps.shape[::-1]
        corners = (other.low + np.array([[0, 0], [shape[0], 0], [0, shape[1]], shape])) * other.cell_m
        moved = corners @ motion[:2, :2].T + motion[:2, 3]
        low = np.minimum(self.low, np.floor(moved.min(axis=0) / self.cell_m).astype(np.int64))
        high = np.maximum(self.low + self.steps.shape[::-1], np.ceil(moved.max(axis=0) / self.cell_m).astype(np.int64))
        columns, rows = high - low
        if columns * rows > MAX_CELLS:
            raise ValueError(f"the joined map has {columns * rows:,} cells of floor; want at most {MAX_CELLS:,}")
        steps = np.full((rows, columns), UNSEEN, np.uint8)
        column, row = self.low - low
        steps[row : row + self.steps.shape[0], column : column + self.steps.shape[1]] = self.steps
        # What the other has at the middle of each cell.
        x, y = np.meshgrid(np.arange(columns) + low[0] + 0.5, np.arange(rows) + low[1] + 0.5)
        middles = np.stack([x, y], axis=-1) * self.cell_m
        theirs = np.floor((middles - motion[:2, 3]) @ motion[:2, :2] / other.cell_m).astype(np.int64) - other.low
        is_within = ((theirs >= 0) & (theirs < shape)).all(axis=-1)
        added = np.full_like(steps, UNSEEN)
        added[is_within] = other.steps[theirs[is_within, 1], theirs[is_within, 0]]
        both = np.where(steps == UNSEEN, added, np.where(added == UNSEEN, steps, np.maximum(steps, added)))
        return SeenFloor(both, low, self.cell_m)


@dataclass(frozen=True, eq=False, slots=True)
class Support:
    """Cells that bear a robot.

    Attributes
    ----------
    cells : (rows, columns) bool
        Which do; those of the border do not.
    origin : (2,) float64
        Lower left corner of the first cell [m].
    cell_m : float
        Side of a cell [m].
    """

    cells: NDArray[np.bool_]
    origin: NDArray[np.float64]
    cell_m: float

    def bears(self, point: NDArray[np.float64]) -> bool:
        """Whether the cell of a point (2,) or (3,) [m] does."""
        column = math.floor((point[0] - self.origin[0]) / self.cell_m)
        row = math.floor((point[1] - self.origin[1]) / self.cell_m)
        return 0 <= row < self.cells.shape[0] and 0 <= column < self.cells.shape[1] and bool(self.cells[row, column])

    def rims(self) -> NDArray[np.float64]:
        """Return boxes of any height over the cells beside those that bear a robot, a little larger, (M, 2, 3) [m]."""
        around = cv2.dilate(self.cells.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(np.bool_)
        is_rim = np.pad(around & ~self.cells, ((0, 0), (1, 1)))
        turns = np.diff(is_rim.astype(np.int8), axis=1)
        rows, starts = np.nonzero(turns == 1)
        ends = np.nonzero(turns == -1)[1]
        # Pieces of rows above each other with the same ends are one box.
        order = np.lexsort((rows, ends, starts))
        rows, starts, ends = rows[order], starts[order], ends[order]
        follows = (np.diff(rows) == 1) & (np.diff(starts) == 0) & (np.diff(ends) == 0)
        first = np.flatnonzero(np.append(True, ~follows)[: len(rows)])
        last = np.append(first[1:], len(rows))[: len(first)] - 1
        boxes = np.empty((len(first), 2, 3))
        boxes[:, 0, 0], boxes[:, 1, 0] = starts[first], ends[first]
        boxes[:, 0, 1], boxes[:, 1, 1] = rows[first], rows[last] + 1
        # A point at its border lets the whole of a cell of points count as seen.
        boxes[:, 0, :2] -= 1.0 / _FINE
        boxes[:, 1, :2] += 1.0 / _FINE
        boxes[:, :, :2] = boxes[:, :, :2] * self.cell_m + self.origin
        boxes[:, 0, 2], boxes[:, 1, 2] = -np.inf, np.inf
        return boxes


class FloorPoints:
    """Gathers the points of a floor in cells, frame by frame.

    Parameters
    ----------
    gap_m : float
        How far from points of the floor it counts as seen between them [m].
    """

    def __init__(self, gap_m: float) -> None:
        self._gap_m, self._side = gap_m, CELL_M / _FINE
        self._low = np.zeros(2, np.int64)
        self._counts, self._sums = np.zeros((0, 0), np.float32), np.zeros((0, 0), np.float32)

    def add(self, points: NDArray[np.float64], floor: FloorPlane) -> None:
        """Add points of the floor (N, 3) [m]."""
        if len(points) == 0:
            return
        self._grow(points[:, :2].min(axis=0), points[:, :2].max(axis=0))
        columns, rows = np.floor(points[:, :2] / self._side).astype(np.int64).T
        shape = self._counts.shape
        places = (rows - self._low[1]) * shape[1] + columns - self._low[0]
        self._counts += np.bincount(places, minlength=self._counts.size).reshape(shape)
        self._sums += np.bincount(places, floor.heights(points), self._counts.size).reshape(shape)

    def _grow(self, low_m: NDArray[np.float64], high_m: NDArray[np.float64]) -> None:
        """Make room for places between two corners (2,) [m]."""
        while True:
            low = np.floor(low_m / self._side).astype(np.int64) // _FINE * _FINE
            high = (np.floor(high_m / self._side).astype(np.int64) // _FINE + 1) * _FINE
            if self._counts.size:
                low = np.minimum(low, self._low)
                high = np.maximum(high, self._low + self._counts.shape[::-1])
            if (high - low).astype(np.float64).prod() <= MAX_CELLS * _FINE**2:
                break
            # Too wide for such small cells: four become one.
            self._counts, self._sums = (_pooled(each, self._low) for each in (self._counts, self._sums))
            self._low, self._side = self._low // 2 // _FINE * _FINE, 2.0 * self._side
        column, row = self._low - low
        pads = (
            (row, high[1] - low[1] - row - self._counts.shape[0]),
            (column, high[0] - low[0] - column - self._counts.shape[1]),
        )
        if not self._counts.size:
            pads = ((0, high[1] - low[1]), (0, high[0] - low[0]))
        self._counts, self._sums = np.pad(self._counts, pads), np.pad(self._sums, pads)
        self._low = low

    def seen(self, boxes: NDArray[np.float64], floor: FloorPlane, highest_m: float) -> SeenFloor:
        """Return the floor that was seen.

        Parameters
        ----------
        boxes : (M, 2, 3) float64
            Obstacles [m]: below those that stand on the floor it counts as seen, as nothing can drive there.
        highest_m : float
            Height above the floor up to which points belong to it [m].
        """
        if not self._counts.size:
            return SeenFloor(np.full((1, 1), UNSEEN, np.uint8), self._low // _FINE, self._side * _FINE)
        reach = math.ceil(self._gap_m / self._side)
        pad = (reach // _FINE + 1) * _FINE
        counts, sums = np.pad(self._counts, pad), np.pad(self._sums, pad)
        low = self._low - pad
        rows, columns = counts.shape[0] // _FINE, counts.shape[1] // _FINE
        side = _FINE * self._side
        stands = _standing(boxes, floor, highest_m + _STANDS_M, (rows, columns), low // _FINE, side)
        # Points of what stands there are no floor.
        beside = cv2.dilate(stands, np.ones((3, 3), np.uint8)) > 0
        own = (counts > 0.0) & ~_finer(beside)
        known = ((counts > 0.0) | _finer(stands > 0)).astype(np.uint8)
        # A wide closing rounds the corners of holes: beside these a narrow one decides.
        holes = ~_closed(known, reach)
        beside_holes = cv2.dilate(holes.astype(np.uint8), _disc(_CORNER * reach)) > 0
        # Points that are far apart leave wide gaps in the floor.
        density = (np.count_nonzero(known) + 1.0) / (np.count_nonzero(~holes) + 1.0)
        narrow = min(math.ceil(_NARROW / math.sqrt(density)), reach)
        is_seen = (
            (~holes & (_closed(known, narrow) | ~beside_holes)).reshape(rows, _FINE, columns, _FINE).all(axis=(1, 3))
        )
        steps = np.full((rows, columns), UNSEEN, np.uint8)
        if own.any():
            nearest = scipy.ndimage.distance_transform_edt(~own, return_distances=False, return_indices=True)
            np.divide(sums, np.maximum(counts, 1.0, out=counts), out=sums)  # in place: maps may be large
            heights = np.empty((rows, columns), np.float32)
            for row in range(rows):  # one at a time: numpy makes indices four times as large as heights
                fine = slice(row * _FINE, (row + 1) * _FINE)
                own_heights = sums[nearest[0, fine], nearest[1, fine]].reshape(1, _FINE, columns, _FINE)
                heights[row] = own_heights.mean(axis=(1, 3))[0]
            is_plain = is_seen & ~beside
            kernel = np.ones((3, 3), np.uint8)
            highest = cv2.dilate(np.where(is_plain, heights, np.float32(-_NO_HEIGHT)), kernel)
            lowest = cv2.erode(np.where(is_plain, heights, np.float32(_NO_HEIGHT)), kernel)
            ranges = np.rint(100.0 * (highest - lowest)[is_plain])
            ranges[ranges < LEAST_STEP_CM] = 0.0
            steps[is_seen] = 0
            steps[is_plain] = np.minimum(ranges, MAX_STEP_CM).astype(np.uint8)
        return _trimmed(SeenFloor(steps, low // _FINE, side))


def _disc(radius: float) -> NDArray[np.uint8]:
    offsets = np.arange(-math.floor(radius), math.floor(radius) + 1)
    return (np.hypot(offsets[:, None], offsets) <= radius).astype(np.uint8)


def _closed(known: NDArray[np.uint8], radius: float) -> NDArray[np.bool_]:
    """Return known cells, and those between them in which no disc of a radius finds room; the border has room."""
    closed = cv2.morphologyEx(known, cv2.MORPH_CLOSE, _disc(radius), borderType=cv2.BORDER_CONSTANT, borderValue=(0.0,))
    return (closed > 0) | (known > 0)


def _finer(cells: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return cells, each as several of points."""
    return cells.repeat(_FINE, axis=0).repeat(_FINE, axis=1)


def _pooled(cells: NDArray[np.float32], low: NDArray[np.int64]) -> NDArray[np.float32]:
    """Return the sums of squares of four cells; the first one begins where the cells of cells do."""
    if not cells.size:
        return cells
    # The lower border of the larger cells, and of the pairs of these.
    before = (low - low // (2 * _FINE) * (2 * _FINE))[::-1]
    after = [-(size + first) % (2 * _FINE) for size, first in zip(cells.shape, before, strict=True)]
    padded = np.pad(cells, list(zip(before.tolist(), after, strict=True)))
    rows, columns = padded.shape[0] // 2, padded.shape[1] // 2
    return np.asarray(padded.reshape(rows, 2, columns, 2).sum(axis=(1, 3)))


def _standing(
    boxes: NDArray[np.float64],
    floor: FloorPlane,
    highest_m: float,
    shape: tuple[int, ...],
    low: NDArray[np.int64],
    side: float,
) -> NDArray[np.uint8]:
    """Return the cells touched by boxes that stand on the floor, 1 if they are, (rows, columns)."""
    bottoms = boxes.mean(axis=1)
    bottoms[:, 2] = boxes[:, 0, 2]
    found = np.zeros(shape, np.uint8)
    stand = boxes[floor.heights(bottoms) <= highest_m]
    first = np.floor(stand[:, 0, :2] / side).astype(np.int64) - low
    last = np.floor(stand[:, 1, :2] / side).astype(np.int64) - low
    for (column, row), (end_column, end_row) in zip(first.tolist(), last.tolist(), strict=True):
        found[max(row, 0) : max(end_row + 1, 0), max(column, 0) : max(end_column + 1, 0)] = 1
    return found


def _trimmed(floor: SeenFloor) -> SeenFloor:
    """Return a floor without its unseen borders."""
    rows, columns = np.nonzero(floor.steps != UNSEEN)
    if not len(rows):
        return floor
    part = floor.steps[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1]
    return SeenFloor(np.ascontiguousarray(part), floor.low + np.array([columns.min(), rows.min()]), floor.cell_m)
