"""Merging of boxes and codes of sparse maps, if the volume that they cover grows little."""

import math

import numpy as np
import scipy
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.sparse.settings import MapperSettings
from lidarium.mapping.sparse.sparse_map import OccupiedCodes
from lidarium.mapping.sparse.swept_body import BoxIndex, index_boxes

MAX_PIECES = 512
"""Pieces that wait to be looked at, at most."""


@kernel(nrt=False)
def _uncovered_volume(around: Array, slack: float, boxes: Array, limit: float, pieces: Array, nexts: Array) -> float:
    """Return how much of a box is in none of others, all made wider by a slack.

    Parameters
    ----------
    around : (6,) float64
        Low and high corner of the box [m].
    slack : float
        By how much all boxes are wider, to each side [m].
    boxes : (N, 6) float64
        The others [m].
    limit : float
        If more is found than this, or the pieces are too many, the search ends [m3].
    pieces : (MAX_PIECES, 6) float64
        Room for pieces.
    nexts : (MAX_PIECES,) int64
        Room for the boxes that each piece is compared with next.

    Returns
    -------
    float
        The volume [m3]; inf if the pieces are too many.
    """
    for axis in range(3):
        pieces[0, axis], pieces[0, axis + 3] = around[axis] - slack, around[axis + 3] + slack
    nexts[0] = 0
    waiting, uncovered = 1, 0.0
    while waiting > 0 and uncovered <= limit:
        waiting -= 1
        piece, place = pieces[waiting], nexts[waiting]
        while place < boxes.shape[0] and not _share_space(piece, boxes[place], slack):
            place += 1
        if place == boxes.shape[0]:
            uncovered += (piece[3] - piece[0]) * (piece[4] - piece[1]) * (piece[5] - piece[2])
            continue
        if waiting + 6 > MAX_PIECES:
            return float("inf")
        waiting = _cut(pieces, nexts, waiting, boxes[place], slack, place + 1)
    return uncovered


@kernel(nrt=False)
def _share_space(piece: Array, box: Array, slack: float) -> bool:
    for axis in range(3):
        if piece[axis] >= box[axis + 3] + slack or piece[axis + 3] <= box[axis] - slack:
            return False
    return True


@kernel(nrt=False)
def _cut(pieces: Array, nexts: Array, place: int, box: Array, slack: float, following: int) -> int:
    """Replace a piece by its parts outside a box; return the next index."""
    low_x, low_y, low_z = pieces[place, 0], pieces[place, 1], pieces[place, 2]
    high_x, high_y, high_z = pieces[place, 3], pieces[place, 4], pieces[place, 5]
    for axis in range(3):
        for side in range(2):
            low, high = box[axis] - slack, box[axis + 3] + slack
            start = low_x if axis == 0 else (low_y if axis == 1 else low_z)
            end = high_x if axis == 0 else (high_y if axis == 1 else high_z)
            if (side == 0 and start >= low) or (side == 1 and end <= high):
                continue
            kept = pieces[place]
            kept[0], kept[1], kept[2], kept[3], kept[4], kept[5] = low_x, low_y, low_z, high_x, high_y, high_z
            # What lies beyond this side of the box is a piece; the rest is cut at it.
            rest = low if side == 0 else high
            kept[axis + 3 if side == 0 else axis] = rest
            nexts[place] = following
            place += 1
            if axis == 0:
                low_x, high_x = (rest, high_x) if side == 0 else (low_x, rest)
            elif axis == 1:
                low_y, high_y = (rest, high_y) if side == 0 else (low_y, rest)
            else:
                low_z, high_z = (rest, high_z) if side == 0 else (low_z, rest)
    return place


FLAT = 0.25
"""Variance across a surface over that along its narrower side, below which it has a normal."""


def boxes_of(points: NDArray[np.float64], labels: NDArray[np.int64], count: int) -> NDArray[np.float64]:
    """Return the boxes of the codes' points.

    Parameters
    ----------
    points : (N, 3) float64
        Points [m].
    labels : (N,) int64
        Code of each point; each code has one.

    Returns
    -------
    (count, 2, 3) float64
        Low and high corners [m].
    """
    if count == 0:
        return np.empty((0, 2, 3))
    order = np.argsort(labels, kind="stable")
    starts = np.searchsorted(labels[order], np.arange(count))
    ranked = points[order]
    return np.stack([np.minimum.reduceat(ranked, starts), np.maximum.reduceat(ranked, starts)], axis=1)


