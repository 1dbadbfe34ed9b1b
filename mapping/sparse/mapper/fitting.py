"""Boxes fitted to the points of a map: none is mostly empty, and every point is in one.

Codes gather points that are near each other on average, so a few stray points far apart may share a box that spans
free space. Boxes are compared with all points that were seen, and divided where they are mostly empty.
"""

import numpy as np
import scipy
from numpy.typing import NDArray

from lidarium.mapping.sparse.mapper.frame_coding import split_points
from lidarium.mapping.sparse.mapper.merging import are_covered
from lidarium.mapping.sparse.sparse_map import OccupiedCodes, SparseMap, occupied_codes

NEAR_M = 0.10
"""Farther from all points, a place in a box is empty [m]; twice the distance of most points if that is more."""

_MOST_POINTS = 0.9
_SOME_POINTS = 5000

MOST_EMPTY = 0.25
"""Largest share of a box that may be empty."""

CELL_M = 0.02
"""Side of the cells in which points are kept [m]."""

_HALF_M = 0.5 * CELL_M + 1e-6
"""The middle of a cell is at most this far from a box with its points, which may be on the cell's border [m]."""

_SAMPLE_M = 0.05
_SAMPLES_AT_ONCE = 2_000_000
_BITS = 21
_GROUP_M = 0.25


class SeenPoints:
    """Cells of 2 cm that hold points of obstacles, frame by frame."""

    def __init__(self) -> None:
        self._known = np.empty(0, np.int64)
        self._added: list[NDArray[np.int64]] = []

    def add(self, points: NDArray[np.float64]) -> None:
        """Add points (N, 3) [m]."""
        cells = np.floor(points / CELL_M).astype(np.int64) + (1 << (_BITS - 1))
        if len(cells) and not ((cells >= 0) & (cells < 1 << _BITS)).all():
            raise ValueError(f"a point is farther than {CELL_M * 2 ** (_BITS - 1):,.0f} m from the origin of the map")
        self._added.append(np.unique((cells[:, 0] << 2 * _BITS) | (cells[:, 1] << _BITS) | cells[:, 2]))
        # Sorting all of them for each frame would take longer than the frame.
        if sum(map(len, self._added)) > len(self._known) + 1_000_000:
            self._gather()

    def _gather(self) -> None:
        self._known = np.unique(np.concatenate([self._known, *self._added]))
        self._added = []

    def drop(self, gone: NDArray[np.float64], left: NDArray[np.float64]) -> None:
        """Forget the cells in some boxes (M, 2, 3) [m], but for those in boxes that are left (K, 2, 3)."""
        middles = self.middles
        half = np.array([[-0.5], [0.5]]) * CELL_M
        self._known = self._known[~are_covered(middles, gone + half) | are_covered(middles, left + half)]

    @property
    def middles(self) -> NDArray[np.float64]:
        """Middles of the cells (N, 3) [m]."""
        self._gather()
        mask = (1 << _BITS) - 1
        cells = np.stack([self._known >> 2 * _BITS, self._known >> _BITS & mask, self._known & mask], axis=1)
        return (cells - (1 << (_BITS - 1)) + 0.5) * CELL_M


