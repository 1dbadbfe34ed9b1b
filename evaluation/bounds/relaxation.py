"""Lower bounds on the walks from which a floor is seen, by linear programming with cuts.

A walk that sees a point comes to one of the places that see it. It crosses the border of any set that holds
all of these and no start, once if it ends within and twice otherwise. Such cuts are added if the
solution so far breaks them (minimum cuts; Dantzig, Fulkerson and Johnson 1954 for tours; Current and
Schilling 1989 for tours that need only come near). The length of all walks together is minimized, so
its share holds for the longest one.
"""

import math
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, LinearConstraint, OptimizeResult, linprog, milp
from scipy.sparse import csr_array, eye_array, hstack, vstack
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

from lidarium.evaluation.bounds.view_graph import ViewGraph, reached

SCALE = 10**6
"""Flows are whole multiples of one over this."""

VIOLATION = 1e-3
"""Cuts that are broken by less are left out."""


Cut = tuple[NDArray[np.bool_], int]
"""A set of places (places,) bool without a start, and a group of points that is seen from within alone."""


@dataclass(frozen=True, slots=True)
class _Relaxation:
    """Bounds on the shortest walks on a graph.

    Attributes
    ----------
    lower_m : float
        Lower bound of the total length of all walks that see this much [m].
    optimum_m : float
        Length of the shortest walks in all [m]; inf if it was not found.
    cuts : int
        Number of cuts.
    """

    lower_m: float
    optimum_m: float
    cuts: int


@dataclass(frozen=True, slots=True)
class _Program:
    """Links of a graph with all starts in place 0, and the cells that each place sees."""

    first: NDArray[np.int64]
    second: NDArray[np.int64]
    lengths: NDArray[np.float64]
    places: int
    robots: int
    sees: NDArray[np.bool_]
    weights: NDArray[np.float64]
    wanted: float


def relax(
    graph: ViewGraph, share: float, rounds: int = 60, exact_s: float = 0.0, limit_s: float = math.inf
) -> _Relaxation:
    """Bound the length of the walks from which a share of the visible cells is seen."""
    program = _program(graph, share)
    cuts: list[Cut] = []
    lower = 0.0
    until = time.monotonic() + limit_s
    found = _solved(program, cuts, math.inf)
    for _ in range(max(rounds, 1)):
        lower = max(lower, float(found.fun))
        broken = _broken(program, np.asarray(found.x))
        left_s = until - time.monotonic()
        if not broken or left_s <= 0.0:
            break
        following = _solved(program, [*cuts, *broken], left_s)
        if following.x is None or following.status != 0:
            break  # it took too long; the bounds so far hold
        found = following
        cuts += broken
    # Only the cuts that hold the bound up go into the slower program.
    used = list(cuts)
    if exact_s > 0.0:
        matrix, low, _ = _rows(program, cuts, len(_most(program)))
        slack = (matrix @ np.asarray(found.x) - low)[: len(cuts)]
        cuts = [cuts[k] for k in np.flatnonzero(slack < VIOLATION)]
    until = time.monotonic() + exact_s
    optimum = math.inf
    while math.isinf(optimum) and (left_s := until - time.monotonic()) > 0.0:
        found = _solved_whole(program, cuts, left_s)
        if found.x is None or found.status != 0:
            break
        broken = _broken(program, np.asarray(found.x))
        cuts += broken
        optimum = math.inf if broken else float(found.fun)
    return _Relaxation(lower, optimum, len(used))


def _program(graph: ViewGraph, share: float) -> _Program:
    kept = np.flatnonzero(reached(graph))
    number = np.full(len(graph.places), -1, np.int64)
    number[kept] = np.maximum(np.arange(len(kept)) - graph.robots + 1, 0)
    links = graph.links.tocoo()
    is_wanted = (links.row < links.col) & (number[links.row] >= 0) & (number[links.row] != number[links.col])
    flags = np.unpackbits(graph.views[kept].astype("<u8").view(np.uint8), axis=1, bitorder="little")
    flags = flags[:, : len(graph.points)].T.astype(np.bool_)
    places = len(kept) - graph.robots + 1
    sees = np.zeros((len(flags), places), np.bool_)
    sees[:, 0] = flags[:, : graph.robots].any(axis=1)
    sees[:, 1:] = flags[:, graph.robots :]
    groups, sizes = np.unique(sees[sees.any(axis=1)], axis=0, return_counts=True)
    weights = sizes.astype(np.float64)
    return _Program(
        number[links.row[is_wanted]],
        number[links.col[is_wanted]],
        links.data[is_wanted],
        places,
        graph.robots,
        groups,
        weights,
        float(np.ceil(share * weights.sum() - 1e-9)),
    )


def _rows(
    program: _Program, cuts: list[Cut], columns: int
) -> tuple[csr_array, NDArray[np.float64], NDArray[np.float64]]:
    """Return rows of all cuts, of the required cells, of the ends; and their sides."""
    links, places, groups = len(program.lengths), program.places, len(program.weights)
    row: list[NDArray[np.int64]] = []
    column: list[NDArray[np.int64]] = []
    value: list[NDArray[np.float64]] = []
    for k, (inside, group) in enumerate(cuts):
        crossed = np.flatnonzero(inside[program.first] != inside[program.second])
        ends = links + np.flatnonzero(inside)
        column += [crossed, ends, np.array([links + places + group])]
        value += [np.ones(len(crossed) + len(ends)), np.array([-2.0])]
        row.append(np.full(len(crossed) + len(ends) + 1, k))
    row += [np.full(groups, len(cuts)), np.full(places, len(cuts) + 1)]
    column += [links + places + np.arange(groups), links + np.arange(places)]
    value += [program.weights, np.ones(places)]
    entries = np.concatenate(value), (np.concatenate(row), np.concatenate(column))
    robots = float(program.robots)
    low = np.concatenate([np.zeros(len(cuts)), [program.wanted, robots]])
    high = np.concatenate([np.full(len(cuts) + 1, np.inf), [robots]])
    return csr_array(entries, shape=(len(cuts) + 2, columns)), low, high


