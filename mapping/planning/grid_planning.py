"""Paths over a belief for a round body: reachable cells, their costs, and the cheapest paths.

A body of radius r may stand in a known free cell whose clearance is at least r, and a path of such cells,
joined by straight and diagonal steps, keeps that clearance throughout. Steps near walls cost more, so that
paths keep off walls if there is space and still pass through gaps that just fit the body.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.planning.clearance import ClearanceField
from lidarium.mapping.planning.footprint import Footprint, passage_of
from lidarium.mapping.planning.search.path_search import Search, SearchSpace, budget_of, find_path, search_at
from lidarium.mapping.planning.search.search_state import (
    COLUMN_BITS,
    ROW_SHIFT,
    STRAIGHT,
    Lookout,
    Targets,
    Task,
    Terrain,
)

Cell = tuple[int, int]
Disc = tuple[float, float, float]


def cells_of(points: NDArray[np.float64], origin: tuple[float, float], resolution: float) -> NDArray[np.int64]:
    """Return the cells (row, column) of points (..., 2) given as (x, y) [m], not clipped to any grid."""
    steps = (np.asarray(points, dtype=np.float64) - np.asarray(origin)) / resolution
    cells: NDArray[np.int64] = np.floor(steps[..., ::-1]).astype(np.int64)
    return cells


def centres_of(cells: NDArray[np.integer], origin: tuple[float, float], resolution: float) -> NDArray[np.float64]:
    """Return the centres (..., 2) as (x, y) [m] of cells (row, column)."""
    centres: NDArray[np.float64] = (np.asarray(cells, dtype=np.float64)[..., ::-1] + 0.5) * resolution + np.asarray(
        origin
    )
    return centres


@dataclass(frozen=True, slots=True, kw_only=True)
class Until:
    """Conditions that end a search; by default it ends when all reachable cells are reached.

    Attributes
    ----------
    goal : (row, column), optional
        Stop when this cell is settled.
    targets : Targets, optional
        Stop when ``count`` cells are settled from which a target is in reach and sight.
    count : int
        Number of such cells.
    beyond : float
        After the targets are found, continue until all costs up to the largest of theirs plus this are final
        [m]; at least 0.
    maximum_cost : float
        Stop at this cost [m].
    """

    goal: Cell | None = None
    targets: Targets | None = None
    count: int = 1
    beyond: float = 0.0
    maximum_cost: float = math.inf

    def __post_init__(self) -> None:
        if not self.beyond >= 0.0:
            raise ValueError(f"beyond is {self.beyond} m; want 0 or more")


ALL_REACHED = Until()
"""A search without an end condition."""


def search(
    space: SearchSpace,
    log_odds: NDArray[np.int8],
    clearance: ClearanceField,
    start: Cell,
    footprint: Footprint,
    *,
    until: Until = ALL_REACHED,
    blocked: Iterable[Disc] = (),
) -> Search:
    """Spread costs from a cell over all cells that a body can reach, until an end condition is met.

    Raises ValueError if shapes differ, the belief is no C-contiguous int8, a cell lies outside the grid, or the
    footprint needs more clearance than the field's maximum.

    Parameters
    ----------
    log_odds : (rows, columns) int8
        The belief, C-contiguous: < 0 free, 0 unknown, > 0 occupied. Only known free cells are entered.
    start : (row, column)
        Cell of the body. If it is too near to a wall or inside a blocked disc, the body may leave along
        cells that are no nearer; such cells are part of paths but count as not reached.
    blocked : iterable of (row, column, radius)
        Discs in cells (see :func:`discs_of`), such as teammates with both radii added, that the body's
        centre may not enter.
    """
    _check_search(space, log_odds, clearance, start, until.goal)
    passage = passage_of(footprint, space.resolution, clearance.limit)
    space.provide(passage.slots)
    first, task = (int(start[0]), int(start[1])), _task_of(start, until, space.resolution)
    lookout, discs = _lookout_for(until.targets, space.hits), _discs_array(blocked)
    space.forget()
    space.touched_count, hit_count, settled = search_at(
        log_odds.ctypes.data, clearance.closeness, passage, space.memory, discs, task, lookout
    )
    return Search(space, first, task.budget, settled, _nearest_hits(space, hit_count)[: until.count], space.generation)


def _task_of(start: Cell, until: Until, resolution: float) -> Task:
    """Return the start and the end conditions of a search as kernels take them."""
    budget = int(budget_of(float(until.maximum_cost), resolution))
    further = int(budget_of(float(until.beyond), resolution)) if until.beyond > 0.0 else 0
    goal_row, goal_column = (-1, -1) if until.goal is None else (int(until.goal[0]), int(until.goal[1]))
    wanted = 0 if until.targets is None else int(until.count)
    return Task(int(start[0]), int(start[1]), goal_row, goal_column, budget, False, wanted, further)


def _lookout_for(targets: Targets | None, hits: NDArray[np.int32]) -> Lookout:
    """Return the targets of a search as kernels take them; empty arrays for None."""
    if targets is None:
        return Lookout(_NO_MASK, _NO_MASK, np.zeros(1, np.int64), hits)
    return Lookout(targets.mask, targets.near, targets.spans.copy(), hits)


def _nearest_hits(space: SearchSpace, count: int) -> NDArray[np.int64]:
    """Return the first ``count`` cells (row, column) that a search has hit, the cheapest first."""
    packed = space.hits[:count].astype(np.int64)
    rows, columns = packed >> ROW_SHIFT, packed & COLUMN_BITS
    order = np.lexsort((columns, rows, -space.remaining[rows, columns].astype(np.int64)))
    return np.stack((rows[order], columns[order]), axis=1)


def plan(
    space: SearchSpace,
    log_odds: NDArray[np.int8],
    clearance: ClearanceField,
    start: Cell,
    goal: Cell,
    footprint: Footprint,
    *,
    maximum_cost: float = math.inf,
    blocked: Iterable[Disc] = (),
) -> tuple[float, NDArray[np.int64]] | None:
    """Return the cheapest path to one cell, by A* with the octile distance (Hart, Nilsson, Raphael 1968).

    Parameters are those of :func:`search` and :class:`Until`, and so is the cost. Returns the cost [m] and the
    cells (N, 2) int64 from start to goal, or None if there is no path.
    """
    _check_search(space, log_odds, clearance, start, goal)
    passage = passage_of(footprint, space.resolution, clearance.limit)
    space.provide(passage.slots)
    space.forget()
    cost, cells = find_path(
        Terrain(log_odds, clearance.closeness, passage, _discs_array(blocked)),
        space.memory,
        (int(start[0]), int(start[1])),
        (int(goal[0]), int(goal[1])),
        budget_of(float(maximum_cost), space.resolution),
    )
    return None if cost < 0 else (cost * (space.resolution / STRAIGHT), cells)


def discs_of(discs: Iterable[Disc], origin: tuple[float, float], resolution: float) -> list[Disc]:
    """Return discs (x, y, radius) [m] as (row, column, radius) in cells, from the centre of cell (0, 0)."""
    return [
        ((y - origin[1]) / resolution - 0.5, (x - origin[0]) / resolution - 0.5, radius / resolution)
        for x, y, radius in discs
    ]


_NO_MASK = np.zeros((1, 1), dtype=np.uint8)


def _check_search(
    space: SearchSpace, log_odds: NDArray[np.int8], clearance: ClearanceField, start: Cell, goal: Cell | None
) -> None:
    for name, shape in (("log_odds", log_odds.shape), ("clearance", clearance.closeness.shape)):
        if shape != space.shape:
            raise ValueError(f"{name} has shape {shape}; this space was made for {space.shape}")
    if log_odds.dtype != np.int8 or not log_odds.flags.c_contiguous:
        raise ValueError(f"log_odds is of {log_odds.dtype}, strides {log_odds.strides}; want C-contiguous int8")
    for name, cell in (("start", start), ("goal", start if goal is None else goal)):
        if not (0 <= cell[0] < space.shape[0] and 0 <= cell[1] < space.shape[1]):
            raise ValueError(f"{name} {(int(cell[0]), int(cell[1]))} lies outside the grid of {space.shape} cells")


def _discs_array(discs: Iterable[Disc]) -> NDArray[np.float64]:
    return np.array(list(discs), dtype=np.float64).reshape(-1, 3)
