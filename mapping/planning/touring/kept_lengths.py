"""Lengths of paths from places on a grid that changes: kept, and brought up to date where the grid has changed.

A field is a flat grid with a closed border. It holds 1 plus the length of the shortest path from its start to each
cell, ``CLOSED`` in closed cells and ``UNREACHED`` in cells that are farther than the field's horizon. Lengths are
whole numbers, and the shortest one is unique: a field that was kept equals one that is computed from nothing.

References
----------
G. Ramalingam and T. Reps, "An incremental algorithm for a generalization of the shortest-path problem", 1996: cells
that lose their path are found first, nearest first; then they and the cells that opened are reached again.
"""

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.planning.touring.coarse_distances import DIAGONAL, STRAIGHT, UNREACHED

BUCKETS = DIAGONAL + 1

CLOSED = 0
"""In a field, a closed cell; no length is shorter."""

WHOLE = UNREACHED - 2 * BUCKETS
"""Horizon of a field in which all cells that can be reached are."""


@kernel(nrt=False)
def begin_field(field: Array, is_open: Array, bounds: Array, start: int) -> None:
    """Write a field of which only the start is reached (kernel).

    Parameters
    ----------
    field : (size,) int32
        Zero outside of the bounds.
    is_open : (rows, columns) uint8
        The grid with its border.
    bounds : (4,) int64
        First and last rows and columns of the grid that may be open, the last exclusive.
    """
    columns = is_open.shape[1]
    for row in range(bounds[0], bounds[1]):
        first = row * columns
        for column in range(bounds[2], bounds[3]):
            field[first + column] = UNREACHED if is_open[row, column] else CLOSED
    field[start] = 1


@kernel
def _neighbours(columns: int) -> NDArray[np.int64]:
    """Return the steps to the neighbours of a cell, straight ones first."""
    return np.array([1, columns, -1, -columns, columns + 1, columns - 1, 1 - columns, -1 - columns])


@kernel
def change_field(
    field: Array, columns: int, horizon: int, start: int, closed: Array, opened: Array, queues: Array
) -> None:
    """Bring a field up to date up to its horizon after cells have closed and opened (kernel).

    Parameters
    ----------
    columns : int
        Columns of the grid with its border.
    closed, opened : (n,), (m,) int64
        Cells that have changed.
    queues : (BUCKETS, size) int32
        Scratch.
    """
    steps, counts = _neighbours(columns), np.zeros(BUCKETS, np.int64)
    lost = _lose(field, steps, start, closed, queues, counts)
    renewed = np.empty(len(lost) + len(opened), np.int64)
    renewed[: len(lost)], renewed[len(lost) :] = lost, opened
    for k in range(len(opened)):
        if opened[k] != start:
            field[opened[k]] = UNREACHED
    count, found = 0, np.empty(len(renewed), np.int64)
    for k in range(len(renewed)):
        cell = renewed[k]
        if cell == start:
            continue
        best = UNREACHED
        for i in range(8):
            beside = field[cell + steps[i]]
            if CLOSED < beside <= horizon:
                best = min(best, beside + (STRAIGHT if i < 4 else DIAGONAL))
        if best <= horizon:
            field[cell] = best
            renewed[count], found[count] = cell, best
            count += 1
    order = np.argsort(found[:count], kind="mergesort")
    head, waiting, length = 0, 0, 0
    while head < count or waiting > 0:
        if waiting == 0:
            length = found[order[head]]
        bucket = length % BUCKETS
        while head < count and found[order[head]] == length:
            queues[bucket, counts[bucket]] = renewed[order[head]]
            counts[bucket] += 1
            waiting += 1
            head += 1
        waiting -= counts[bucket]
        waiting += _settle(field, steps, length, horizon, queues, counts)
        length += 1


