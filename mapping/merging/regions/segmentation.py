"""Free space of a map split into regions at doors: a watershed of the clearance.

Cells are taken from the middles of rooms outwards. If two basins meet, they stay apart if the passage is
as narrow as a door and narrower than either of them; else they become one.

References
----------
Watershed of clearance for rooms: Bormann, Jordan, Li, Hampp, Haegele, "Room segmentation: survey,
implementation, and analysis", Proc. IEEE Int. Conf. Robotics and Automation, 2016. Basins that merge by their
depth: Najman, Schmitt, "Geodesic saliency of watershed contours and hierarchical segmentation", IEEE
Transactions on Pattern Analysis and Machine Intelligence 18, 1996.
"""

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.bounds import (
    Angle,
    Count,
    Counted,
    Distance,
    FromZero,
    Length,
    above,
    check_settings,
    share,
    within,
)
from lidarium.mapping.grids.occupancy import FREE
from lidarium.mapping.kernels.compilation import Array, kernel


@dataclass(frozen=True, slots=True, kw_only=True)
class RegionSettings:
    """How free space is split into regions, and how those of two maps are matched.

    Attributes
    ----------
    cell_m : float, default 0.05
        Side of the cells in which regions are found, or that of the map if it is larger [m].
    most_cells : int, default 500000
        Maps that know more of such cells are split in larger ones: a bound of time.
    least_obstacle_m : float, default 0.4
        Obstacles in free space that are smaller along both axes do not split it [m].
    widest_door_m : float, default 1.5
        Widest gap that is a door [m].
    door_share : float, default 0.75
        Largest width of a door as a share of the width of the narrower region.
    least_radius_m : float, default 0.35
        Radius of the disc that a region holds at least [m].
    least_area_m2 : float, default 1.5
        Area of a region at least; smaller ones belong to a neighbour [m2].
    most_regions, most_doors : int, default 24, 32
        Number of the largest regions, and of the widest doors, that are matched.
    extent_m, extent_share : float, default 0.3, 0.08
        By how much the extents of one region may differ between maps [m, share]: the larger of both.
    door_width_m : float, default 0.3
        By how much the widths of one door may differ [m].
    scale_share : float, default 0.08
        By how much the ratio of a region's extents may differ if a scale is sought, as a share.
    scale_steps : int, default 4
        Number of scales that are proposed on each side of that of two regions, 3 % apart.
    candidates : int, default 12
        Number of motions that are refined and judged.
    apart_m, apart_angle : float
        These differ by more [m, rad].
    likely_rotations : bool, default False
        Whether of all rotations only those are tried under which the walls of both maps run alike. That takes
        half the time, and misses rivals by which strangers are known.
    """

    cell_m: Length = 0.05
    most_cells: Annotated[int, within(1000, 100_000_000)] = 500_000
    least_obstacle_m: Distance = 0.4
    widest_door_m: Length = 1.5
    door_share: Annotated[float, share()] = 0.75
    least_radius_m: Distance = 0.35
    least_area_m2: FromZero = 1.5
    most_regions: Count = 24
    most_doors: Count = 32
    extent_m: Distance = 0.3
    extent_share: Annotated[float, share()] = 0.08
    door_width_m: Distance = 0.3
    scale_share: Annotated[float, above(0.0, 1.0)] = 0.08
    scale_steps: Counted = 4
    candidates: Annotated[int, within(1, 1000)] = 12
    apart_m: Distance = 0.3
    apart_angle: Angle = math.radians(4.0)
    likely_rotations: bool = False

    def __post_init__(self) -> None:
        check_settings(self, "regions")


NONE = -1
"""Label of cells that are in no region."""


class Meetings(NamedTuple):
    """Edges between cells of two regions.

    Attributes
    ----------
    regions : (n, 2) int32
        The regions.
    clearance : (n,) float32
        Of the narrower of both cells [cells].
    places : (n, 2) float64
        Middle of each edge, column and row [cells].
    steps : (n, 2) float64
        Unit step across it, from the first region to the second.
    """

    regions: NDArray[np.int32]
    clearance: NDArray[np.float32]
    places: NDArray[np.float64]
    steps: NDArray[np.float64]


def find_meetings(labels: NDArray[np.int32], clearance: NDArray[np.float32]) -> Meetings:
    """Return all edges at which cells of two regions meet.

    Parameters
    ----------
    labels : (rows, columns) int32
        Region of each cell, or `NONE`.
    clearance : (rows, columns) float32
        Distance to the nearest cell that is not free [cells].
    """
    cells = np.empty((_count(labels), 3), np.int64)
    _collect(labels, cells)
    row, column, is_down = cells.T
    beside = row + is_down, column + 1 - is_down
    steps = np.column_stack([1 - is_down, is_down]).astype(np.float64)
    return Meetings(
        np.column_stack([labels[row, column], labels[beside]]),
        np.minimum(clearance[row, column], clearance[beside]),
        np.column_stack([column, row]) + 0.5 + 0.5 * steps,
        steps,
    )


