"""Where robots fit: configuration space, the free space they sweep, and starts drawn in it."""

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.floor import Raster
from lidarium.mapping.kernels import kernel

_TRIES = 200
_RESTARTS = 20
_NO_STARTS = np.zeros((0, 3))


def configuration_space(raster: Raster, radius: float) -> NDArray[np.bool_]:
    """Return where the centre of a disc may be: cells whose centre is no nearer than the radius to any solid cell's square.

    Parameters
    ----------
    raster : Raster
        Solid cells at the body's height.
    radius : float
        Radius of the robot [m].

    Returns
    -------
    (rows, columns) bool
        True where the disc fits. Exact, not an approximation by distances between centres.

    Raises
    ------
    ValueError
        If the radius is negative or not finite.
    """
    reach = _cells_of(raster, radius)
    space = np.zeros(raster.solid.shape, dtype=np.bool_)
    box = _box_of_free_cells(raster)
    if box is None:
        return space
    # The square's nearest point is half a cell nearer than its centre along each axis, except in the same row or column.
    gaps = np.maximum(np.arange(math.ceil(reach) + 2) - 0.5, 0.0)
    near = gaps[:, None] ** 2 + gaps[None, :] ** 2 < reach**2 - 1e-9
    space[box] = ~_dilated(raster.solid[box] != 0, near) & (raster.solid[box] == 0)
    return space


