"""Short tours from which a floor is seen: views that see all, their order, and stops that can be left out.

Views are chosen greedily by visible cells per distance (set cover), ordered by OR-Tools, and then
improved: a few stops are taken out at random, and cells no longer seen are covered again, in the cheapest
manner (large neighbourhood search; Shaw 1998).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.evaluation.bounds.view_graph import ViewGraph, count, reached
from lidarium.extras import install_command

SUM_WEIGHT = 0.05
"""Weight of the sum of all tours against the longest one."""

MOST_TAKEN = 5
"""Maximum number of stops removed at once."""

LONGER = 0.05
"""Tours that are longer by up to this share may be gone on from at first."""

MOST_S = 30
"""Stops are ordered for so long at most; descents end before on all but the largest floors [s]."""

Stops = list[list[int]]


@dataclass(frozen=True, slots=True)
class TourPlan:
    """Tours of a team past views of a floor.

    Attributes
    ----------
    stops : list of list of int
        Places at which each robot's tour is anchored; it starts at the robot's start.
    walks : list of list of int
        All positions that each robot passes.
    lengths : (robots,) float64
        Lengths of the tours [m].
    share : float
        Share of all points that is seen.
    """

    stops: Stops
    walks: list[list[int]]
    lengths: NDArray[np.float64]
    share: float


def plan_tours(graph: ViewGraph, share: float, rounds: int, seed: int = 0) -> TourPlan:
    """Plan short tours from which a share of a floor is seen."""
    seen_at_all = np.bitwise_or.reduce(graph.views[reached(graph)], axis=0)
    wanted = math.ceil(share * int(count(seen_at_all)) - 1e-9)
    generator = np.random.default_rng(seed)
    none: Stops = [[] for _ in range(graph.robots)]
    stops = covered(graph, ordered(graph, covered(graph, none, wanted)), wanted)
    cost = cost_of(graph, stops)
    current, at = stops, cost
    for left in range(rounds, 0, -1):
        trial = covered(graph, _thinned(current, generator), wanted)
        trial_cost = cost_of(graph, trial)
        # Slightly longer tours are accepted, too, less so towards the last rounds.
        if trial_cost < at * (1.0 + LONGER * left / rounds * generator.random()):
            current, at = trial, trial_cost
        if trial_cost < cost - 1e-9:
            stops, cost = trial, trial_cost
    again = ordered(graph, stops)
    if cost_of(graph, again) < cost and _seen_count(graph, again) >= wanted:
        stops = again
    walks = [walk_of(graph, robot, tour) for robot, tour in enumerate(stops)]
    return TourPlan(stops, walks, lengths_of(graph, stops), _seen_count(graph, stops) / max(len(graph.points), 1))


def walk_of(graph: ViewGraph, robot: int, tour: list[int]) -> list[int]:
    """Return all places that a robot passes, from its start on."""
    walk = [robot]
    for stop in tour:
        walk += graph.path(walk[-1], stop)
    return walk


def lengths_of(graph: ViewGraph, stops: Stops) -> NDArray[np.float64]:
    """Return the lengths of tours [m]."""
    return np.array(
        [
            sum(graph.lengths[a, b] for a, b in zip([robot, *tour], tour, strict=False))
            for robot, tour in enumerate(stops)
        ]
    )


def cost_of(graph: ViewGraph, stops: Stops) -> float:
    """Return the cost of tours: the longest one, and a little of their sum [m]."""
    lengths = lengths_of(graph, stops)
    return float(lengths.max() + SUM_WEIGHT * lengths.sum())


def covered(graph: ViewGraph, stops: Stops, wanted: int) -> Stops:
    """Add stops to tours until that many points are seen.

    Each added stop shows the most points for its additional path.
    """
    tours = [list(tour) for tour in stops]
    by_robot = [graph.seen(walk_of(graph, robot, tour)) for robot, tour in enumerate(tours)]
    lengths = lengths_of(graph, tours)
    while True:
        seen = np.bitwise_or.reduce(by_robot, axis=0)
        missing = wanted - int(count(seen))
        if missing <= 0:
            return tours
        gains = np.minimum(count(graph.views & ~seen), missing)
        extra, where = _cheapest_insertions(graph, tours, lengths)
        worth = np.where(gains > 0, gains / (extra + 0.1), 0.0)
        best = int(np.argmax(worth))
        if worth[best] <= 0.0:
            return tours
        robot, position = int(where[best, 0]), int(where[best, 1])
        tours[robot].insert(position, best)
        lengths = lengths_of(graph, tours)
        # A new stop between two others may change the area seen on the way.
        by_robot[robot] = graph.seen(walk_of(graph, robot, tours[robot]))


def _cheapest_insertions(
    graph: ViewGraph, tours: Stops, lengths: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the cost of each place as a stop, and its position in a tour.

    (N,) [m], and (N, 2) of robot and position.
    """
    least = np.full(len(graph.places), np.inf)
    where = np.zeros((len(graph.places), 2), np.int64)
    longest = float(lengths.max())
    for robot, tour in enumerate(tours):
        at = [robot, *tour]
        for position, before in enumerate(at):
            detour = graph.lengths[before].copy()
            if position < len(tour):
                detour += graph.lengths[tour[position]] - graph.lengths[before, tour[position]]
            cost = np.maximum(longest, lengths[robot] + detour) - longest + SUM_WEIGHT * detour
            is_less = cost < least
            least[is_less], where[is_less] = cost[is_less], (robot, position)
    return least, where


