"""Free space of a floor: components that a body can reach, and measures of buildings."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.floor import Floor, Raster
from lidarium.envs.floors.raster import Runs
from lidarium.mapping.kernels.compilation import kernel

KEPT = 8
"""Maximum number of entries that a raster keeps.

It keeps components for radii, and the footprints covered from some of them.
"""


@dataclass(frozen=True, slots=True, eq=False)
class _Components:
    """The 4-connected components of the configuration space of a disc.

    Attributes
    ----------
    labels : (rows, columns) uint8, uint16 or uint32
        Number of the component of each cell, from 1; 0 if the disc does not fit.
    areas : (components + 1,) int64
        Cells of each component, and in front those of none.
    """

    labels: NDArray[np.unsignedinteger[Any]]
    areas: NDArray[np.int64]


def configuration_space(raster: Raster, radius: float) -> NDArray[np.bool_]:
    """Return the free positions of the centre of a disc.

    It is cells whose centre is no nearer than the radius to any solid cell's square.

    Parameters
    ----------
    radius : float
        Radius of the robot [m].

    Returns
    -------
    (rows, columns) bool
        True if the disc fits. Exact, not an approximation by distances between centres.
    """
    reach = _cells_of(raster, radius)
    space = np.zeros(raster.solid.shape, dtype=np.bool_)
    box = _box_of_free_cells(raster)
    if box is None:
        return space
    # The square's nearest point is half a cell nearer than its centre along each axis, except in the same row
    # or column.
    gaps = np.maximum(np.arange(math.ceil(reach) + 2) - 0.5, 0.0)
    near = gaps[:, None] ** 2 + gaps[None, :] ** 2 < reach**2 - 1e-9
    space[box] = ~_dilated(raster.solid[box] != 0, near) & (raster.solid[box] == 0)
    return space


def components(raster: Raster, radius: float) -> _Components:
    """Return the components of the configuration space of a disc, read-only.

    The disc has a radius [m]; ``ValueError`` is raised as by ``configuration_space``.
    """

    def make() -> NDArray[np.unsignedinteger[Any]]:
        space = configuration_space(raster, radius)
        count, labels = cv2.connectedComponents(space.view(np.uint8), connectivity=4, ltype=cv2.CV_32S)
        return np.asarray(labels, np.min_scalar_type(count - 1))

    runs = _kept(raster, ("components", radius), make)
    return _Components(runs.grid(), _frozen(runs.counts()))


def reachable_free_space(raster: Raster, radius: float, starts: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return the free cells that discs can sweep from the starts.

    Parameters
    ----------
    radius : float
        Radius of the robot [m].
    starts : (N, 2 or 3) float64
        Starts x, y (theta is not used) [m].

    Returns
    -------
    (rows, columns) bool
        Free cells whose centre is within the radius of a cell centre of the configuration space, in its
        4-connected components that hold a start; within so many whole cells that a disc at a straight wall reaches
        the last free cell before it, if that is more. Read-only.
    """
    found = components(raster, radius)
    kept = sorted(
        {component_near(raster, found.labels, start, radius) for start in np.asarray(starts, dtype=np.float64)}
    )

    def make() -> NDArray[np.bool_]:
        box = _box_of_free_cells(raster)
        covered = np.zeros(found.labels.shape, dtype=np.bool_)
        if box is not None and kept:
            chosen = np.zeros(found.areas.size, dtype=np.bool_)
            chosen[kept] = True
            reach = _cells_of(raster, radius)
            # Centres next to a straight wall are rounded away from it: they are ceil(reach + 1/2) cells from it.
            reach = max(reach, math.ceil(reach + 0.5 - 1e-9) - 1.0)
            steps = np.arange(math.floor(reach + 1e-9) + 2)
            disc = steps[:, None] ** 2 + steps[None, :] ** 2 <= reach**2 + 1e-9
            covered[box] = _dilated(chosen[found.labels[box]], disc) & (raster.solid[box] == 0)
        return covered

    return _kept(raster, ("swept", radius, *kept), make).grid()


def cell_of(raster: Raster, point: NDArray[np.float64]) -> tuple[int, int]:
    """Return the cell (row, column) of a point, or the nearest of the raster.

    The nearest one is solid.
    """
    column, row = ((point[axis] - raster.origin[axis]) / raster.resolution for axis in (0, 1))
    rows, columns = raster.solid.shape
    return min(max(math.floor(row + 1e-9), 0), rows - 1), min(max(math.floor(column + 1e-9), 0), columns - 1)


