"""Collision of an upright body, driven along straight segments, with boxes.

The body is a cylinder. Boxes are sorted into columns of a grid over the plane, so that only those beside a
segment are tested. A box blocks it if its rectangle is nearer to the segment than the body's radius and
its heights overlap those of the body there.

References
----------
Sparse mapper, sections 5.4 and 5.5: a cylinder around an edge misses what hangs over its middle; a swept
body does not.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.bounds import above, check_settings, within
from lidarium.mapping.kernels.compilation import Array, kernel

RADIUS, LOW, HIGH = range(3)
"""Places in the numbers of a body."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SweptBody:
    """A robot as an upright cylinder.

    Attributes
    ----------
    radius : float
        Radius of the body [m].
    height : float
        Height of the body above its floor [m].
    clearance : float
        Height above the floor below which nothing is in the way [m].
    """

    radius: Annotated[float, above(0.0, 10.0)] = 0.3
    height: Annotated[float, above(0.0, 100.0)] = 1.2
    clearance: Annotated[float, within(0.0, 1.0)] = 0.05

    def __post_init__(self) -> None:
        check_settings(self, "the body")
        if not self.clearance < self.height:
            raise ValueError(f"clearance of the body is {self.clearance} m; want less than its height, {self.height} m")

    @property
    def numbers(self) -> NDArray[np.float64]:
        """Radius and the range of heights above the floor that it takes up [m], shape (3,)."""
        return np.array([self.radius, self.clearance, self.height])


class BoxIndex(NamedTuple):
    """Boxes, and in which columns of a grid they stand.

    Attributes
    ----------
    boxes : (N, 6) float64
        Low x, y, z and high x, y, z [m].
    origin : (2,) float64
        Lower left corner of the grid [m].
    cell : (1,) float64
        Side of a column [m].
    shape : (2,) int64
        Rows and columns.
    starts : (rows * columns + 1,) int64
        Index of the first box of each column in ``members``.
    members : (M,) int64
        Numbers of boxes, column by column.
    """

    boxes: Annotated[Array, np.float64, 2]
    origin: Annotated[Array, np.float64, 1]
    cell: Annotated[Array, np.float64, 1]
    shape: Annotated[Array, np.int64, 1]
    starts: Annotated[Array, np.int64, 1]
    members: Annotated[Array, np.int64, 1]


MAX_COLUMNS = 4_000_000
"""Most columns of an index; a wider map has larger ones."""


def index_boxes(boxes: NDArray[np.float64], cell: float = 0.25) -> BoxIndex:
    """Return the index of boxes.

    Parameters
    ----------
    boxes : (N, 2, 3) float64
        Low and high corner of each [m].
    cell : float
        Side of a column [m].
    """
    flat = np.ascontiguousarray(np.reshape(boxes, (-1, 6)), np.float64)
    if len(flat) == 0:
        origin, shape = np.zeros(2), np.ones(2, np.int64)
    else:
        low, high = flat[:, :2].min(axis=0), flat[:, 3:5].max(axis=0)
        extent = np.maximum(high - low, cell)
        cell = max(cell, math.sqrt(float(extent.prod()) / MAX_COLUMNS))
        origin = low
        shape = (np.floor(extent / cell).astype(np.int64) + 1)[::-1].copy()
    starts, members = _sort_boxes(flat, origin, cell, shape)
    return BoxIndex(flat, origin, np.array([cell]), shape, starts, members)


@kernel
def _sort_boxes(boxes: Array, origin: Array, cell: float, shape: Array) -> tuple[Array, Array]:
    """Return the index of the first box of each column, and the boxes column by column."""
    rows, columns = shape[0], shape[1]
    counts = np.zeros(rows * columns + 1, np.int64)
    for fills in range(2):
        if fills == 1:
            for k in range(rows * columns):
                counts[k + 1] += counts[k]
            members = np.empty(counts[rows * columns], np.int64)
            places = counts.copy()
        for box in range(boxes.shape[0]):
            low_column = _clamped((boxes[box, 0] - origin[0]) / cell, columns)
            high_column = _clamped((boxes[box, 3] - origin[0]) / cell, columns)
            low_row = _clamped((boxes[box, 1] - origin[1]) / cell, rows)
            high_row = _clamped((boxes[box, 4] - origin[1]) / cell, rows)
            for row in range(low_row, high_row + 1):
                for column in range(low_column, high_column + 1):
                    place = row * columns + column
                    if fills == 0:
                        counts[place + 1] += 1
                    else:
                        members[places[place]] = box
                        places[place] += 1
    return counts, members


@kernel(forceinline=True)
def _clamped(value: float, count: int) -> int:
    return int(min(max(math.floor(value), 0.0), count - 1.0))