@kernel
def _count(labels: Array) -> int:
    """Return the number of edges at which two regions meet."""
    count = 0
    for row in range(labels.shape[0]):
        for column in range(labels.shape[1]):
            for down in range(2):
                if _meets(labels, row, column, down, 1 - down):
                    count += 1
    return count


@kernel
def _collect(labels: Array, cells: Array) -> None:
    """Write the first cell of each edge, and whether the other is below: 1, else 0."""
    count = 0
    for row in range(labels.shape[0]):
        for column in range(labels.shape[1]):
            for down in range(2):
                if _meets(labels, row, column, down, 1 - down):
                    cells[count, 0], cells[count, 1], cells[count, 2] = row, column, down
                    count += 1


@kernel(forceinline=True)
def _meets(labels: Array, row: int, column: int, down: int, right: int) -> bool:
    """Whether a cell and its neighbour are of two regions."""
    if labels[row, column] == NONE or row + down >= labels.shape[0] or column + right >= labels.shape[1]:
        return False
    other = labels[row + down, column + right]
    return bool(other != NONE and other != labels[row, column])


_LEVELS_A_CELL = 8


class _SplitRule(NamedTuple):
    """Conditions for basins to stay apart; lengths in cells.

    Half the width of the widest door, its share of the narrower region, radius of a region at least.
    """

    half_door: float
    door_share: float
    least_radius: float


def free_space(levels: NDArray[np.uint8], least_obstacle: int) -> NDArray[np.uint8]:
    """Return 1 if a map is free, or holds no more than a small obstacle.

    Parameters
    ----------
    levels : (rows, columns) uint8
        The three-level map.
    least_obstacle : int
        Obstacles amid free space of fewer rows and fewer columns are free [cells].
    """
    free = np.asarray(levels == FREE, np.uint8)
    count, parts, statistics, _ = cv2.connectedComponentsWithStats(1 - free, connectivity=8)
    rows, columns = levels.shape
    left, top = statistics[:, cv2.CC_STAT_LEFT], statistics[:, cv2.CC_STAT_TOP]
    width, height = statistics[:, cv2.CC_STAT_WIDTH], statistics[:, cv2.CC_STAT_HEIGHT]
    is_small = (width < least_obstacle) & (height < least_obstacle)
    is_small &= (left > 0) & (top > 0) & (left + width < columns) & (top + height < rows)
    is_small[0] = False
    if count > 1 and is_small.any():
        free |= is_small[parts].astype(np.uint8)
    return free