def component_near(
    raster: Raster, labels: NDArray[np.unsignedinteger[Any]], start: NDArray[np.float64], radius: float
) -> int:
    """Return the component at a start, or at the nearest cell.

    The nearest cell is used if rounding to cells puts the start outside.
    """
    i, j = cell_of(raster, start)
    if raster.solid[i, j]:
        raise ValueError(f"start ({start[0]:.3f}, {start[1]:.3f}) m is inside a wall; want one in free space")
    for near in sorted(
        ((i + di, j + dj) for di in (-1, 0, 1) for dj in (-1, 0, 1)),
        key=lambda cell: abs(cell[0] - i) + abs(cell[1] - j),
    ):
        if labels[near]:
            return int(labels[near])
    raise ValueError(
        f"a robot of radius {radius} m does not fit at start ({start[0]:.3f}, {start[1]:.3f}) m; want more room"
    )


def _cells_of(raster: Raster, radius: float) -> float:
    if not (math.isfinite(radius) and radius >= 0.0):
        raise ValueError(f"radius is {radius} m; want zero or more")
    return radius / raster.resolution


def _frozen(array: NDArray[Any]) -> NDArray[Any]:
    array.flags.writeable = False
    return array


def _kept(raster: Raster, key: tuple[Any, ...], make: Callable[[], NDArray[Any]]) -> Runs:
    """Return the kept result of a raster, or make it.

    A raster that can be written to keeps nothing.
    """
    if raster.solid.flags.writeable:
        return Runs.of(make())
    kept: Runs | None = raster.kept.get(key)
    if kept is None:
        kept = raster.kept[key] = Runs.of(make())
        while len(raster.kept) > KEPT:
            raster.kept.pop(next(iter(raster.kept)))
    return kept


def _box_of_free_cells(raster: Raster) -> tuple[slice, slice] | None:
    """Return the rows and columns with free cells and one solid ring around them."""
    free = raster.solid == 0
    rows, columns = np.flatnonzero(free.any(axis=1)), np.flatnonzero(free.any(axis=0))
    if rows.size == 0:
        return None
    return slice(max(rows[0] - 1, 0), rows[-1] + 2), slice(max(columns[0] - 1, 0), columns[-1] + 2)


