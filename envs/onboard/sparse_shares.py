"""Messages of robots about their sparse maps, their size, and how a receiver adds them to its own map."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.geometry.rigid_motions import moved_boxes

BOX_BYTES, NODE_BYTES, NUMBER_BYTES = 24, 12, 4
"""A box and a node as float32, and the number of one that is gone."""

GROUND_BLOCK, GROUND_BLOCK_BYTES = 64, 12
"""Cells of a block of ground along x; it is sent as its number and a bit for each cell."""

GROWTH_M, LEAST_PIECE_M = 0.02, 0.05
"""Boxes that are rotated are cut first, so that they grow by at most this, into pieces of at least this [m]."""


@dataclass(frozen=True, eq=False, slots=True)
class SparseShare:
    """A robot's sparse map at one time, as it is sent.

    Attributes
    ----------
    boxes : (M, 2, 3) float64
        Low and high corners of its obstacles along the axes of the map [m].
    trail, free : (T, 3) float64, (N, 3) float64
        Positions on its trail, and its free codes [m].
    cells, low : (rows, columns) bool, (2,) int64
        Seen cells of the ground and the number of the first, as `SeenGround` has them.
    cell_m : float
        Side of a cell [m].
    axes : float
        Direction of the map's x axis in the frame of the robot's believed poses [rad].
    version : int
        Version of the map.
    """

    boxes: NDArray[np.float64]
    trail: NDArray[np.float64]
    free: NDArray[np.float64]
    cells: NDArray[np.bool_]
    low: NDArray[np.int64]
    cell_m: float
    axes: float
    version: int

    def moved(self, transform: Transform) -> "SparseShare":
        """Return the map in another frame; boxes stay along the axes, so those that are rotated grow a little."""
        if transform == Transform():
            return self
        motion = np.eye(4)
        cosine, sine = math.cos(transform.theta), math.sin(transform.theta)
        motion[:2] = [[cosine, -sine, 0.0, transform.x], [sine, cosine, 0.0, transform.y]]
        aslant = abs(math.remainder(transform.theta, math.pi / 2.0))
        boxes = _cut(self.boxes, max(GROWTH_M / max(math.sin(aslant), 1e-9), LEAST_PIECE_M))
        cells, low = self._moved_ground(transform)
        return replace(
            self,
            boxes=moved_boxes(boxes, np.broadcast_to(motion, (len(boxes), 4, 4))),
            trail=np.column_stack([transform.apply(self.trail[:, :2]), self.trail[:, 2]]),
            free=np.column_stack([transform.apply(self.free[:, :2]), self.free[:, 2]]),
            cells=cells,
            low=low,
        )

    def _moved_ground(self, transform: Transform) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
        """Return the ground in another frame: a cell is seen if its centre lies in a seen one."""
        rows, columns = self.cells.shape
        corners = self.low + np.array([(0, 0), (columns, 0), (0, rows), (columns, rows)])
        places = transform.apply(corners * self.cell_m) / self.cell_m
        low, high = np.floor(places.min(axis=0)).astype(np.int64), np.ceil(places.max(axis=0)).astype(np.int64)
        x, y = np.meshgrid(np.arange(low[0], high[0]), np.arange(low[1], high[1]))
        back = transform.inverse().apply((np.stack([x, y], axis=-1) + 0.5) * self.cell_m) / self.cell_m
        column, row = np.moveaxis(np.floor(back).astype(np.int64) - self.low, -1, 0)
        is_inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        cells = np.zeros(is_inside.shape, np.bool_)
        cells[is_inside] = self.cells[row[is_inside], column[is_inside]]
        return cells, low


def bytes_to_send(held: SparseShare | None, copy: SparseShare | None) -> int:
    """Return the bytes that bring an older copy of a map up to date: what is new, and the numbers of what is gone."""
    if held is None or held is copy or (copy is not None and held.version == copy.version):
        return 0
    rows = (
        _bytes_of_rows(BOX_BYTES, held.boxes, None if copy is None else copy.boxes)
        + _bytes_of_rows(NODE_BYTES, held.trail, None if copy is None else copy.trail)
        + _bytes_of_rows(NODE_BYTES, held.free, None if copy is None else copy.free)
    )
    blocks = np.setxor1d(_seen(held), np.zeros(0, np.int64) if copy is None else _seen(copy)) // GROUND_BLOCK
    return rows + GROUND_BLOCK_BYTES * len(np.unique(blocks))


def _bytes_of_rows(size: int, held: NDArray[np.float64], copy: NDArray[np.float64] | None) -> int:
    """Return the bytes of rows that are new, of a size each, and of the numbers of those that are gone."""
    one = {row.tobytes() for row in held}
    other = set() if copy is None else {row.tobytes() for row in copy}
    return size * len(one - other) + NUMBER_BYTES * len(other - one)


def _seen(share: SparseShare) -> NDArray[np.int64]:
    """Return a number for each seen cell, the same wherever the first cell lies; neighbours along x differ by 1."""
    rows, columns = np.nonzero(share.cells)
    return np.asarray((rows + share.low[1]) * 2**31 + columns + share.low[0] + 2**30)


def _cut(boxes: NDArray[np.float64], longest_m: float) -> NDArray[np.float64]:
    """Return boxes cut along x and y into pieces of at most a length."""
    for axis in range(2):
        sides = boxes[:, 1, axis] - boxes[:, 0, axis]
        counts = np.maximum(np.ceil(sides / longest_m - 1e-9), 1.0).astype(np.int64)
        number = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        steps, lows = np.repeat(sides / counts, counts), np.repeat(boxes[:, 0, axis], counts)
        boxes = np.repeat(boxes, counts, axis=0)
        boxes[:, 0, axis], boxes[:, 1, axis] = lows + number * steps, lows + (number + 1) * steps
    return boxes
