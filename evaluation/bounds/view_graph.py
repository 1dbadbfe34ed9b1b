"""A floor as places, paths between them, and the cells seen from each.

Places are those with most room in each square of a lattice. They are joined by straight lines on which the
robot's body fits.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, dijkstra

from lidarium.envs.floors.floor import Raster
from lidarium.envs.floors.free_space import cell_of, components, reachable_free_space
from lidarium.mapping.grids.grid_lines import line_is_open
from lidarium.mapping.kernels.compilation import Array, kernel

MOST_PLACES = 2500
"""Approximate maximum number of positions on a floor; it determines the size of the squares."""

LEAST_SIDE = 0.3
"""Minimum side of the squares [m]."""

NARROW_M, NARROW_SIDE = 0.3, 0.15
"""Passages with less room than this around the body have positions this close to each other [m]."""

TRIALS, FINER = 4, 0.75
"""Maximum number of finer lattices tried if positions are not connected, and the factor of their side."""

SAMPLE_M = 0.1
"""Distance between the points to be seen [m]."""

NEIGHBOURS = 2.9
"""Positions within this number of sides of a square are connected."""


@dataclass(frozen=True, slots=True)
class ViewGraph:
    """A floor as places, paths and views.

    Attributes
    ----------
    places : (N, 2) float64
        x, y in the floor's frame [m]; the first ones are the start positions.
    room : (N,) float64
        Room around the body there [m].
    robots : int
        Number of start positions.
    links : (N, N) csr_array
        Lengths of the straight lines between neighbours [m].
    lengths : (N, N) float64
        Lengths of the shortest paths [m]; inf if no path exists.
    before : (N, N) int32
        The position before the last one on the path between each pair, negative if no path exists.
    views : (N, words) uint64
        Which points are seen from each place, a bit for each.
    points : (M, 2) int64
        Cells (row, column) of the laser's raster to be seen.
    laser : Raster
        Cells that lasers can see.
    """

    places: NDArray[np.float64]
    room: NDArray[np.float64]
    robots: int
    links: csr_array
    lengths: NDArray[np.float64]
    before: NDArray[np.int32]
    views: NDArray[np.uint64]
    points: NDArray[np.int64]
    laser: Raster

    def path(self, start: int, end: int) -> list[int]:
        """Return the places on the shortest path, the first one left out."""
        found: list[int] = []
        while end != start:
            found.append(end)
            end = int(self.before[start, end])
        return found[::-1]

    def seen(self, places: list[int]) -> NDArray[np.uint64]:
        """Return the cells seen from any of some places, (words,) uint64."""
        return np.asarray(np.bitwise_or.reduce(self.views[places], axis=0))


def count(bits: NDArray[np.uint64]) -> NDArray[np.int64]:
    """Count the bits of each row of (..., words) uint64."""
    return np.asarray(np.bitwise_count(bits).sum(axis=-1, dtype=np.int64))


def numbers_of(bits: NDArray[np.uint64]) -> NDArray[np.int64]:
    """Return the numbers of the bits that are set in (words,) uint64."""
    return np.flatnonzero(np.unpackbits(bits.astype("<u8").view(np.uint8), bitorder="little"))


def bits_of(numbers: NDArray[np.int64], words: int) -> NDArray[np.uint64]:
    """Return (words,) uint64 in which the bits of some numbers are set."""
    flags = np.zeros(64 * words, np.uint8)
    flags[numbers] = 1
    return np.packbits(flags, bitorder="little").view("<u8").astype(np.uint64)


def view_graph(
    body: Raster,
    laser: Raster,
    radius: float,
    range_max: float,
    starts: NDArray[np.float64],
    spacing: tuple[float, float] = (LEAST_SIDE, SAMPLE_M),
) -> ViewGraph:
    """Return a floor as places, paths and views.

    Parameters
    ----------
    starts : (robots, 2 or 3) float64
        Start positions [m].
    spacing : (float, float)
        Minimum side of the squares of positions, and distance between the points to be seen [m].
    """
    if body.solid.shape != laser.solid.shape or body.origin != laser.origin:
        raise ValueError("the rasters of body and laser lie in different frames; want those of one floor")
    free = reachable_free_space(body, radius, starts)
    area = float((components(body, radius).labels > 0).sum()) * body.resolution**2
    side = max(spacing[0], math.sqrt(area / MOST_PLACES))
    for _ in range(TRIALS):
        cells, clearance = _places(body, radius, starts, side)
        links = _links(body, radius, cells, side)
        # Lines do not bend around the jambs of narrow doors: places in between do.
        if connected_components(links, directed=False)[0] <= 1:
            break
        side *= FINER
    lengths, before = dijkstra(links, return_predecessors=True)
    views, points = _views(laser, free & (laser.solid == 0), cells, (range_max, spacing[1]))
    places = (cells[:, ::-1] + 0.5) * body.resolution + np.asarray(body.origin)
    return ViewGraph(places, clearance - radius, len(starts), links, lengths, before, views, points, laser)


def _places(
    raster: Raster, radius: float, starts: NDArray[np.float64], side: float
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the cells of starts and all places, and their clearance [m]."""
    found = components(raster, radius)
    begin = np.array([cell_of(raster, start) for start in starts], np.int64)
    near = [_labels_near(found.labels, cell) for cell in begin]
    fits = np.isin(found.labels, [label for label in near if label])
    distance = cv2.distanceTransform((raster.solid == 0).astype(np.uint8), cv2.DIST_L2, 5).astype(np.float64)
    narrow = fits & (distance * raster.resolution < radius + NARROW_M)
    # Along the middle of narrow passages places lie closer.
    middle = narrow & (distance >= cv2.dilate(distance, np.ones((3, 3))) - 0.5)
    parts = [_roomiest(fits, distance, side / raster.resolution)]
    parts.append(_roomiest(middle, distance, NARROW_SIDE / raster.resolution))
    cells = np.unique(np.concatenate(parts), axis=0)
    cells = np.concatenate([begin, cells])
    return cells, distance[cells[:, 0], cells[:, 1]] * raster.resolution