def masses_of(labels: NDArray[np.int64], weights: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return the sums of the weights (N,) of each code's points, (count,)."""
    return np.asarray(np.bincount(labels, weights, count), np.float64)


def means_of(
    points: NDArray[np.float64], weights: NDArray[np.float64], labels: NDArray[np.int64], count: int
) -> NDArray[np.float64]:
    """Return the weighted means of each code's points (N, 3), (count, 3)."""
    masses = np.maximum(np.bincount(labels, weights, count), 1e-12)
    sums = np.stack([np.bincount(labels, weights * points[:, axis], count) for axis in range(3)], axis=1)
    return np.asarray(sums / masses[:, None])


def normals_of(
    points: NDArray[np.float64], weights: NDArray[np.float64], labels: NDArray[np.int64], count: int
) -> NDArray[np.float64]:
    """Return the normals of the surfaces of the codes' points.

    Parameters
    ----------
    points : (N, 3) float64
        Points [m].
    weights : (N,) float64
        Their weights.
    labels : (N,) int64
        Code of each point.

    Returns
    -------
    (count, 3) float64
        Unit normals, their largest part above zero; zero if the points are no surface.
    """
    masses = np.maximum(np.bincount(labels, weights, count), 1e-12)
    gaps = points - means_of(points, weights, labels, count)[labels]
    spreads = np.empty((count, 3, 3))
    for row in range(3):
        for column in range(3):
            spreads[:, row, column] = np.bincount(labels, weights * gaps[:, row] * gaps[:, column], count) / masses
    values, vectors = np.linalg.eigh(spreads)
    normals = vectors[:, :, 0]
    largest = np.take_along_axis(normals, np.abs(normals).argmax(axis=1)[:, None], axis=1)
    normals = normals * np.where(largest < 0.0, -1.0, 1.0)
    normals[~(values[:, 0] < FLAT * values[:, 1])] = 0.0
    return np.asarray(normals)


def are_covered(points: NDArray[np.float64], boxes: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which points (N, 3) [m] lie in one of the boxes (M, 2, 3) [m], (N,) bool."""
    if len(boxes) == 0:
        return np.zeros(len(points), np.bool_)
    return np.asarray(_are_covered(index_boxes(boxes), np.ascontiguousarray(points)))


@kernel
def _are_covered(index: BoxIndex, points: Array) -> Array:
    found = np.zeros(points.shape[0], np.bool_)
    rows, columns, cell = index.shape[0], index.shape[1], index.cell[0]
    for k in range(points.shape[0]):
        x, y, z = points[k, 0], points[k, 1], points[k, 2]
        column = math.floor((x - index.origin[0]) / cell)
        row = math.floor((y - index.origin[1]) / cell)
        if column < 0 or row < 0 or column > columns or row > rows:
            continue
        # A point on the upper border of the grid belongs to its last column.
        place = int(min(row, rows - 1) * columns + min(column, columns - 1))
        for member in range(index.starts[place], index.starts[place + 1]):
            box = index.boxes[index.members[member]]
            if box[0] <= x <= box[3] and box[1] <= y <= box[4] and box[2] <= z <= box[5]:
                found[k] = True
                break
    return found


def are_near(points: NDArray[np.float64], nodes: NDArray[np.float64], distance: float) -> NDArray[np.bool_]:
    """Return which points (N, 3) are near [m] to one of nodes (M, 3), (N,) bool."""
    if len(nodes) == 0 or len(points) == 0:
        return np.zeros(len(points), np.bool_)
    gaps = scipy.spatial.cKDTree(nodes).query(points, distance_upper_bound=distance)[0]
    return np.asarray(gaps <= distance)


TOLERANCE = 0.03
"""Share of the box around two boxes that may be in none."""

MIN_COVER = 0.6
"""Share of the box around two boxes that has to be in these for the others to be looked at."""

MAX_SLACK_M = 0.12
"""Gaps of up to twice this are closed [m]."""

TILE_M = 1.0
"""Side of the tiles within which boxes are merged first [m]."""

MIN_SLACK_M = 0.002

MAX_BESIDE = 64
"""Number of boxes besides the two are looked at."""

_GROWTH = 1.5


def _merged_boxes(
    boxes: NDArray[np.float64], free: NDArray[np.float64], slack: float, maximum: int
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Merge boxes whose union adds nothing.

    Parameters
    ----------
    boxes : (N, 2, 3) float64
        Low and high corners [m].
    free : (M, 3) float64
        Free codes [m]: merged boxes cover none that was not covered before.
    slack : float
        How far from the boxes a union may reach [m].

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
    slack = max(slack, MIN_SLACK_M)
    # Most merge with what is beside them; few are left to be compared with all.
    tiles = np.floor(boxes[:, 0, :2] / TILE_M).astype(np.int64)
    order = np.lexsort((boxes[:, 0, 0], tiles[:, 1], tiles[:, 0]))
    starts = np.flatnonzero(np.diff(tiles[order], axis=0).any(axis=1)) + 1
    _merge_tiles(grown, owners, order, np.concatenate([[0], starts, [count]]), nodes, slack)
    while True:
        living = np.flatnonzero(owners == np.arange(count))
        living = living[np.argsort(grown[living, 0], kind="stable")]
        left = _merge(grown, owners, living, nodes, slack)
        if left <= maximum or slack >= MAX_SLACK_M:
            break
        slack = min(_GROWTH * slack, MAX_SLACK_M)
    kept, labels = np.unique(_last_owners(owners), return_inverse=True)
    return grown[kept].reshape(-1, 2, 3), labels


@kernel
def _merge_tiles(boxes: Array, owners: Array, order: Array, starts: Array, nodes: Array, slack: float) -> None:
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
        In which box each one has gone; itself if in none.
    living : (L,) int64
        Boxes to be merged, sorted by their low x; those that are left are moved to the front.
    nodes : (M, 3) float64
        Free codes, sorted by x [m].
    slack : float
        By how much boxes are wider to each side [m].
    """
    left = len(living)
    around, beside = np.empty(6), np.empty((MAX_BESIDE + 2, 6))
    pieces, nexts = np.empty((MAX_PIECES, 6)), np.empty(MAX_PIECES, np.int64)
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
                if _uncovered_volume(around, slack, beside[:number], limit, pieces, nexts) <= limit:
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
    return bool(covered >= MIN_COVER * _volume(around, slack))


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

    Return their number; 0 if all of them together are too little to fill it.
    """
    _copy(boxes[first], beside[0])
    _copy(boxes[second], beside[1])
    number = 2
    total = _volume(boxes[first], slack) + _volume(boxes[second], slack)
    for place in range(living.shape[0]):
        box = living[place]
        if boxes[box, 0] > around[3] + 2.0 * slack or number == MAX_BESIDE + 2:
            break
        if owners[box] != box or box in (first, second):
            continue
        shared = 1.0
        for axis in range(3):
            side = min(around[axis + 3], boxes[box, axis + 3]) - max(around[axis], boxes[box, axis]) + 2.0 * slack
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


MIN_AGREEMENT = 0.9
"""Mean square of the cosine between the normals of codes and that of all of them."""

FLATNESS_M = 0.03
"""How far codes may lie from a common plane, root of the mean square [m]."""


def merged_codes(
    codes: OccupiedCodes, free: NDArray[np.float64], settings: MapperSettings
) -> tuple[OccupiedCodes, NDArray[np.int64]]:
    """Merge codes whose boxes add nothing to each other.

    Parameters
    ----------
    free : (N, 3) float64
        Free codes [m]: boxes do not grow over them.

    Returns
    -------
    (K,) int64
        Which code each of them is; -1 for those of several.
    """
    if len(codes) == 0 or not settings.merges:
        return codes, np.arange(len(codes))
    boxes, labels = _merged_boxes(codes.boxes, free, settings.slack_m, settings.most_boxes)
    count = len(boxes)
    weights = masses_of(labels, codes.weights, count)
    centres = np.stack(
        [np.bincount(labels, codes.weights * codes.centres[:, axis], count) for axis in range(3)], axis=1
    )
    # The last of each group in this order is its heaviest.
    order = np.lexsort((codes.weights, labels))
    heaviest = order[np.searchsorted(labels[order], np.arange(count), side="right") - 1]
    merged = OccupiedCodes(
        boxes=boxes,
        centres=centres / np.maximum(weights, 1e-12)[:, None],
        weights=weights,
        normals=_common_normals(codes, labels, centres / np.maximum(weights, 1e-12)[:, None]),
        frames=codes.frames[heaviest],
    )
    return merged, np.where(np.bincount(labels, minlength=count) == 1, heaviest, -1)


def _common_normals(
    codes: OccupiedCodes, labels: NDArray[np.int64], centres: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the normals of merged codes, zero if they share no plane."""
    count = len(centres)
    products = np.einsum("n,ni,nj->nij", codes.weights, codes.normals, codes.normals).reshape(-1, 9)
    sums = np.stack([np.bincount(labels, part, count) for part in products.T], axis=1).reshape(-1, 3, 3)
    values, vectors = np.linalg.eigh(sums)
    normals = vectors[:, :, 2]
    largest = np.take_along_axis(normals, np.abs(normals).argmax(axis=1)[:, None], axis=1)
    normals = normals * np.where(largest < 0.0, -1.0, 1.0)
    weights = np.maximum(masses_of(labels, codes.weights, count), 1e-12)
    gaps = np.einsum("ij,ij->i", codes.centres - centres[labels], normals[labels])
    is_plane = np.bincount(labels, codes.weights * gaps**2, count) <= weights * FLATNESS_M**2
    normals[~(is_plane & (values[:, 2] >= MIN_AGREEMENT * weights))] = 0.0
    return np.asarray(normals)
