"""Starts of robots: drawn in the free space of a floor, or checked.

Starts that a user names are checked.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.floor import Raster
from lidarium.envs.floors.free_space import cell_of, component_near, components

_TRIES = 200
_RESTARTS = 20
_NO_STARTS = np.zeros((0, 3))


def draw_starts(
    raster: Raster,
    radius: float,
    count: int,
    generator: np.random.Generator,
    proposed: NDArray[np.float64] = _NO_STARTS,
) -> NDArray[np.float64]:
    """Return starts for a team.

    The first proposed ones that fit are taken; the rest are drawn uniformly.

    Drawn starts lie at cell centres of one 4-connected component of the configuration space (with a cell to spare):
    that of the first proposed start that fits, else the largest. They keep two robot diameters, centre to centre,
    from all others.

    Parameters
    ----------
    radius : float
        Radius of the robot [m].
    proposed : (K, 3) float64
        Starts x, y, theta of the floor [m, rad]. One too near to a wall or a former one is passed over.

    Returns
    -------
    (count, 3) float64
        x, y, theta per robot [m, rad].
    """
    if count < 1:
        raise ValueError(f"number of robots is {count}; want at least 1")
    found = components(raster, radius + raster.resolution)
    labels = found.labels
    if found.areas.size == 1:
        raise ValueError(
            f"a robot of radius {radius} m does not fit anywhere on this floor; want a smaller robot or a larger floor"
        )
    taken = _fitting(raster, labels, radius, count, np.asarray(proposed, dtype=np.float64).reshape(-1, 3))
    component = labels[cell_of(raster, taken[0])] if taken else 1 + int(np.argmax(found.areas[1:]))
    allowed = labels == component
    best = taken
    for _ in range(_RESTARTS):
        placed = _place(raster, allowed, 4.0 * radius, count, generator, taken)
        if len(placed) == count:
            return np.array(placed)
        best = max(best, placed, key=len)
    raise ValueError(
        f"{count} robots of radius {radius} m do not fit on this floor two diameters apart; {len(best)} did"
    )


def check_starts(raster: Raster, radius: float, starts: NDArray[np.float64]) -> None:
    """Check starts that a user insists on.

    Parameters
    ----------
    radius : float
        Radius of the robot [m].
    starts : (N, 3) float64
        x, y, theta per robot [m, rad].
    """
    labels = components(raster, radius).labels
    first = 0
    for robot, start in enumerate(starts):
        label = component_near(raster, labels, start, radius)
        if _reaches_into_solid(raster, start, radius):
            raise ValueError(
                f"start ({start[0]:.3f}, {start[1]:.3f}) m is nearer than the radius of {radius} m to a "
                "wall; want more room"
            )
        first = first or label
        if label != first:
            raise ValueError(
                f"starts of robots 0 and {robot} are disconnected for a robot of radius {radius} m; want "
                "starts that can reach each other"
            )
        for other in range(robot):
            apart = math.dist(start[:2], starts[other][:2])
            if apart < 2.0 * radius:
                raise ValueError(
                    f"starts of robots {other} and {robot} are {apart:.3f} m apart; want at least {2.0 * radius} m"
                )


def check_goal(raster: Raster, goal: tuple[float, float]) -> None:
    """Check that a goal lies on the floor and outside of all that is solid.

    Whether a robot gets there is for the robot to find out.

    Parameters
    ----------
    goal : (x, y)
        [m]
    """
    rows, columns = raster.solid.shape
    row = math.floor((goal[1] - raster.origin[1]) / raster.resolution)
    column = math.floor((goal[0] - raster.origin[0]) / raster.resolution)
    if not (0 <= row < rows and 0 <= column < columns):
        (x, y), side = raster.origin, raster.resolution
        raise ValueError(
            f"goal ({goal[0]:.3f}, {goal[1]:.3f}) m is outside of the floor; want x from {x:.3f} to "
            f"{x + columns * side:.3f} m "
            f"and y from {y:.3f} to {y + rows * side:.3f} m"
        )
    if raster.solid[row, column]:
        raise ValueError(f"goal ({goal[0]:.3f}, {goal[1]:.3f}) m is inside a wall; want one in free space")


def _fitting(
    raster: Raster,
    labels: NDArray[np.unsignedinteger[Any]],
    radius: float,
    count: int,
    proposed: NDArray[np.float64],
) -> list[NDArray[np.float64]]:
    taken: list[NDArray[np.float64]] = []
    for start in proposed:
        cell = cell_of(raster, start)
        if raster.solid[cell]:
            raise ValueError(
                f"proposed start ({start[0]:.3f}, {start[1]:.3f}) m is inside a wall; want one in free space"
            )
        overlaps = any(math.dist(start[:2], other[:2]) < 2.0 * radius for other in taken)
        if labels[cell] == 0 or overlaps or len(taken) == count:
            continue
        if taken and labels[cell] != labels[cell_of(raster, taken[0])]:
            raise ValueError(
                f"proposed starts ({taken[0][0]:.3f}, {taken[0][1]:.3f}) and ({start[0]:.3f}, "
                f"{start[1]:.3f}) m are disconnected "
                f"for a robot of radius {radius} m; want starts in one room system, or a smaller robot"
            )
        taken.append(start)
    return taken


def _place(
    raster: Raster,
    allowed: NDArray[np.bool_],
    apart: float,
    count: int,
    generator: np.random.Generator,
    taken: list[NDArray[np.float64]],
) -> list[NDArray[np.float64]]:
    """Draw positions one after the other until there are enough or no cell is left."""
    placed = list(taken)
    left = allowed
    row_ends = np.cumsum(np.count_nonzero(left, axis=1))
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
            row_ends = np.cumsum(np.count_nonzero(left, axis=1))
            misses = 0
    return placed


def _without_discs(
    raster: Raster, allowed: NDArray[np.bool_], placed: list[NDArray[np.float64]], apart: float
) -> NDArray[np.bool_]:
    left = allowed.copy()
    reach = math.ceil(apart / raster.resolution) + 1
    for x, y, _ in placed:
        i, j = cell_of(raster, np.array([x, y]))
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


def _reaches_into_solid(raster: Raster, start: NDArray[np.float64], radius: float) -> bool:
    """Whether the disc at a start enters a solid cell.

    The disc is exactly at the start, not at a cell's centre.
    """
    reach = math.ceil(radius / raster.resolution) + 1
    i, j = cell_of(raster, start)
    rows, columns = np.nonzero(raster.solid[max(i - reach, 0) : i + reach + 1, max(j - reach, 0) : j + reach + 1])
    low_x = raster.origin[0] + (columns + max(j - reach, 0)) * raster.resolution
    low_y = raster.origin[1] + (rows + max(i - reach, 0)) * raster.resolution
    gap_x = start[0] - np.clip(start[0], low_x, low_x + raster.resolution)
    gap_y = start[1] - np.clip(start[1], low_y, low_y + raster.resolution)
    return bool((np.hypot(gap_x, gap_y) < radius - 1e-6).any())