def _roomiest(wanted: NDArray[np.bool_], distance: NDArray[np.float64], side: float) -> NDArray[np.int64]:
    """Return the wanted cell (row, column) with most room of each square."""
    step = max(round(side), 1)
    rows, columns = np.nonzero(wanted)
    if not len(rows):
        return np.empty((0, 2), np.int64)
    order = np.lexsort((columns, rows, -distance[rows, columns], columns // step, rows // step))
    squares = np.stack([rows[order] // step, columns[order] // step], axis=1)
    is_first = np.concatenate([[True], (np.diff(squares, axis=0) != 0).any(axis=1)])
    kept = order[is_first]
    return np.stack([rows[kept], columns[kept]], axis=1)


def _labels_near(labels: NDArray[np.unsignedinteger], cell: NDArray[np.int64]) -> int:
    part = labels[max(cell[0] - 1, 0) : cell[0] + 2, max(cell[1] - 1, 0) : cell[1] + 2]
    return int(labels[tuple(cell)]) or int(part.max())


def _links(raster: Raster, radius: float, cells: NDArray[np.int64], side: float) -> csr_array:
    """Return the lengths of the straight lines between neighbouring places [m]."""
    fits = np.where(components(raster, radius).labels > 0, -1, 1).astype(np.int8)
    spacing = np.hypot(*(cells[:, None] - cells[None]).astype(np.float64).transpose(2, 0, 1))
    first, second = np.nonzero(np.triu(spacing <= NEIGHBOURS * side / raster.resolution, 1))
    is_open = _are_open(fits, cells, first, second)
    first, second = first[is_open], second[is_open]
    apart = np.maximum(spacing[first, second] * raster.resolution, 1e-6)
    return csr_array((np.tile(apart, 2), (np.r_[first, second], np.r_[second, first])), shape=spacing.shape)


@kernel
def _are_open(fits: Array, cells: Array, first: Array, second: Array) -> NDArray[np.bool_]:
    found = np.zeros(len(first), np.bool_)
    for i in range(len(first)):
        a, b = cells[first[i]], cells[second[i]]
        found[i] = line_is_open(fits, a[0], a[1], b[0], b[1])
    return found


def _views(
    laser: Raster, counted: NDArray[np.bool_], cells: NDArray[np.int64], reach: tuple[float, float]
) -> tuple[NDArray[np.uint64], NDArray[np.int64]]:
    """Return which points are seen from each cell, as bits, and the points (M, 2)."""
    step = max(round(reach[1] / laser.resolution), 1)
    rows, columns = np.nonzero(counted[step // 2 :: step, step // 2 :: step])
    points = np.stack([rows, columns], axis=1) * step + step // 2
    return _seen_bits(laser, cells, np.zeros(len(cells)), points, (reach[0], 2.0 * math.pi)), points


def seen_on_track(
    graph: ViewGraph, poses: NDArray[np.float64], range_max: float, field_of_view: float
) -> NDArray[np.uint64]:
    """Return which points robots see from any of some poses, (words,) uint64.

    Parameters
    ----------
    poses : (n, 3) float64
        x, y, theta in the floor's frame [m, rad].
    """
    cells = np.array([cell_of(graph.laser, pose) for pose in poses], np.int64)
    headings = np.ascontiguousarray(poses[:, 2])
    views = _seen_bits(graph.laser, cells, headings, graph.points, (range_max, field_of_view))
    return np.asarray(np.bitwise_or.reduce(views, axis=0))


def _seen_bits(
    laser: Raster,
    cells: NDArray[np.int64],
    headings: NDArray[np.float64],
    points: NDArray[np.int64],
    reach: tuple[float, float],
) -> NDArray[np.uint64]:
    """Return the points seen from each cell with a heading, (cells, words) uint64.

    ``reach`` is the range [m] and the field of view [rad].
    """
    levels = np.where(laser.solid > 0, 1, -1).astype(np.int8)
    views = np.zeros((len(cells), -(-max(len(points), 1) // 64)), np.uint64)
    _see(levels, cells, headings, points, ((reach[0] / laser.resolution) ** 2, 0.5 * reach[1]), views)
    return views


@kernel
def _see(levels: Array, cells: Array, headings: Array, points: Array, reach: tuple[float, float], views: Array) -> None:
    for i in range(len(cells)):
        for k in range(len(points)):
            rise, run = points[k, 0] - cells[i, 0], points[k, 1] - cells[i, 1]
            if rise * rise + run * run > reach[0]:
                continue
            if reach[1] < math.pi:
                gap = math.atan2(rise, run) - headings[i]
                gap -= 2.0 * math.pi * math.floor(gap / (2.0 * math.pi) + 0.5)
                if abs(gap) > reach[1]:
                    continue
            if line_is_open(levels, cells[i, 0], cells[i, 1], points[k, 0], points[k, 1]):
                views[i, k >> 6] |= np.uint64(1) << np.uint64(k & 63)


def reached(graph: ViewGraph) -> NDArray[np.bool_]:
    """Return which places any start is joined to, (N,) bool."""
    labels = connected_components(graph.links, directed=False)[1]
    return np.isin(labels, labels[: graph.robots])
