"""Paths over a belief for a round body: where it can go, at what cost, and how.

A body of radius r may stand in a known free cell whose clearance is at least r, and a path of such cells,
joined by straight and diagonal steps, keeps that clearance all along. Steps near walls cost more, so that
paths keep off walls where there is room and still pass where the body just fits.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.planning import grid_search
from lidarium.mapping.planning.clearance import ClearanceField, limit_of
from lidarium.mapping.planning.path_search import Lookout, Passage, budget_of, find_path, search_at
from lidarium.mapping.planning.search_targets import Targets

Cell = tuple[int, int]
Disc = tuple[float, float, float]


def cells_of(
    points: NDArray[np.float64], origin: tuple[float, float], resolution: float
) -> NDArray[np.int64]:
    """Cells (row, column) that hold points (..., 2) given as (x, y) [m].

    Not clipped to any grid.
    """
    steps = (np.asarray(points, dtype=np.float64) - np.asarray(origin)) / resolution
    cells: NDArray[np.int64] = np.floor(steps[..., ::-1]).astype(np.int64)
    return cells


def centres_of(
    cells: NDArray[np.integer], origin: tuple[float, float], resolution: float
) -> NDArray[np.float64]:
    """Centres (..., 2) as (x, y) [m] of cells (row, column)."""
    centres: NDArray[np.float64] = (
        np.asarray(cells, dtype=np.float64)[..., ::-1] + 0.5
    ) * resolution + np.asarray(origin)
    return centres


@dataclass(frozen=True, slots=True)
class Footprint:
    """How a round body wants to pass.

    Attributes
    ----------
    radius : float
        Least clearance [m].
    preferred : float
        Clearance [m] from which on a step costs no more than on open floor.
    penalty : float
        By how many times its length a step at the least clearance costs more; falls off with the square
        towards ``preferred``.

    Raises
    ------
    ValueError
        If ``radius`` is negative, ``preferred`` below it, or ``penalty`` outside [0, 1000].
    """

    radius: float = 0.18
    preferred: float = 0.33
    penalty: float = 3.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.radius <= self.preferred:
            raise ValueError(
                f"radius is {self.radius} m and preferred clearance {self.preferred} m; want 0 <= radius <= "
                "preferred"
            )
        if not 0.0 <= self.penalty <= 1000.0:
            raise ValueError(f"penalty is {self.penalty}; want 0 to 1000 times the length of a step")


@lru_cache(maxsize=64)
def passage_of(footprint: Footprint, resolution: float, limit: int) -> Passage:
    """Return how a body passes over a grid of cells of ``resolution`` [m].

    The grid's clearance field has this ``limit``.

    Raises
    ------
    ValueError
        If the footprint needs more clearance than the field knows.
    """
    least = limit_of(footprint.radius, resolution)
    if limit_of(footprint.preferred, resolution) > limit:
        raise ValueError(
            f"preferred clearance {footprint.preferred} m is beyond the largest one that the clearance field "
            "knows"
        )
    squared = limit - np.arange(limit + 1)
    clearance = np.sqrt(squared) * 0.5 * resolution
    room = max(footprint.preferred - footprint.radius, 1e-9)
    shortfall = np.clip((footprint.preferred - clearance) / room, 0.0, 1.0)
    factors = 1.0 + footprint.penalty * shortfall**2
    costs = np.rint(np.array([[grid_search.STRAIGHT / 2], [grid_search.DIAGONAL / 2]]) * factors).astype(
        np.int32
    )
    costs[:, squared < max(least, 1)] = 0
    costs.flags.writeable = False
    return Passage(
        limit, costs, limit - least - 2, footprint.radius / resolution, footprint.preferred / resolution
    )


class SearchSpace:
    """Scratch memory of the searches over one grid.

    Each search forgets the one before.

    Parameters
    ----------
    shape : (rows, columns)
        Of the belief; at most 32,767 cells a side.
    resolution : float
        Side of a cell [m].
    """

    def __init__(self, shape: tuple[int, int], resolution: float) -> None:
        if not (0 < shape[0] < 2**15 and 0 < shape[1] < 2**15):
            raise ValueError(f"shape is {tuple(shape)}; want 1 to 32767 cells a side")
        if not resolution > 0.0:
            raise ValueError(f"resolution is {resolution} m; want a positive side of a cell")
        cells = shape[0] * shape[1]
        self.resolution = float(resolution)
        self.shape = (int(shape[0]), int(shape[1]))
        self.remaining: NDArray[np.int32] = np.zeros(shape, dtype=np.int32)
        self.parent: NDArray[np.uint8] = np.empty(shape, dtype=np.uint8)
        self.touched: NDArray[np.int32] = np.empty(cells + 8, dtype=np.int32)
        self.hits: NDArray[np.int32] = np.empty(cells + 8, dtype=np.int32)
        self.buckets: NDArray[np.int32] = np.empty((16, 4096), dtype=np.int32)
        self.touched_count = 0
        self.generation = 0

    def forget(self) -> None:
        """Clear what the last search left; its :class:`Search` can no longer be read."""
        grid_search.clear(self.remaining, self.touched, self.touched_count)
        self.touched_count = 0
        self.generation += 1

    def provide(self, slots: int) -> None:
        """Have at least so many buckets, a power of two."""
        if slots > self.buckets.shape[0]:
            self.buckets = np.empty((slots, self.buckets.shape[1]), dtype=np.int32)

    @property
    def memory(self) -> NDArray[np.int64]:
        """Where the space lies, as a row of ``SearchMemory.table``."""
        arrays = (self.remaining, self.parent, self.touched, self.buckets)
        return np.array([*(array.ctypes.data for array in arrays), *self.buckets.shape], np.int64)


@dataclass(frozen=True, slots=True)
class Search:
    """What a search found; readable until the next search in the same space.

    Attributes
    ----------
    space : SearchSpace
        Where costs and parents lie.
    start : (row, column)
        Where it began.
    budget : int
        What could be spent, in units of cost.
    settled : int
        Costs up to this one [units] are final; a cell beyond counts as not reached.
    hits : (M, 2) int64
        The first targets (row, column), by cost and then by row and column; empty where none was looked for
        or reached.
    """

    space: SearchSpace
    start: Cell
    budget: int
    settled: int
    hits: NDArray[np.int64]
    generation: int

    @property
    def unit(self) -> float:
        """Metres of open floor that one unit of cost stands for."""
        return self.space.resolution / grid_search.STRAIGHT

    def cost(self, cell: Cell) -> float:
        """Cost [m] of the cheapest way to a cell, ``inf`` where it was not reached."""
        self._check()
        row, column = int(cell[0]), int(cell[1])
        if (row, column) == self.start:
            return 0.0
        left = int(self.space.remaining[row, column])
        if (
            left in (0, grid_search.NO_ENTRY)
            or self.space.parent[row, column] >= grid_search.LEAVING
            or self.budget - left > self.settled
        ):
            return math.inf
        return (self.budget - left) * self.unit

    def costs(self) -> NDArray[np.float64]:
        """Costs (rows, columns) [m] of all cells, ``inf`` where not reached.

        A pass over the whole grid: for tests and pictures.
        """
        self._check()
        left = self.space.remaining
        spent = self.budget - left.astype(np.int64)
        reached = (left > 0) & (left != grid_search.NO_ENTRY) & (spent <= self.settled)
        reached[reached] = self.space.parent[reached] < grid_search.LEAVING
        costs = np.where(reached, spent * self.unit, math.inf)
        costs[self.start] = 0.0
        return costs

    def reached(self) -> NDArray[np.int64]:
        """Cells (N, 2) that were reached, in the order in which they were first seen."""
        self._check()
        packed = self.space.touched[: self.space.touched_count].astype(np.int64)
        cells = np.stack((packed >> 16, packed & 0xFFFF), axis=1)
        left = self.space.remaining[cells[:, 0], cells[:, 1]]
        passable = self.space.parent[cells[:, 0], cells[:, 1]] < grid_search.LEAVING
        reached: NDArray[np.int64] = cells[
            (left != grid_search.NO_ENTRY) & (self.budget - left <= self.settled) & passable
        ]
        return reached

    def path(self, cell: Cell) -> NDArray[np.int64]:
        """Cheapest path to a cell.

        Returns
        -------
        (N, 2) int64
            Cells (row, column) from the start to ``cell``, both included; neighbours differ by at most one in
            each.

        Raises
        ------
        ValueError
            If the cell was not reached, or another search has used the space since.
        """
        if math.isinf(self.cost(cell)):
            raise ValueError(
                f"cell {(int(cell[0]), int(cell[1]))} was not reached from {self.start}; ask for its cost "
                "first"
            )
        return np.asarray(
            grid_search.trace(self.space.parent, self.start[0], self.start[1], int(cell[0]), int(cell[1]))
        )

    def _check(self) -> None:
        if self.generation != self.space.generation:
            raise ValueError(
                "another search has used this space since; read a search before the next one, or give it a "
                "space of its own"
            )


def search(
    space: SearchSpace,
    log_odds: NDArray[np.int8],
    clearance: ClearanceField,
    start: Cell,
    footprint: Footprint,
    *,
    goal: Cell | None = None,
    targets: Targets | None = None,
    count: int = 1,
    beyond: float = 0.0,
    maximum_cost: float = math.inf,
    blocked: Iterable[Disc] = (),
) -> Search:
    """Spread costs from a cell over all that a body can reach.

    Ends early where the target is found.

    Parameters
    ----------
    space : SearchSpace
        Scratch memory; the search before is forgotten.
    log_odds : (rows, columns) int8
        The belief, C-contiguous: < 0 free, 0 unknown, > 0 occupied. Only known free cells are entered.
    clearance : ClearanceField
        Clearance of the same belief.
    start : (row, column)
        Where the body stands. If it stands too near to a wall or inside a blocked disc, it may leave along
        cells that are no nearer; such cells are part of paths but count as not reached.
    footprint : Footprint
        The body.
    goal : (row, column), optional
        Stop when this cell is settled.
    targets : Targets, optional
        Stop when ``count`` cells are settled from which a target is in reach and sight.
    count : int
        How many.
    beyond : float
        With the targets found, go on until all costs up to the dearest one's and this above it are final [m].
    maximum_cost : float
        Stop at this cost [m].
    blocked : iterable of (row, column, radius)
        Discs in cells (see :func:`discs_of`), such as teammates with both radii added, that the body's centre
        may not enter.

    Returns
    -------
    Search
        Costs, paths and targets.

    Raises
    ------
    ValueError
        If shapes differ, the belief is no C-contiguous int8, a cell lies outside the grid, ``beyond`` is
        negative, or the footprint needs more clearance than the field knows.
    """
    _check_search(space, log_odds, clearance, start, goal)
    if not beyond >= 0.0:
        raise ValueError(f"beyond is {beyond} m; want 0 or more")
    passage = passage_of(footprint, space.resolution, clearance.limit)
    space.provide(passage.slots)
    budget = int(budget_of(float(maximum_cost), space.resolution))
    goal_row, goal_column = (-1, -1) if goal is None else (int(goal[0]), int(goal[1]))
    discs = _discs_array(blocked)
    space.forget()
    further = int(budget_of(float(beyond), space.resolution)) if beyond > 0.0 else 0
    task = np.array(
        [*start, goal_row, goal_column, budget, 0, 0 if targets is None else count, further], np.int64
    )
    mask, near = (_NO_MASK, _NO_MASK) if targets is None else (targets.mask, targets.near)
    lookout = Lookout(
        mask, near, np.zeros(1, np.int64) if targets is None else targets.spans.copy(), space.hits
    )
    space.touched_count, hit_count, settled = search_at(
        log_odds.ctypes.data, clearance.closeness, passage, space.memory, discs, task, lookout
    )
    packed = space.hits[:hit_count].astype(np.int64)
    rows, columns = packed >> 16, packed & 0xFFFF
    order = np.lexsort((columns, rows, -space.remaining[rows, columns].astype(np.int64)))[:count]
    hits = np.stack((rows[order], columns[order]), axis=1)
    return Search(space, (int(start[0]), int(start[1])), budget, settled, hits, space.generation)


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
    """Return the cheapest path to one cell, by A* with the octile distance.

    Hart, Nilsson and Raphael, IEEE T-SSC 1968.

    Parameters are those of :func:`search`; the cost is the same as there.

    Returns
    -------
    (float, (N, 2) int64) or None
        Cost [m] and cells (row, column) from start to goal; None if there is no way.
    """
    _check_search(space, log_odds, clearance, start, goal)
    passage = passage_of(footprint, space.resolution, clearance.limit)
    space.provide(passage.slots)
    space.forget()
    cost, cells = find_path(
        log_odds,
        clearance.closeness,
        passage,
        space.memory,
        _discs_array(blocked),
        int(start[0]),
        int(start[1]),
        int(goal[0]),
        int(goal[1]),
        budget_of(float(maximum_cost), space.resolution),
    )
    return None if cost < 0 else (cost * (space.resolution / grid_search.STRAIGHT), cells)


def discs_of(discs: Iterable[Disc], origin: tuple[float, float], resolution: float) -> list[Disc]:
    """Return discs (x, y, radius) [m] as (row, column, radius) in cells.

    Counted from the centre of cell (0, 0).
    """
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
        raise ValueError(
            f"log_odds is of {log_odds.dtype}, strides {log_odds.strides}; want C-contiguous int8"
        )
    for name, cell in (("start", start), ("goal", start if goal is None else goal)):
        if not (0 <= cell[0] < space.shape[0] and 0 <= cell[1] < space.shape[1]):
            raise ValueError(
                f"{name} {(int(cell[0]), int(cell[1]))} lies outside the grid of {space.shape} cells"
            )


def _discs_array(discs: Iterable[Disc]) -> NDArray[np.float64]:
    return np.array(list(discs), dtype=np.float64).reshape(-1, 3)