def clearance_of(free: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return the distance of each cell to the nearest that is not free, or to the rim [cells]."""
    framed = cv2.copyMakeBorder(free, 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=(0.0,))
    return np.ascontiguousarray(cv2.distanceTransform(framed, cv2.DIST_L2, 5)[1:-1, 1:-1])


def split_regions(clearance: NDArray[np.float32], side: float, settings: RegionSettings) -> NDArray[np.int32]:
    """Return the region of each cell, numbered from 0, or `NONE`.

    Parameters
    ----------
    clearance : (rows, columns) float32
        Distance to the nearest cell that is not free [cells], 0 there.
    side : float
        Side of a cell [m].
    settings : RegionSettings
        Rules for splitting regions.
    """
    rule = _SplitRule(0.5 * settings.widest_door_m / side, settings.door_share, settings.least_radius_m / side)
    labels = np.full(clearance.shape, NONE, np.int32)
    order = np.empty(np.count_nonzero(clearance), np.int64)
    _sort(clearance, np.zeros(int(clearance.max() * _LEVELS_A_CELL) + 2, np.int64), order)
    parent, peak = np.empty(len(order), np.int32), np.empty(len(order), np.float32)
    areas = np.zeros(len(order), np.int64)
    count = _flood(clearance, order, rule, (parent, peak, areas), labels)
    least = settings.least_area_m2 / side**2
    return _without_small(labels, clearance, (areas[:count], peak[:count]), (least, rule.least_radius))


@kernel
def _sort(clearance: Array, ends: Array, order: Array) -> None:
    """Write the indices of free cells, those with most clearance first; ends are zeros, one per level."""
    last = ends.shape[0] - 1
    for row in range(clearance.shape[0]):
        for column in range(clearance.shape[1]):
            if clearance[row, column] > 0.0:
                ends[last - int(clearance[row, column] * _LEVELS_A_CELL)] += 1
    total = 0
    for level in range(last + 1):
        total += ends[level]
        ends[level] = total - ends[level]
    for row in range(clearance.shape[0]):
        for column in range(clearance.shape[1]):
            if clearance[row, column] > 0.0:
                level = last - int(clearance[row, column] * _LEVELS_A_CELL)
                order[ends[level]] = row * clearance.shape[1] + column
                ends[level] += 1


@kernel
def _flood(clearance: Array, order: Array, rule: _SplitRule, basins: tuple[Array, Array, Array], labels: Array) -> int:
    """Label the cells by basins, with parent, peak and area of each; returns how many there are.

    Each cell joins the basin from which the slope to it is steepest. If it touches several, those merge
    that no door keeps apart.
    """
    parent, peak, areas = basins
    rows, columns = clearance.shape
    count = 0
    for cell in order:
        row, column = cell // columns, cell % columns
        top, left = max(row - 1, 0), max(column - 1, 0)
        bottom, right = min(row + 2, rows), min(column + 2, columns)
        height, steepest, best = clearance[row, column], -1.0, NONE
        for y in range(top, bottom):
            for x in range(left, right):
                if labels[y, x] != NONE and clearance[y, x] > steepest:
                    steepest, best = clearance[y, x], labels[y, x]
        if best == NONE:
            best = count
            parent[best], peak[best] = best, height
            count += 1
        best = _root(parent, best)
        labels[row, column] = best
        for y in range(top, bottom):
            for x in range(left, right):
                if labels[y, x] != NONE and labels[y, x] != best:
                    best = _met(parent, peak, best, _root(parent, labels[y, x]), height, rule)
    for cell in order:
        root = _root(parent, labels[cell // columns, cell % columns])
        labels[cell // columns, cell % columns] = root
        areas[root] += 1
    return count


@kernel(forceinline=True)
def _root(parent: Array, basin: int) -> int:
    """Return the basin into which one has merged; the path is halved."""
    while parent[basin] != basin:
        parent[basin] = parent[parent[basin]]
        basin = parent[basin]
    return basin


@kernel(forceinline=True)
def _met(parent: Array, peak: Array, one: int, other: int, height: float, rule: _SplitRule) -> int:
    """Merge two basins that meet, unless a door keeps them apart; returns that of the first one."""
    if one == other or _is_door(height, min(peak[one], peak[other]), rule):
        return one
    low, high = (one, other) if peak[one] < peak[other] else (other, one)
    parent[low] = high
    return high


@kernel(forceinline=True)
def _is_door(height: float, peak: float, rule: _SplitRule) -> bool:
    """Whether a passage keeps two basins apart, by its clearance and the peak of the narrower one."""
    return bool(height <= rule.half_door and peak >= rule.least_radius and height <= rule.door_share * peak)


def _without_small(
    labels: NDArray[np.int32],
    clearance: NDArray[np.float32],
    basins: tuple[NDArray[np.int64], NDArray[np.float32]],
    least: tuple[float, float],
) -> NDArray[np.int32]:
    """Return the labels numbered from 0, small regions in the neighbour with the widest passage.

    Small basins without a neighbour are no regions. Areas, peaks and the least of both are in cells.
    """
    areas, peaks = basins
    passages, nowhere = _passages(labels, clearance), len(areas)
    into, present = np.arange(nowhere + 1), np.flatnonzero(areas)
    for basin in present[np.argsort(areas[present], kind="stable")].tolist():
        if areas[basin] >= least[0] and peaks[basin] >= least[1]:
            continue
        beside = passages.pop(basin, {})
        into[basin] = target = max(beside, key=lambda one: (beside[one], -one), default=nowhere)
        if target != nowhere:
            areas[target] += areas[basin]
            peaks[target] = max(peaks[target], peaks[basin])
            _give_passages(passages, basin, beside, target)
        areas[basin] = 0
    while (into[into] != into).any():
        into = into[into]
    number = np.full(nowhere + 1, NONE, np.int32)
    number[np.flatnonzero(areas)] = np.arange(np.count_nonzero(areas))
    # The last number is that of cells outside, and of regions that are none.
    return np.asarray(number[into][labels], np.int32)


def _give_passages(passages: dict[int, dict[int, float]], basin: int, beside: dict[int, float], target: int) -> None:
    """Give the passages of a basin that is no more to another one."""
    for other, height in beside.items():
        del passages[other][basin]
        if other != target:
            for one, two in ((other, target), (target, other)):
                passages[one][two] = max(passages[one].get(two, 0.0), height)


def _passages(labels: NDArray[np.int32], clearance: NDArray[np.float32]) -> dict[int, dict[int, float]]:
    """Return of each basin the most clearance where it meets another one."""
    found: dict[int, dict[int, float]] = {}
    met = find_meetings(labels, clearance)
    for (first, second), height in zip(met.regions.tolist(), met.clearance.tolist(), strict=True):
        for one, two in ((first, second), (second, first)):
            beside = found.setdefault(one, {})
            beside[two] = max(beside.get(two, 0.0), height)
    return found