def swept_free_space(raster: Raster, radius: float, starts: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return the free cells that discs can sweep from the starts.

    Parameters
    ----------
    raster : Raster
        Solid cells at the body's height.
    radius : float
        Radius of the robot [m].
    starts : (N, 2 or 3) float64
        Starts x, y (theta is not used) [m].

    Returns
    -------
    (rows, columns) bool
        Free cells whose centre is within the radius of a cell centre of the configuration space, in its 4-connected
        components that hold a start.

    Raises
    ------
    ValueError
        If the robot does not fit at a start (nor at a cell beside it).
    """
    space = configuration_space(raster, radius)
    labels = _labels(space)
    kept = np.unique([_label_near(raster, labels, start, radius) for start in np.asarray(starts, dtype=np.float64)])
    box = _box_of_free_cells(raster)
    swept = np.zeros(space.shape, dtype=np.bool_)
    if box is None or kept.size == 0:
        return swept
    chosen = np.zeros(int(labels.max()) + 1, dtype=np.bool_)
    chosen[kept] = True
    reach = _cells_of(raster, radius)
    steps = np.arange(math.floor(reach + 1e-9) + 2)
    disc = steps[:, None] ** 2 + steps[None, :] ** 2 <= reach**2 + 1e-9
    swept[box] = _dilated(chosen[labels[box]], disc) & (raster.solid[box] == 0)
    return swept


def draw_starts(
    raster: Raster, radius: float, count: int, generator: np.random.Generator, proposed: NDArray[np.float64] = _NO_STARTS
) -> NDArray[np.float64]:
    """Return starts for a team: the first proposed ones that fit, the rest drawn uniformly.

    Drawn starts lie at cell centres of one 4-connected component of the configuration space (with a cell to spare):
    that of the first proposed start that fits, else the largest. They keep two robot diameters, centre to centre, from
    all others.

    Parameters
    ----------
    raster : Raster
        Solid cells at the body's height.
    radius : float
        Radius of the robot [m].
    count : int
        Number of robots, at least 1.
    generator : numpy.random.Generator
        Source of the draws.
    proposed : (K, 3) float64
        Starts x, y, theta that come with the floor [m, rad]. One that is free but too near to a wall for this robot, or
        overlaps a robot on a former one, is passed over.

    Returns
    -------
    (count, 3) float64
        x, y, theta per robot [m, rad].

    Raises
    ------
    ValueError
        If the robot fits nowhere, a proposed start is inside a wall, the proposed starts are disconnected for this
        robot, or more robots are asked for than fit.
    """
    if count < 1:
        raise ValueError(f"number of robots is {count}; want at least 1")
    space = configuration_space(raster, radius + raster.resolution)
    labels = _labels(space)
    if not labels.any():
        raise ValueError(f"a robot of radius {radius} m does not fit anywhere on this floor; want a smaller robot or a larger floor")
    taken = _fitting(raster, labels, radius, count, np.asarray(proposed, dtype=np.float64).reshape(-1, 3))
    component = labels[_cell(raster, taken[0])] if taken else 1 + np.argmax(np.bincount(labels[labels > 0])[1:])
    allowed = labels == component
    best = taken
    for _ in range(_RESTARTS):
        placed = _place(raster, allowed, 4.0 * radius, count, generator, taken)
        if len(placed) == count:
            return np.array(placed)
        best = max(best, placed, key=len)
    raise ValueError(f"{count} robots of radius {radius} m do not fit on this floor two diameters apart; {len(best)} did")


def check_starts(raster: Raster, radius: float, starts: NDArray[np.float64]) -> None:
    """Check starts that a user insists on.

    Parameters
    ----------
    raster : Raster
        Solid cells at the body's height.
    radius : float
        Radius of the robot [m].
    starts : (N, 3) float64
        x, y, theta per robot [m, rad].

    Raises
    ------
    ValueError
        If the robot does not fit at a start, two robots overlap, or a start cannot be reached from the first one.
    """
    labels = _labels(configuration_space(raster, radius))
    first = 0
    for robot, start in enumerate(starts):
        label = _label_near(raster, labels, start, radius)
        if _reaches_into_solid(raster, start, radius):
            raise ValueError(f"start ({start[0]:.3f}, {start[1]:.3f}) m is nearer than the radius of {radius} m to a wall; want more room")
        first = first or label
        if label != first:
            raise ValueError(
                f"starts of robots 0 and {robot} are disconnected for a robot of radius {radius} m; want starts that can reach each other"
            )
        for other in range(robot):
            apart = math.dist(start[:2], starts[other][:2])
            if apart < 2.0 * radius:
                raise ValueError(f"starts of robots {other} and {robot} are {apart:.3f} m apart; want at least {2.0 * radius} m")


def check_goal(raster: Raster, goal: tuple[float, float]) -> None:
    """Check that a goal lies on the floor and outside of all that is solid; whether a robot gets there is for the robot to find out.

    Parameters
    ----------
    raster : Raster
        Solid cells at the body's height.
    goal : (x, y)
        [m]

    Raises
    ------
    ValueError
        If it does not.
    """
    rows, columns = raster.solid.shape
    row = math.floor((goal[1] - raster.origin[1]) / raster.resolution)
    column = math.floor((goal[0] - raster.origin[0]) / raster.resolution)
    if not (0 <= row < rows and 0 <= column < columns):
        (x, y), side = raster.origin, raster.resolution
        raise ValueError(
            f"goal ({goal[0]:.3f}, {goal[1]:.3f}) m is outside of the floor; want x from {x:.3f} to {x + columns * side:.3f} m "
            f"and y from {y:.3f} to {y + rows * side:.3f} m"
        )
    if raster.solid[row, column]:
        raise ValueError(f"goal ({goal[0]:.3f}, {goal[1]:.3f}) m is inside a wall; want one in free space")


def _fitting(
    raster: Raster, labels: NDArray[np.int32], radius: float, count: int, proposed: NDArray[np.float64]
) -> list[NDArray[np.float64]]:
    taken: list[NDArray[np.float64]] = []
    for start in proposed:
        cell = _cell(raster, start)
        if raster.solid[cell]:
            raise ValueError(f"proposed start ({start[0]:.3f}, {start[1]:.3f}) m is inside a wall; want one in free space")
        overlaps = any(math.dist(start[:2], other[:2]) < 2.0 * radius for other in taken)
        if labels[cell] == 0 or overlaps or len(taken) == count:
            continue
        if taken and labels[cell] != labels[_cell(raster, taken[0])]:
            raise ValueError(
                f"proposed starts ({taken[0][0]:.3f}, {taken[0][1]:.3f}) and ({start[0]:.3f}, {start[1]:.3f}) m are disconnected "
                f"for a robot of radius {radius} m; want starts in one room system, or a smaller robot"
            )
        taken.append(start)
    return taken


def _place(
    raster: Raster, allowed: NDArray[np.bool_], apart: float, count: int, generator: np.random.Generator, taken: list[NDArray[np.float64]]
) -> list[NDArray[np.float64]]:
    """Draw positions one after the other until there are enough or no cell is left."""
    placed = list(taken)
    left = allowed
    row_ends = np.cumsum(left.sum(axis=1))
    misses = 0
    while len(placed) < count and row_ends[-1] > 0:
        i, j = _nth_cell(left, row_ends, int(generator.integers(row_ends[-1])))
        x = raster.origin[0] + (j + 0.5) * raster.resolution
        y = raster.origin[1] + (i + 0.5) * raster.resolution
        if all(math.dist((x, y), other[:2]) >= apart - 1e-9 for other in placed):
            placed.append(np.array([x, y, generator.uniform(-math.pi, math.pi)]))
            misses = 0
            continue
        misses += 1
        if misses >= _TRIES:
            # Few cells are left: take those too near to a robot out, so that a miss cannot happen again.
            left = _without_discs(raster, left, placed, apart)
            row_ends = np.cumsum(left.sum(axis=1))
            misses = 0
    return placed


def _without_discs(raster: Raster, allowed: NDArray[np.bool_], placed: list[NDArray[np.float64]], apart: float) -> NDArray[np.bool_]:
    left = allowed.copy()
    reach = math.ceil(apart / raster.resolution) + 1
    for x, y, _ in placed:
        i, j = _cell(raster, np.array([x, y]))
        rows, columns = (
            np.arange(max(i - reach, 0), min(i + reach + 1, left.shape[0])),
            np.arange(max(j - reach, 0), min(j + reach + 1, left.shape[1])),
        )
        dy = raster.origin[1] + (rows + 0.5) * raster.resolution - y
        dx = raster.origin[0] + (columns + 0.5) * raster.resolution - x
        left[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1] &= np.hypot(dx[None, :], dy[:, None]) >= apart - 1e-9
    return left


def _nth_cell(mask: NDArray[np.bool_], row_ends: NDArray[np.int64], n: int) -> tuple[int, int]:
    i = int(np.searchsorted(row_ends, n, side="right"))
    before = int(row_ends[i - 1]) if i else 0
    return i, int(np.flatnonzero(mask[i])[n - before])


def _cells_of(raster: Raster, radius: float) -> float:
    if not (math.isfinite(radius) and radius >= 0.0):
        raise ValueError(f"radius is {radius} m; want zero or more")
    return radius / raster.resolution


def _cell(raster: Raster, point: NDArray[np.float64]) -> tuple[int, int]:
    """Return the cell (row, column) of a point, or the nearest one of the raster, which is solid."""
    column, row = ((point[axis] - raster.origin[axis]) / raster.resolution for axis in (0, 1))
    rows, columns = raster.solid.shape
    return min(max(math.floor(row + 1e-9), 0), rows - 1), min(max(math.floor(column + 1e-9), 0), columns - 1)


def _label_near(raster: Raster, labels: NDArray[np.int32], start: NDArray[np.float64], radius: float) -> int:
    """Return the component at a start, or at the nearest cell beside it where rounding to cells puts the start outside."""
    i, j = _cell(raster, start)
    if raster.solid[i, j]:
        raise ValueError(f"start ({start[0]:.3f}, {start[1]:.3f}) m is inside a wall; want one in free space")
    for near in sorted(((i + di, j + dj) for di in (-1, 0, 1) for dj in (-1, 0, 1)), key=lambda cell: abs(cell[0] - i) + abs(cell[1] - j)):
        if labels[near]:
            return int(labels[near])
    raise ValueError(f"a robot of radius {radius} m does not fit at start ({start[0]:.3f}, {start[1]:.3f}) m; want more room")


def _reaches_into_solid(raster: Raster, start: NDArray[np.float64], radius: float) -> bool:
    """Whether the disc at a start, exactly there and not at a cell's centre, enters a solid cell."""
    reach = math.ceil(radius / raster.resolution) + 1
    i, j = _cell(raster, start)
    rows, columns = np.nonzero(raster.solid[max(i - reach, 0) : i + reach + 1, max(j - reach, 0) : j + reach + 1])
    low_x = raster.origin[0] + (columns + max(j - reach, 0)) * raster.resolution
    low_y = raster.origin[1] + (rows + max(i - reach, 0)) * raster.resolution
    gap_x = start[0] - np.clip(start[0], low_x, low_x + raster.resolution)
    gap_y = start[1] - np.clip(start[1], low_y, low_y + raster.resolution)
    return bool((np.hypot(gap_x, gap_y) < radius - 1e-6).any())


def _labels(space: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Return the number of the 4-connected component of each cell, from 1; 0 elsewhere."""
    _, labels = cv2.connectedComponents(space.view(np.uint8), connectivity=4, ltype=cv2.CV_32S)
    return np.asarray(labels, dtype=np.int32)


def _box_of_free_cells(raster: Raster) -> tuple[slice, slice] | None:
    """Return the rows and columns with free cells and one solid ring around them."""
    free = raster.solid == 0
    rows, columns = np.flatnonzero(free.any(axis=1)), np.flatnonzero(free.any(axis=0))
    if rows.size == 0:
        return None
    return slice(max(rows[0] - 1, 0), rows[-1] + 2), slice(max(columns[0] - 1, 0), columns[-1] + 2)


def _dilated(mask: NDArray[np.bool_], shape: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Dilate by a shape that is symmetric about both axes, given as its quadrant ``shape[|di|, |dj|]``."""
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
    # Distance along the row to the nearest set cell, for the rows that the shape reaches at once: memory stays in the cache.
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