@kernel
def _lose(field: Array, steps: Array, start: int, closed: Array, queues: Array, counts: Array) -> NDArray[np.int64]:
    """Close cells; return the cells that have lost all of their shortest paths, now ``UNREACHED``."""
    count, before = 0, np.empty(len(closed), np.int64)
    cells = np.empty(len(closed), np.int64)
    for k in range(len(closed)):
        cell = closed[k]
        if cell == start:
            continue
        if field[cell] != UNREACHED:
            cells[count], before[count] = cell, field[cell]
            count += 1
        field[cell] = CLOSED
    order = np.argsort(before[:count], kind="mergesort")
    lost, lost_count = np.empty(64, np.int64), 0
    head, waiting, length = 0, 0, 0
    while head < count or waiting > 0:
        if waiting == 0:
            length = before[order[head]]
        while head < count and before[order[head]] == length:
            waiting += _ask(field, steps, cells[order[head]], length, queues, counts)
            head += 1
        bucket = length % BUCKETS
        number = counts[bucket]
        counts[bucket] = 0
        waiting -= number
        for i in range(number):
            cell = queues[bucket, i]
            if field[cell] != length or cell == start:
                continue
            has_path = False
            for k in range(8):
                beside = field[cell + steps[k]]
                if beside > CLOSED and beside != UNREACHED and beside + (STRAIGHT if k < 4 else DIAGONAL) == length:
                    has_path = True
                    break
            if has_path:
                continue
            field[cell] = UNREACHED
            if lost_count == len(lost):
                longer = np.empty(2 * lost_count, np.int64)
                longer[:lost_count] = lost
                lost = longer
            lost[lost_count] = cell
            lost_count += 1
            waiting += _ask(field, steps, cell, length, queues, counts)
        length += 1
    return lost[:lost_count]


@kernel(nrt=False)
def _ask(field: Array, steps: Array, cell: int, length: int, queues: Array, counts: Array) -> int:
    """List the neighbours of a cell that had this length whose shortest path may have come over it."""
    asked = 0
    for k in range(8):
        other, further = cell + steps[k], length + (STRAIGHT if k < 4 else DIAGONAL)
        if field[other] == further:
            bucket = further % BUCKETS
            queues[bucket, counts[bucket]] = other
            counts[bucket] += 1
            asked += 1
    return asked


@kernel(nrt=False)
def _settle(field: Array, steps: Array, length: int, horizon: int, queues: Array, counts: Array) -> int:
    """Shorten the lengths of the neighbours of all cells of a length up to a horizon; return how many are listed."""
    bucket = length % BUCKETS
    straight, diagonal = (length + STRAIGHT) % BUCKETS, (length + DIAGONAL) % BUCKETS
    listed, count = counts[straight] + counts[diagonal], counts[bucket]
    counts[bucket] = 0
    due = queues[bucket]
    for i in range(count):
        cell = due[i]
        if field[cell] != length:
            continue
        if length + STRAIGHT <= horizon:
            counts[straight] = _reach(field, cell, steps[:4], length + STRAIGHT, queues[straight], counts[straight])
        if length + DIAGONAL <= horizon:
            counts[diagonal] = _reach(field, cell, steps[4:], length + DIAGONAL, queues[diagonal], counts[diagonal])
    return int(counts[straight] + counts[diagonal] - listed)


@kernel(forceinline=True, nrt=False)
def _reach(field: Array, cell: int, steps: Array, further: int, queue: Array, count: int) -> int:
    """Shorten the lengths of four neighbours to ``further`` and list those; return the length of the list."""
    for k in range(4):
        other = np.uint64(cell + steps[k])  # an index that is not negative needs no check
        if further < field[other]:
            field[other] = further
            queue[np.uint64(count)] = other
            count += 1
    return count


@kernel
def extend_field(field: Array, columns: int, bounds: Array, horizon: int, targets: Array, queues: Array) -> int:
    """Reach further until all targets are reached; return the new horizon (kernel).

    Parameters
    ----------
    bounds : (4,) int64
        As in ``begin_field``.
    horizon : int
        The horizon so far: 1 if only the start is reached.
    targets : (n,) int64
        Cells; if one cannot be reached, all cells are that can.
    """
    reached, last = 0, len(targets)
    while reached < last and CLOSED < field[targets[reached]] <= horizon:
        reached += 1
    if reached == last or horizon >= WHOLE:
        return horizon
    steps, counts = _neighbours(columns), np.zeros(BUCKETS, np.int64)
    waiting = 0
    for row in range(bounds[0], bounds[1]):
        for cell in range(row * columns + bounds[2], row * columns + bounds[3]):
            if max(horizon - BUCKETS, CLOSED) < field[cell] <= horizon:
                bucket = field[cell] % BUCKETS
                queues[bucket, counts[bucket]] = cell
                counts[bucket] += 1
                waiting += 1
    length = max(horizon - BUCKETS + 1, 1)
    while waiting > 0:
        waiting -= counts[length % BUCKETS]
        waiting += _settle(field, steps, length, WHOLE, queues, counts)
        while reached < last and CLOSED < field[targets[reached]] <= length:
            reached += 1
        if reached == last and length >= horizon:
            break
        length += 1
    if waiting == 0 and reached < last:
        return int(WHOLE)
    for bucket in range(BUCKETS):
        for i in range(counts[bucket]):
            if field[queues[bucket, i]] > length:
                field[queues[bucket, i]] = UNREACHED
    return length