def _thinned(stops: Stops, generator: np.random.Generator) -> Stops:
    """Return tours without a few stops that follow each other, or that lie anywhere."""
    tours = [list(tour) for tour in stops]
    taken = int(generator.integers(1, MOST_TAKEN + 1))
    busy = [robot for robot, tour in enumerate(tours) if tour]
    if not busy:
        return tours
    if generator.random() < 0.5:
        tour = tours[int(generator.choice(busy))]
        start = int(generator.integers(len(tour)))
        del tour[start : start + taken]
        return tours
    for _ in range(taken):
        busy = [robot for robot, tour in enumerate(tours) if tour]
        if busy:
            tour = tours[int(generator.choice(busy))]
            del tour[int(generator.integers(len(tour)))]
    return tours


def _seen_count(graph: ViewGraph, stops: Stops) -> int:
    walks = [walk_of(graph, robot, tour) for robot, tour in enumerate(stops)]
    return int(count(np.bitwise_or.reduce([graph.seen(walk) for walk in walks], axis=0)))


def check_solver() -> None:
    """Check that OR-Tools is installed, before anything is run."""
    try:
        from ortools.constraint_solver import pywrapcp  # noqa: F401
    except ImportError as error:
        raise ValueError(f"bounds need OR-Tools: {install_command('bounds')}") from error


def ordered(graph: ViewGraph, stops: Stops) -> Stops:
    """Return the same stops as the best open tours that OR-Tools finds."""
    check_solver()
    from ortools.constraint_solver import pywrapcp, routing_enums_pb2

    places = sorted({stop for tour in stops for stop in tour})
    if len(places) < 2:
        return stops
    nodes = [*range(graph.robots), *places]
    end = len(nodes)
    table = np.zeros((end + 1, end + 1), np.int64)
    lengths = graph.lengths[np.ix_(nodes, nodes)]
    table[:end, :end] = np.where(np.isfinite(lengths), np.rint(100.0 * lengths), 10**8)
    manager = pywrapcp.RoutingIndexManager(end + 1, graph.robots, list(range(graph.robots)), [end] * graph.robots)
    routing = pywrapcp.RoutingModel(manager)
    transit = routing.RegisterTransitMatrix(table.tolist())
    routing.SetArcCostEvaluatorOfAllVehicles(transit)
    routing.AddDimension(transit, 0, 10**9, True, "length")
    routing.GetDimensionOrDie("length").SetGlobalSpanCostCoefficient(round(1.0 / SUM_WEIGHT))
    wanted = pywrapcp.DefaultRoutingSearchParameters()
    wanted.first_solution_strategy = routing_enums_pb2.FirstSolutionStrategy.PATH_CHEAPEST_ARC
    wanted.local_search_metaheuristic = routing_enums_pb2.LocalSearchMetaheuristic.GREEDY_DESCENT
    wanted.time_limit.seconds = MOST_S
    found = routing.SolveWithParameters(wanted)
    if found is None:
        return stops
    tours: Stops = []
    for robot in range(graph.robots):
        tour, index = [], found.Value(routing.NextVar(routing.Start(robot)))
        while not routing.IsEnd(index):
            tour.append(nodes[manager.IndexToNode(index)])
            index = found.Value(routing.NextVar(index))
        tours.append(tour)
    return tours