def _dilated(mask: NDArray[np.bool_], shape: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Dilate by a shape that is symmetric about both axes.

    The shape is given as its quadrant ``shape[|di|, |dj|]``.
    """
    widths = shape.sum(axis=1).astype(np.int64) - 1
    widths = widths[widths >= 0]
    if widths.size == 0:
        return np.zeros_like(mask)
    result = np.empty_like(mask)
    _dilate_rows(mask, widths, result)
    return result


@kernel
def _dilate_rows(mask: NDArray[np.bool_], widths: NDArray[np.int64], result: NDArray[np.bool_]) -> None:
    rows, columns = mask.shape
    reach = len(widths) - 1
    far = np.uint16(widths.max() + 1)
    # Distance along the row to the nearest set cell, for the rows that the shape reaches at once: memory
    # stays in the cache.
    distances = np.full((2 * reach + 1, columns), far, np.uint16)
    for i in range(-reach, rows):
        ahead = i + reach
        slot = ahead % (2 * reach + 1)
        if ahead < rows:
            distance = far
            for j in range(columns):
                distance = np.uint16(0) if mask[ahead, j] else min(np.uint16(distance + 1), far)
                distances[slot, j] = distance
            distance = far
            for j in range(columns - 1, -1, -1):
                distance = np.uint16(0) if mask[ahead, j] else min(np.uint16(distance + 1), far)
                distances[slot, j] = min(distances[slot, j], distance)
        else:
            distances[slot, :] = far
        if i < 0:
            continue
        result[i, :] = False
        for di in range(-reach, reach + 1):
            row = distances[(i + di) % (2 * reach + 1)]
            width = np.uint16(widths[abs(di)])
            if i + di >= 0:
                for j in range(columns):
                    result[i, j] |= row[j] <= width


MEASURED_RADIUS = 0.30
"""Radius of the robot whose loops are counted [m]."""

HALF_DOOR = 0.55
"""Half the widest opening that separates two rooms [m]."""

_RESOLUTION = 0.05
_BODY_HEIGHT = 2.0


@dataclass(frozen=True, slots=True)
class _BuildingMeasures:
    """Figures of a building.

    Attributes
    ----------
    area_m2 : float
        Free floor area, neither under walls nor under furniture [m²].
    loops : int
        Independent cycles on which a robot of radius 0.30 m can drive around walls; furniture is not counted.
    clutter : float
        Share of the area between the walls that is under furniture; see ``Floor.is_wall``.
    rooms : int
        Spaces that openings up to 1.1 m wide separate, halls and corridors included.
    left_out_m2 : (n,) float64
        Free areas that a robot of radius 0.30 m cannot reach from the largest one [m²].
    whole_m2 : float
        Free area with those [m²].
    """

    area_m2: float
    loops: int
    clutter: float
    rooms: int
    left_out_m2: NDArray[np.float64]
    whole_m2: float


def measure_building(floor: Floor) -> _BuildingMeasures:
    """Measure a floor at a resolution of 0.05 m."""
    walls = floor
    if floor.solids:
        walls = Floor(floor.name, floor.bounds, tuple(filter(floor.is_wall, floor.solids)))
    empty = walls.raster(_RESOLUTION, 0.0, _BODY_HEIGHT)
    full = floor.raster(_RESOLUTION, 0.0, _BODY_HEIGHT)
    space = configuration_space(empty, MEASURED_RADIUS)
    if not space.any():
        raise ValueError(f"floor {floor.name!r} has no room for a robot of radius {MEASURED_RADIUS} m")
    largest = _largest_part(space)
    inside = _containing(empty.solid == 0, largest)
    wide = cv2.distanceTransform(1 - empty.solid, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) * _RESOLUTION > HALF_DOOR
    between_walls = int(inside.sum())
    free = int((inside & (full.solid == 0)).sum())
    return _BuildingMeasures(
        area_m2=round(free * _RESOLUTION**2, 3),
        loops=_holes(largest),
        clutter=round(1.0 - free / between_walls, 4),
        rooms=cv2.connectedComponents((wide & inside).astype(np.uint8), connectivity=4)[0] - 1,
        left_out_m2=_unreached(full),
        whole_m2=float(np.count_nonzero(full.solid == 0)) * _RESOLUTION**2,
    )


def measure_reach(floor: Floor, place: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Return the free areas that a robot of radius 0.30 m cannot reach from a place, (n,), and the whole one [m2]."""
    full = floor.raster(_RESOLUTION, 0.0, _BODY_HEIGHT)
    return _unreached(full, place), float(np.count_nonzero(full.solid == 0)) * _RESOLUTION**2


def _unreached(raster: Raster, place: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
    """Return the free areas behind walls or openings that are too narrow, (n,) [m2].

    They are those seen from the area of a place, or from the largest one. Corners and gaps that a disc does not fit
    into belong to the area around them.
    """
    space = configuration_space(raster, MEASURED_RADIUS)
    if not space.any():
        return np.zeros(0)
    free, largest = raster.solid == 0, _largest_part(space)
    if place is not None:
        column, row = np.floor((np.asarray(place)[:2] - raster.origin) / raster.resolution).astype(np.int64)
        # A robot that is smaller stands where the disc does not fit: the largest area counts.
        if space[row, column]:
            _, parts = cv2.connectedComponents(space.astype(np.uint8), connectivity=4)
            largest = parts == parts[row, column]
    reach = MEASURED_RADIUS / raster.resolution + 1.0
    near, near_others = (
        cv2.distanceTransform((~part).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE) <= reach
        for part in (largest, space & ~largest)
    )
    left = free & ~near & (near_others | ~_containing(free, largest))
    stats = cv2.connectedComponentsWithStats(left.astype(np.uint8), connectivity=4)[2]
    return np.asarray(stats[1:, cv2.CC_STAT_AREA] * raster.resolution**2)


def _largest_part(cells: NDArray[np.bool_]) -> NDArray[np.bool_]:
    _, parts, stats, _ = cv2.connectedComponentsWithStats(cells.astype(np.uint8), connectivity=4)
    return np.asarray(parts == 1 + np.argmax(stats[1:, cv2.CC_STAT_AREA]))


def _containing(cells: NDArray[np.bool_], part: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the connected part of `cells` that holds `part`."""
    _, parts = cv2.connectedComponents(cells.astype(np.uint8), connectivity=4)
    return np.asarray(parts == parts[part][0])


def _holes(part: NDArray[np.bool_]) -> int:
    """Holes of a connected part of the plane: its independent cycles."""
    framed = np.pad(~part, 1, constant_values=True)
    return int(cv2.connectedComponents(framed.astype(np.uint8), connectivity=8)[0]) - 2