def _most(program: _Program) -> NDArray[np.float64]:
    """Return the upper bounds of links crossed, ends and groups seen."""
    parts = np.full(len(program.lengths), 2.0), np.full(program.places, float(program.robots))
    return np.concatenate([*parts, np.ones(len(program.weights))])


def _solved(program: _Program, cuts: list[Cut], seconds: float) -> OptimizeResult:
    """Return the best crossings under the cuts so far, whole or not, if they are found in time."""
    most = _most(program)
    matrix, low, high = _rows(program, cuts, len(most))
    is_equal = low == high
    solve: Any = linprog
    found: OptimizeResult = solve(
        np.concatenate([program.lengths, np.zeros(len(most) - len(program.lengths))]),
        A_ub=-matrix[~is_equal],
        b_ub=-low[~is_equal],
        A_eq=matrix[is_equal],
        b_eq=low[is_equal],
        bounds=np.stack([np.zeros(len(most)), most], axis=1),
        method="highs",
        options={"time_limit": seconds},
    )
    return found


def _solved_whole(program: _Program, cuts: list[Cut], seconds: float) -> OptimizeResult:
    """Return the best whole crossings under the cuts so far.

    Each place is entered as often as left.
    """
    links, places, most = len(program.lengths), program.places, _most(program)
    columns = len(most) + places
    matrix, low, high = _rows(program, cuts, columns)
    numbers = np.arange(links)
    at_places = csr_array(
        (np.ones(2 * links), (np.concatenate([program.first, program.second]), np.tile(numbers, 2))),
        shape=(places, links),
    )
    others = csr_array((places, len(program.weights)))
    # Crossings at a place, ends there and starts there are twice a whole number.
    even: Any = hstack([at_places, eye_array(places), others, -2.0 * eye_array(places)])
    begun = np.where(np.arange(places) == 0, -float(program.robots), 0.0)
    rows: Any = vstack([matrix, even])
    constraint = LinearConstraint(rows.tocsr(), np.concatenate([low, begun]), np.concatenate([high, begun]))
    solve: Any = milp
    found: OptimizeResult = solve(
        np.concatenate([program.lengths, np.zeros(columns - links)]),
        integrality=np.ones(columns),
        bounds=Bounds(0.0, np.concatenate([most, np.full(places, 2.0 * links)])),
        constraints=constraint,
        options={"time_limit": seconds},
    )
    return found


def _broken(program: _Program, x: NDArray[np.float64]) -> list[Cut]:
    """Return the cuts that crossings break."""
    links, places = len(program.lengths), program.places
    crossed, ends, seen = x[:links], x[links : links + places], x[links + places :][: len(program.weights)]
    used = crossed > 1e-9
    flows = np.rint(crossed[used] * SCALE).astype(np.int64)
    sink = places
    begin = np.concatenate([program.first[used], program.second[used], np.zeros(places, np.int64)])
    end = np.concatenate([program.second[used], program.first[used], np.arange(places)])
    room = np.concatenate([flows, flows, np.rint(ends * SCALE).astype(np.int64)])
    found: list[Cut] = []
    for group in np.flatnonzero((seen > VIOLATION) & ~program.sees[:, 0]):
        targets = np.flatnonzero(program.sees[group])
        for inside in _least_cuts(
            np.concatenate([begin, targets]),
            np.concatenate([end, np.full(len(targets), sink)]),
            np.concatenate([room, np.full(len(targets), 4 * SCALE * program.robots)]),
            sink,
        ):
            value = crossed[inside[program.first] != inside[program.second]].sum() + ends[inside].sum()
            if value < 2.0 * seen[group] - VIOLATION:
                found.append((inside, int(group)))
    return found


def _least_cuts(
    begin: NDArray[np.int64], end: NDArray[np.int64], room: NDArray[np.int64], sink: int
) -> list[NDArray[np.bool_]]:
    """Return the places (sink,) bool beyond least cuts between place 0 and the sink.

    The first one lies nearest to place 0, the second one nearest to the sink.
    """
    is_used = (begin != end) & (room > 0)
    shape = (sink + 1, sink + 1)
    capacity = csr_array((room[is_used], (begin[is_used], end[is_used])), shape=shape).astype(np.int32)
    capacity.sum_duplicates()
    left = capacity - maximum_flow(capacity, 0, sink).flow
    left.data = np.maximum(left.data, 0)
    left.eliminate_zeros()
    near, far = np.zeros(sink + 1, np.bool_), np.zeros(sink + 1, np.bool_)
    near[breadth_first_order(left, 0, return_predecessors=False)] = True
    far[breadth_first_order(left.T.tocsr(), sink, return_predecessors=False)] = True
    return [~near[:sink], far[:sink]]
