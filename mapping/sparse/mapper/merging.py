"""Boxes whose union adds nothing become one.

All boxes are taken to be wider by a slack to all sides. Two of them merge where nearly all of the box
around both is in some box: what is new is then hardly farther from the boxes than the slack. A box within
another one is the simplest case. Where too many are left, the slack grows, but never so far that a gap is
closed that a robot fits through; and no union covers a free code that was not covered.
"""

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.sparse.mapper.covered_volume import MOST_PIECES, uncovered_volume

TOLERANCE = 0.03
"""Share of the box around two boxes that may be in none."""

LEAST_COVER = 0.6
"""Share of the box around two boxes that has to be in these for the others to be looked at."""

MOST_SLACK_M = 0.12
"""Gaps of up to twice this are closed [m]."""

TILE_M = 1.0
"""Side of the tiles within which boxes are merged first [m]."""

LEAST_SLACK_M = 0.002

MOST_BESIDE = 64
"""How many boxes besides the two are looked at."""

_GROWTH = 1.5


def merged_boxes(
    boxes: NDArray[np.float64], free: NDArray[np.float64], slack: float, most: int
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Merge boxes whose union adds nothing.

    Parameters
    ----------
    boxes : (N, 2, 3) float64
        Low and high corners [m].
    free : (M, 3) float64
        Free codes [m]: what merges covers none that was not covered before.
    slack : float
        How far from the boxes a union may reach [m].
    most : int
        With more boxes than this, the slack grows up to ``MOST_SLACK_M``.

    Returns
    -------
    (K, 2, 3) float64
        Boxes that cover all that was covered [m].
    (N,) int64
        In which of them each box has gone.
    """
    count = len(boxes)
    grown = boxes.reshape(-1, 6).copy()
    owners = np.arange(count)
    nodes = np.ascontiguousarray(free[np.argsort(free[:, 0], kind="stable")])
    slack = max(slack, LEAST_SLACK_M)
    # Most merge with what is beside them; few are left to be compared with all.
    tiles = np.floor(boxes[:, 0, :2] / TILE_M).astype(np.int64)
    order = np.lexsort((boxes[:, 0, 0], tiles[:, 1], tiles[:, 0]))
    starts = np.flatnonzero(np.diff(tiles[order], axis=0).any(axis=1)) + 1
    _merge_tiles(grown, owners, order, np.concatenate([[0], starts, [count]]), nodes, slack)
    while True:
        living = np.flatnonzero(owners == np.arange(count))
        living = living[np.argsort(grown[living, 0], kind="stable")]
        left = _merge(grown, owners, living, nodes, slack)
        if left <= most or slack >= MOST_SLACK_M:
            break
        slack = min(_GROWTH * slack, MOST_SLACK_M)
    kept, labels = np.unique(_last_owners(owners), return_inverse=True)
    return grown[kept].reshape(-1, 2, 3), labels


@kernel
def _merge_tiles(
    boxes: Array, owners: Array, order: Array, starts: Array, nodes: Array, slack: float
) -> None:
    """Merge the boxes of each tile: those of ``order`` from one start to the next."""
    for tile in range(starts.shape[0] - 1):
        _merge(boxes, owners, order[starts[tile] : starts[tile + 1]], nodes, slack)


@kernel
def _merge(boxes: Array, owners: Array, living: Array, nodes: Array, slack: float) -> int:
    """Merge some boxes.

    Parameters
    ----------
    boxes : (N, 6) float64
        Boxes, grown in place [m].
    owners : (N,) int64
        In which box each one has gone; itself where in none.
    living : (L,) int64
        Boxes to be merged, sorted by their low x; those that are left are moved to the front.
    nodes : (M, 3) float64
        Free codes, sorted by x [m].
    slack : float
        By how much boxes are wider to each side [m].

    Returns
    -------
    int
        How many are left.
    """
    left = len(living)
    around, beside = np.empty(6), np.empty((MOST_BESIDE + 2, 6))
    pieces, nexts = np.empty((MOST_PIECES, 6)), np.empty(MOST_PIECES, np.int64)
    is_changed = True
    while is_changed:
        is_changed = False
        for place in range(left):
            first = living[place]
            other = place + 1
            while owners[first] == first and other < left:
                second = living[other]
                if boxes[second, 0] > boxes[first, 3] + 2.0 * slack:
                    break
                other += 1
                if owners[second] != second or not _may_merge(boxes[first], boxes[second], slack, around):
                    continue
                number = _gather(boxes, owners, living[:left], first, second, slack, around, beside)
                if number == 0 or _covers_free(boxes[first], boxes[second], nodes, around):
                    continue
                limit = TOLERANCE * _volume(around, slack)
                if uncovered_volume(around, slack, beside[:number], limit, pieces, nexts) <= limit:
                    _copy(around, boxes[first])
                    owners[second] = first
                    is_changed = True
        kept = 0
        for place in range(left):
            if owners[living[place]] == living[place]:
                living[kept] = living[place]
                kept += 1
        left = kept
    return left


@kernel
def _last_owners(owners: Array) -> Array:
    """Return in which box each one is in the end."""
    found = owners.copy()
    for box in range(owners.shape[0]):
        owner = owners[box]
        while owners[owner] != owner:
            owner = owners[owner]
        found[box] = owner
    return found


@kernel(nrt=False)
def _may_merge(one: Array, other: Array, slack: float, around: Array) -> bool:
    """Write the box around two; return whether they touch and make up enough of it."""
    both = 1.0
    for axis in range(3):
        shared = min(one[axis + 3], other[axis + 3]) - max(one[axis], other[axis]) + 2.0 * slack
        if shared < 0.0:
            return False
        both *= shared
        around[axis] = min(one[axis], other[axis])
        around[axis + 3] = max(one[axis + 3], other[axis + 3])
    covered = _volume(one, slack) + _volume(other, slack) - both
    return bool(covered >= LEAST_COVER * _volume(around, slack))


@kernel(forceinline=True)
def _volume(box: Array, slack: float) -> float:
    volume = 1.0
    for axis in range(3):
        volume *= box[axis + 3] - box[axis] + 2.0 * slack
    return volume


@kernel(forceinline=True)
def _copy(box: Array, target: Array) -> None:
    for part in range(6):
        target[part] = box[part]


@kernel(nrt=False)
def _gather(
    boxes: Array,
    owners: Array,
    living: Array,
    first: int,
    second: int,
    slack: float,
    around: Array,
    beside: Array,
) -> int:
    """Write the boxes in the one around two into ``beside``, these two first.

    Return how many there are; 0 where all of them together are too little to fill it.
    """
    _copy(boxes[first], beside[0])
    _copy(boxes[second], beside[1])
    number = 2
    total = _volume(boxes[first], slack) + _volume(boxes[second], slack)
    for place in range(living.shape[0]):
        box = living[place]
        if boxes[box, 0] > around[3] + 2.0 * slack or number == MOST_BESIDE + 2:
            break
        if owners[box] != box or box in (first, second):
            continue
        shared = 1.0
        for axis in range(3):
            side = (
                min(around[axis + 3], boxes[box, axis + 3])
                - max(around[axis], boxes[box, axis])
                + 2.0 * slack
            )
            shared *= max(side, 0.0)
        if shared > 0.0:
            _copy(boxes[box], beside[number])
            number += 1
            total += shared
    return number if total >= (1.0 - TOLERANCE) * _volume(around, slack) else 0


@kernel(nrt=False)
def _covers_free(one: Array, other: Array, nodes: Array, around: Array) -> bool:
    """Whether the box around two lies over a free code over which neither lies."""
    place = _first_from(nodes, around[0])
    while place < nodes.shape[0] and nodes[place, 0] <= around[3]:
        x, y = nodes[place, 0], nodes[place, 1]
        if around[1] <= y <= around[4] and not (_lies_over(one, x, y) or _lies_over(other, x, y)):
            return True
        place += 1
    return False


@kernel(forceinline=True)
def _lies_over(box: Array, x: float, y: float) -> bool:
    return bool(box[0] <= x <= box[3] and box[1] <= y <= box[4])


@kernel(nrt=False)
def _first_from(nodes: Array, x: float) -> int:
    """Return the first place of nodes, sorted by x, that is not below x."""
    low, high = 0, nodes.shape[0]
    while low < high:
        middle = (low + high) // 2
        if nodes[middle, 0] < x:
            low = middle + 1
        else:
            high = middle
    return low