@kernel(nrt=False)
def squared_gap(x1: float, y1: float, x2: float, y2: float, box: Array) -> Any:  # noqa: ANN401
    """Return the squared distance in the plane between a segment and the rectangle of a box [m2]."""
    low_x, low_y, high_x, high_y = box[0], box[1], box[3], box[4]
    run_x, run_y = x2 - x1, y2 - y1
    # The part of the segment that lies within the rectangle, where there is any.
    enter, leave = 0.0, 1.0
    is_apart = False
    for axis in range(2):
        start = x1 if axis == 0 else y1
        run = run_x if axis == 0 else run_y
        low = low_x if axis == 0 else low_y
        high = high_x if axis == 0 else high_y
        if run == 0.0:
            is_apart = is_apart or start < low or start > high
        else:
            first, last = (low - start) / run, (high - start) / run
            enter, leave = max(enter, min(first, last)), min(leave, max(first, last))
    if not is_apart and enter <= leave:
        return 0.0
    # Else the nearest points are an end of the segment or a corner of the rectangle.
    minimum = min(_end_gap(x1, y1, box), _end_gap(x2, y2, box))
    length = run_x * run_x + run_y * run_y
    if length > 0.0:
        for corner in range(4):
            x = low_x if corner & 1 == 0 else high_x
            y = low_y if corner & 2 == 0 else high_y
            share = min(max(((x - x1) * run_x + (y - y1) * run_y) / length, 0.0), 1.0)
            gap_x, gap_y = x - x1 - share * run_x, y - y1 - share * run_y
            minimum = min(minimum, gap_x * gap_x + gap_y * gap_y)
    return minimum


@kernel(forceinline=True)
def _end_gap(x: float, y: float, box: Array) -> Any:  # noqa: ANN401
    gap_x = max(box[0] - x, 0.0, x - box[3])
    gap_y = max(box[1] - y, 0.0, y - box[4])
    return gap_x * gap_x + gap_y * gap_y


@kernel(nrt=False)
def is_free(index: BoxIndex, a: Array, b: Array, body: Array) -> bool:
    """Whether a body can be driven along a segment.

    Parameters
    ----------
    a, b : (3,) float64
        Ends of the segment on the floor [m]; the same for a body that stands.
    body : (3,) float64
        ``SweptBody.numbers``.
    """
    radius = body[RADIUS]
    squared = radius * radius
    low_z, high_z = min(a[2], b[2]) + body[LOW], max(a[2], b[2]) + body[HIGH]
    rows, columns, cell = index.shape[0], index.shape[1], index.cell[0]
    low_column = math.floor((min(a[0], b[0]) - radius - index.origin[0]) / cell)
    high_column = math.floor((max(a[0], b[0]) + radius - index.origin[0]) / cell)
    low_row = math.floor((min(a[1], b[1]) - radius - index.origin[1]) / cell)
    high_row = math.floor((max(a[1], b[1]) + radius - index.origin[1]) / cell)
    if high_column < 0 or high_row < 0 or low_column >= columns or low_row >= rows:
        return True
    for row in range(max(int(low_row), 0), min(int(high_row), rows - 1) + 1):
        # Of a long slanted segment only the columns beside it are looked at.
        first, last = _columns_beside(a, b, radius, index, row)
        for column in range(max(first, 0), min(last, columns - 1) + 1):
            place = row * columns + column
            for k in range(index.starts[place], index.starts[place + 1]):
                box = index.boxes[index.members[k]]
                if box[2] >= high_z or box[5] <= low_z:
                    continue
                if squared_gap(a[0], a[1], b[0], b[1], box) < squared:
                    return False
    return True


@kernel(nrt=False)
def _columns_beside(a: Array, b: Array, radius: float, index: BoxIndex, row: int) -> tuple[int, int]:
    """Return the first and the last column of a row of the grid that a swept disc may touch."""
    cell, origin_x = index.cell[0], index.origin[0]
    low_y = index.origin[1] + row * cell - radius
    high_y = low_y + cell + 2.0 * radius
    run = b[1] - a[1]
    first, last = 0.0, 1.0
    if abs(run) > 1e-12:
        one, other = (low_y - a[1]) / run, (high_y - a[1]) / run
        first, last = max(first, min(one, other)), min(last, max(one, other))
    x1, x2 = a[0] + first * (b[0] - a[0]), a[0] + last * (b[0] - a[0])
    low, high = min(x1, x2) - radius - origin_x, max(x1, x2) + radius - origin_x
    if first > last:
        return 1, 0
    return int(math.floor(low / cell)), int(math.floor(high / cell))


@kernel
def are_free(index: BoxIndex, starts: Array, ends: Array, body: Array) -> Array:
    """Return which segments (N, 3) to (N, 3) a body can be driven along, (N,) bool."""
    found = np.empty(starts.shape[0], np.bool_)
    for k in range(starts.shape[0]):
        found[k] = is_free(index, starts[k], ends[k], body)
    return found


@kernel
def cylinder_holds(a: Array, b: Array, points: Array, radius: float) -> Array:
    """Return which points (N, 3) lie within a cylinder with an axis from ``a`` to ``b``, (N,) bool.

    Sparse mapper, section 5.4, corrected; a degenerate axis is a ball.
    """
    held = np.empty(points.shape[0], np.bool_)
    run = b - a
    length = run[0] * run[0] + run[1] * run[1] + run[2] * run[2]
    for k in range(points.shape[0]):
        gap = points[k] - a
        squared = gap[0] * gap[0] + gap[1] * gap[1] + gap[2] * gap[2]
        along = gap[0] * run[0] + gap[1] * run[1] + gap[2] * run[2]
        if length < 1e-12:
            held[k] = squared <= radius * radius
        else:
            held[k] = 0.0 <= along <= length and squared * length - along * along <= radius * radius * length
    return held