def empty_shares(boxes: NDArray[np.float64], points: "scipy.spatial.cKDTree", near: float) -> NDArray[np.float64]:
    """Return the share of each box (M, 2, 3) that is farther than a distance [m] from all points, (M,)."""
    sizes = boxes[:, 1] - boxes[:, 0]
    counts = np.maximum(np.ceil(sizes / _SAMPLE_M).astype(np.int64), 1)
    found = np.zeros(len(boxes))
    # A box that is nowhere wider than this has a point near to all of it.
    order = np.flatnonzero((sizes > near).any(axis=1))
    start = 0
    while start < len(order):
        totals = np.cumsum(counts[order[start:]].prod(axis=1))
        stop = start + max(int(np.searchsorted(totals, _SAMPLES_AT_ONCE, side="right")), 1)
        part = order[start:stop]
        numbers = counts[part].prod(axis=1)
        owners = np.repeat(np.arange(len(part)), numbers)
        ranks = np.arange(numbers.sum()) - np.repeat(np.cumsum(numbers) - numbers, numbers)
        shape = counts[part][owners]
        x, rest = ranks // (shape[:, 1] * shape[:, 2]), ranks % (shape[:, 1] * shape[:, 2])
        places = np.stack([x, rest // shape[:, 2], rest % shape[:, 2]], axis=1)
        samples = boxes[part, 0][owners] + (places + 0.5) / shape * sizes[part][owners]
        gaps = points.query(samples, distance_upper_bound=near)[0]
        found[part] = np.bincount(owners, np.isinf(gaps), len(part)) / numbers
        start = stop
    return found


def near_distance(points: "scipy.spatial.cKDTree") -> float:
    """Return how far from all points a place is empty [m]."""
    some = points.data[:: max(points.n // _SOME_POINTS, 1)]
    if points.n < 2:
        return NEAR_M
    gaps = np.asarray(points.query(some, 2)[0])[:, 1]
    return max(NEAR_M, 2.0 * float(np.quantile(gaps, _MOST_POINTS)))


def fitted_codes(codes: OccupiedCodes, points: NDArray[np.float64], frame: int = 0) -> OccupiedCodes:
    """Return codes whose boxes hold all points and are not mostly empty.

    Parameters
    ----------
    points : (N, 3) float64
        Middles of cells that hold points [m].
    frame : int
        Frame of the codes that are new.
    """
    if len(points) == 0:
        return codes
    tree = scipy.spatial.cKDTree(points)
    near = near_distance(tree)
    is_empty = empty_shares(codes.boxes, tree, near) > MOST_EMPTY
    kept = codes.taken(~is_empty)
    parts = []
    for low, high in codes.boxes[is_empty]:
        within = points[((points >= low - _HALF_M) & (points <= high + _HALF_M)).all(axis=1)]
        parts.append(_divided(within, tree, near))
    boxes = np.concatenate([kept.boxes, *parts])
    missed = points[~are_covered(points, boxes + np.array([[-_HALF_M], [_HALF_M]]))]
    parts += [_divided(group, tree, near) for group in _groups(missed)]
    return kept.joined(occupied_codes(np.concatenate([np.empty((0, 2, 3)), *parts]), frame))


def unlike_points(sparse_map: SparseMap, points: NDArray[np.float64]) -> dict[str, int]:
    """Count cells of obstacles (N, 3) in no box of a map, and boxes that are mostly farther than 10 cm from all."""
    obstacles = split_points(points, sparse_map.floor, sparse_map.settings)[0]
    if len(obstacles) == 0:
        return {"points": 0, "boxes": len(sparse_map.boxes)}
    # Cells beside the borders of heights hold points of both sides.
    is_inner = split_points(obstacles - CELL_M * sparse_map.floor.normal, sparse_map.floor, sparse_map.settings)[0]
    wide = sparse_map.boxes + np.array([[-CELL_M], [CELL_M]])
    missed = ~are_covered(is_inner + CELL_M * sparse_map.floor.normal, wide)
    tree = scipy.spatial.cKDTree(obstacles)
    shares = empty_shares(sparse_map.boxes, tree, near_distance(tree))
    return {"points": int(np.count_nonzero(missed)), "boxes": int(np.count_nonzero(shares > MOST_EMPTY + 0.05))}


def _groups(points: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Return points in the same large cells together."""
    if len(points) == 0:
        return []
    labels = np.unique(np.floor(points / _GROUP_M).astype(np.int64), axis=0, return_inverse=True)[1].ravel()
    order = np.argsort(labels, kind="stable")
    return np.split(points[order], np.flatnonzero(np.diff(labels[order])) + 1)


def _divided(points: NDArray[np.float64], tree: "scipy.spatial.cKDTree", near: float) -> NDArray[np.float64]:
    """Return the boxes around cells (N, 3), divided until none is mostly empty, (M, 2, 3)."""
    waiting, found = [points] if len(points) else [], []
    while waiting:
        own = waiting.pop()
        box = np.stack([own.min(axis=0) - 0.5 * CELL_M, own.max(axis=0) + 0.5 * CELL_M])
        if len(own) == 1 or empty_shares(box[None], tree, near)[0] <= MOST_EMPTY:
            found.append(box)
            continue
        axis, plane = _widest_gap(own, near)
        is_low = own[:, axis] < plane
        waiting += [own[is_low], own[~is_low]]
    return np.array(found).reshape(-1, 2, 3)


def _widest_gap(points: NDArray[np.float64], near: float) -> tuple[int, float]:
    """Return axis and place of the widest gap between points; the middle of the longest side if all are narrow."""
    ranked = np.sort(points, axis=0)
    gaps = np.diff(ranked, axis=0)
    axis = int(gaps.max(axis=0).argmax())
    place = int(gaps[:, axis].argmax())
    if gaps[place, axis] > near:
        return axis, float(ranked[place : place + 2, axis].mean())
    axis = int(np.ptp(points, axis=0).argmax())
    return axis, float(ranked[[0, -1], axis].mean())
