"""Navigation on sparse maps: routes on the graph and on open ground, and their upkeep as maps grow."""

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.planning.frontiers.frontier_map import Clusters
from lidarium.mapping.sparse.changing_graph import ChangingGraph
from lidarium.mapping.sparse.exploring.ground import BLOCKED, SEEN, UNKNOWN, GroundMap
from lidarium.mapping.sparse.exploring.views import Places, Sight, Unknown, View, best_view
from lidarium.mapping.sparse.graph import (
    GraphSettings,
    TopologicalGraph,
    clearances,
    graph_of_nodes,
    nearest_nodes,
    reduced_nodes,
    standing_nodes,
)
from lidarium.mapping.sparse.mapper.merging import are_near
from lidarium.mapping.sparse.planning import NO_PATH, REASONS, START_IN_COLLISION, costs_from, plan
from lidarium.mapping.sparse.swept_body import BoxIndex, SweptBody, are_free, index_boxes, is_free

ROOM_M = 0.3
"""The clearance of a body is known up to this [m]."""

PREFERRED_ROOM_M = 0.12
"""Routes keep this clearance of the body if they can [m]."""

TIGHT_M = 1.0
"""Longest straight piece of a route if they cannot [m]."""

PATH_OUT_M = 1.5
"""Farthest node to which a robot goes straight out of a place where it does not fit [m]."""

NODES_OUT = 32
"""Nearest nodes that are tried for that."""

THINNER = (0.75, 0.5, 0.25)
"""Shares of the radius with which it is tried to go there."""


@dataclass(frozen=True, eq=False, slots=True)
class PlannedRoute:
    """The answer to a request for a route.

    Attributes
    ----------
    points : (P, 3) float64
        From the start to the goal [m]; empty if there is no route.
    room : (P,) float64
        Clearance of the body on the piece that leads to each point [m].
    reason : str
        Why there is none, as of ``Plan``; else empty.
    """

    points: NDArray[np.float64]
    room: NDArray[np.float64]
    reason: str = ""

    @property
    def length(self) -> float:
        """Length of the route [m]."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())


def _plan_route(
    graph: TopologicalGraph,
    ground: GroundMap,
    start: NDArray[np.float64],
    goal: NDArray[np.float64],
    trail: NDArray[np.float64],
    margin_m: float = 0.0,
) -> PlannedRoute:
    """Plan a route for the body of a graph.

    Parameters
    ----------
    start, goal : (3,) float64
        Start and goal [m].
    trail : (T, 3) float64
        Positions of the robot, the last one last [m].
    margin_m : float
        By how much the graph's body is wider than the robot [m].
    """
    path_out = _path_to_stand(graph, start, trail)
    if path_out is None:
        return _none(REASONS[START_IN_COLLISION])
    found = plan(graph, path_out[-1], goal, shortens=False)
    if not found.is_found:
        return _none(found.reason)
    path = _shortened_on_ground(graph.index, found.path, graph.body.numbers, ground.levels, ground.frame)
    points = np.concatenate([path_out[:-1], path])
    return PlannedRoute(points, margin_m + _room_along(graph, points))


def _plan_straight(
    index: BoxIndex, body: NDArray[np.float64], start: NDArray[np.float64], goal: NDArray[np.float64]
) -> PlannedRoute:
    """Return the straight route, for a map without nodes."""
    if not is_free(index, start, goal, body):
        return _none(REASONS[NO_PATH])
    return PlannedRoute(np.stack([start, goal]), np.zeros(2))


def _path_to_stand(
    graph: TopologicalGraph, start: NDArray[np.float64], trail: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """Return the points from a place to the nearest one at which the body fits.

    Parameters
    ----------
    start : (3,) float64
        Where it is [m].
    trail : (T, 3) float64
        Positions of the robot, the last one last [m].

    Returns
    -------
    (P, 3) float64 or None
        The start alone if it can stand there; None if no path out is known.
    """
    start = np.asarray(start, np.float64)
    body = graph.body.numbers
    if is_free(graph.index, start, start, body):
        return start[None]
    nearest, gaps = np.full(NODES_OUT, -1), np.full(NODES_OUT, np.inf)
    nearest_nodes(graph.grid, start, nearest, gaps, -1)
    nodes = graph.nodes[nearest[(nearest >= 0) & (gaps <= PATH_OUT_M**2)]]
    starts = np.broadcast_to(start, nodes.shape).copy()
    for share in THINNER:
        thin = body * np.array([share, 1.0, 1.0])
        free = are_free(graph.index, starts, nodes, thin)
        if free.any():
            return np.stack([start, nodes[np.argmax(free)]])
    # Where it came from it could drive, whatever the map says.
    trail = np.ascontiguousarray(trail, np.float64).reshape(-1, 3)
    stands = are_free(graph.index, trail, trail, body)
    if not stands.any():
        return None
    last = int(np.flatnonzero(stands)[-1])
    return np.concatenate([start[None], trail[last:][::-1]])


def _is_route_free(index: BoxIndex, body: NDArray[np.float64], points: NDArray[np.float64]) -> bool:
    """Whether a route (P, 3) [m] can be driven."""
    path = np.ascontiguousarray(points, np.float64)
    starts = path[:-1] if len(path) > 1 else path
    return bool(np.all(are_free(index, starts, path[-len(starts) :], body)))


def _none(reason: str) -> PlannedRoute:
    return PlannedRoute(np.empty((0, 3)), np.empty(0), reason)


def _room_along(graph: TopologicalGraph, points: NDArray[np.float64]) -> NDArray[np.float64]:
    starts = np.concatenate([points[:1], points[:-1]])
    return clearances(graph.index, starts, points, graph.body.numbers, ROOM_M)


@kernel
def _shortened_on_ground(index: BoxIndex, path: Array, body: Array, levels: Array, frame: Array) -> Array:
    """Shorten a path if a body can drive straight over seen ground.

    If there is clearance of the body the path goes straight as far as that lasts; else no farther than ``TIGHT_M``
    at once, so that it keeps its distance from obstacles if it can.

    Parameters
    ----------
    path : (P, 3) float64
        Points of the path [m]; its pieces can be driven.
    body : (3,) float64
        ``SweptBody.numbers``.
    levels : (rows, columns) int8
        The known ground.
    frame : (3,) float64
        Lower left corner of the ground and side of its cells [m].

    Returns
    -------
    (Q, 3) float64
        Some of the points, the first and the last among them.
    """
    count = path.shape[0]
    kept, found, place = np.empty((count, 3)), 0, 0
    wide = body.copy()
    wide[0] += PREFERRED_ROOM_M
    while True:
        kept[found] = path[place]
        found += 1
        if place == count - 1:
            return kept[:found]
        last = count - 1
        farther = _farthest_straight(index, path, place, last, wide, levels, frame)
        if farther == place:
            last = place + 1
            while last < count - 1 and _apart(path[place], path[last + 1]) <= TIGHT_M:
                last += 1
            farther = _farthest_straight(index, path, place, last, body, levels, frame)
        place = max(farther, place + 1)


@kernel(forceinline=True)
def _apart(a: Array, b: Array) -> float:
    return math.hypot(b[0] - a[0], b[1] - a[1])


@kernel(nrt=False)
def _farthest_straight(
    index: BoxIndex, path: Array, place: int, last: int, body: Array, levels: Array, frame: Array
) -> int:
    """Return the farthest point up to ``last`` to which one can go straight; ``place`` for none."""
    for farther in range(last, place, -1):
        a, b = path[place], path[farther]
        if _is_known(levels, frame, a, b) and is_free(index, a, b, body):
            return farther
    return place


@kernel(nrt=False)
def _is_known(levels: Array, frame: Array, a: Array, b: Array) -> bool:
    """Whether no cell on a line, sampled twice a cell, is unknown."""
    cell = frame[2]
    steps = int(math.ceil(2.0 * math.hypot(b[0] - a[0], b[1] - a[1]) / cell)) + 1
    for step in range(steps + 1):
        share = step / steps
        column = math.floor((a[0] + share * (b[0] - a[0]) - frame[0]) / cell)
        row = math.floor((a[1] + share * (b[1] - a[1]) - frame[1]) / cell)
        if not (0 <= row < levels.shape[0] and 0 <= column < levels.shape[1]):
            return False
        if levels[int(row), int(column)] == UNKNOWN:
            return False
    return True


SAMPLE_M = 0.3
"""Distance between samples of unknown ground, about [m]."""

HOPE_M, HOPE_MARGIN_M = 0.5, 1.0
"""Distance between nodes on unknown ground, and how far around a goal they reach [m]."""

BESIDE_M = 1.0
"""Nodes so near to a border of unknown ground lie beside it [m]."""

PLACE_M = 0.4
"""Of the nodes in a square of this side one is a place for views, the cheapest to come to [m]."""


@dataclass(frozen=True, eq=False, slots=True)
class SparseNavigation:
    """A robot's knowledge, prepared for planning.

    Attributes
    ----------
    graph : TopologicalGraph or None
        Free space of the body; None if no free position is known.
    index : BoxIndex
        Obstacles.
    body : SweptBody
        Its body, wider by a margin.
    margin_m : float
        The margin [m].
    ground : GroundMap
        The seen ground.
    trail : (T, 3) float64
        Positions of the robot, the last one last [m].
    settings : GraphSettings
        How the graph is made.
    """

    graph: TopologicalGraph | None
    index: BoxIndex
    body: SweptBody
    margin_m: float
    ground: GroundMap
    trail: NDArray[np.float64]
    settings: GraphSettings

    def amid(self, obstacles: NDArray[np.float64]) -> "SparseNavigation":
        """Return the same with boxes (B, 2, 3) [m] that stand there for now."""
        if len(obstacles) == 0:
            return self
        boxes = np.concatenate([self.index.boxes.reshape(-1, 2, 3), obstacles])
        if self.graph is None:
            return replace(self, index=index_boxes(boxes))
        changing = ChangingGraph(self.graph)
        for box in obstacles:
            changing.insert(box)
        return replace(self, graph=changing.graph, index=changing.graph.index)

    def hopeful(self, goal: NDArray[np.float64]) -> "SparseNavigation":
        """Return the same where unknown ground, up to that around x, y (2,) [m], counts as free."""
        ground, reach = self.ground, np.array([HOPE_MARGIN_M, HOPE_MARGIN_M])
        high = ground.origin + ground.cell_m * np.array(ground.levels.shape[::-1])
        low, high = np.minimum(ground.origin, goal - reach), np.maximum(high, goal + reach)
        x, y = np.meshgrid(np.arange(low[0], high[0], HOPE_M), np.arange(low[1], high[1], HOPE_M))
        places = np.stack([x.ravel(), y.ravel()], axis=1)
        nodes = on_ground(places[ground.are_unknown(places)])
        if self.graph is not None:
            nodes = np.concatenate([self.graph.nodes, nodes])
        nodes = nodes[standing_nodes(nodes, self.index, self.body)]
        if len(nodes) == 0:
            return self
        return replace(self, graph=graph_of_nodes(nodes, self.index, self.body, self.settings))

    def route(self, start: NDArray[np.float64], goal: NDArray[np.float64]) -> PlannedRoute:
        """Plan a route from x, y (2,) to x, y (2,) [m]."""
        first, last = on_ground(start), on_ground(goal)
        if self.graph is None:
            return _plan_straight(self.index, self.body.numbers, first, last)
        return _plan_route(self.graph, self.ground, first, last, self.trail, self.margin_m)

    def is_free(self, points: NDArray[np.float64]) -> bool:
        """Whether a route (P, 2) [m] can be driven."""
        return _is_route_free(self.index, self.body.numbers, on_ground(points))

    def nearest_standing(self, place: NDArray[np.float64], within_m: float) -> NDArray[np.float64] | None:
        """Return the node nearest to x, y (2,) within a distance [m], x, y (2,); None if there is none."""
        if self.graph is None:
            return None
        gaps = np.hypot(*(self.graph.nodes[:, :2] - place).T)
        nearest = int(np.argmin(gaps))
        return self.graph.nodes[nearest, :2].copy() if gaps[nearest] <= within_m else None

    def unknown_ground(self, least_m: float) -> Clusters:
        """Return the unknown cells adjacent to seen ground, in connected groups.

        Only ground counts that is joined to where the robot has been by seen ground: behind the foot of a wall is
        none. Groups shorter than ``least_m`` [m] are left out, and patches on which the body could not stand.
        """
        levels = _without_patches(self._joined_levels(), self.body.radius / self.ground.cell_m)
        # To this grid what is seen is unknown, and what is unknown is free: its frontiers are the other side.
        other_side = np.where(levels == BLOCKED, BLOCKED, np.where(levels == UNKNOWN, SEEN, UNKNOWN))
        return replace(self.ground, levels=other_side.astype(np.int8)).frontiers(least_m)

    def _joined_levels(self) -> NDArray[np.int8]:
        """Return the levels of the ground, with seen cells that are joined to the trail alone."""
        levels = self.ground.levels
        _, labels = cv2.connectedComponents((levels == SEEN).astype(np.uint8), connectivity=4)
        cells = self.ground.cells_of(self.trail[:, :2])
        rows, columns = cells[((cells >= 0) & (cells < levels.shape)).all(axis=1)].T
        been = np.unique(labels[rows, columns])
        return np.where((levels == SEEN) & ~np.isin(labels, been[been > 0]), np.int8(BLOCKED), levels)

    def best_view(self, pose: NDArray[np.float64], frontier: NDArray[np.float64], sight: Sight) -> View | None:
        """Return the best view of unknown ground adjacent to seen ground, (F, 2) [m].

        None if a robot at x, y, theta (3,) cannot come to see enough of it.
        """
        cell_m = self.ground.cell_m
        area = (self._sample_step * cell_m) ** 2
        unknown = Unknown(on_ground(frontier), cell_m, on_ground(self.unknown_samples()), area)
        return best_view(self.index, self._places(pose), unknown, sight)

    def nearest_view(self, pose: NDArray[np.float64], points: NDArray[np.float64], sight: Sight) -> View:
        """Return the view towards points (F, 2) [m] from as near as a robot at x, y, theta (3,) can come."""
        places = self._places(pose)
        gaps = points[None] - places.points[:, None, :2]
        place, point = np.unravel_index(int(np.argmin(np.hypot(*gaps.transpose(2, 0, 1)))), gaps.shape[:2])
        run, rise = gaps[place, point]
        heading = math.atan2(rise, run) - sight.bearing
        return View(places.points[place], heading, float(places.costs[place]), on_ground(points))

    def are_cut_off(self, pose: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return beside which points (N, 2) [m] lie nodes that a robot at x, y, theta (3,) cannot come to."""
        nodes, costs = self._costs(pose)
        away = nodes[np.isinf(costs), :2]
        return are_near(on_ground(points), on_ground(away), BESIDE_M)

    def unknown_samples(self) -> NDArray[np.float64]:
        """Return samples of all unknown ground, (S, 2) [m]."""
        step = self._sample_step
        return self.ground.centres(np.argwhere(self.ground.levels[::step, ::step] == UNKNOWN) * step)

    @property
    def _sample_step(self) -> int:
        return max(round(SAMPLE_M / self.ground.cell_m), 1)

    def _places(self, pose: NDArray[np.float64]) -> Places:
        """Return the positions for views: that of the robot, and the nodes that it can reach."""
        here = on_ground(pose[:2])
        nodes, costs = self._costs(pose)
        order = np.argsort(costs, kind="stable")
        order = order[np.isfinite(costs[order])]
        squares = np.floor(nodes[order, :2] / PLACE_M).astype(np.int64)
        chosen = order[np.sort(np.unique(squares, axis=0, return_index=True)[1])]
        headings = np.arctan2(nodes[chosen, 1] - here[1], nodes[chosen, 0] - here[0])
        return Places(
            np.concatenate([here[None], nodes[chosen]]),
            np.concatenate([[0.0], costs[chosen]]),
            np.concatenate([[pose[2]], headings]),
        )

    def _costs(self, pose: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the nodes (N, 3), and the cost of reaching each [m], inf if one cannot."""
        if self.graph is None:
            return np.empty((0, 3)), np.empty(0)
        path_out = _path_to_stand(self.graph, on_ground(pose[:2]), self.trail)
        if path_out is None:
            return self.graph.nodes, np.full(len(self.graph.nodes), np.inf)
        return self.graph.nodes, costs_from(self.graph, path_out[-1])


def sparse_navigation(
    free: NDArray[np.float64],
    boxes: NDArray[np.float64],
    ground: GroundMap,
    trail: NDArray[np.float64],
    body: SweptBody,
    margin_m: float = 0.0,
    settings: GraphSettings | None = None,
) -> SparseNavigation:
    """Return the known map, prepared for planning.

    Parameters
    ----------
    free : (N, 3) float64
        Free codes [m].
    boxes : (M, 2, 3) float64
        Boxes of occupied codes [m].
    trail : (T, 3) float64
        Positions of the robot, the last one last [m]; nodes as well.
    margin_m : float
        By how much it is taken to be wider [m].
    """
    settings, index = settings or GraphSettings(), index_boxes(boxes)
    wide = replace(body, radius=body.radius + margin_m)
    nodes = reduced_nodes(np.concatenate([trail, free]), settings.merge_radius)
    nodes = nodes[standing_nodes(nodes, index, wide)]
    graph = graph_of_nodes(nodes, index, wide, settings) if len(nodes) else None
    return SparseNavigation(graph, index, wide, margin_m, ground, trail, settings)


def on_ground(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return points x, y (..., 2) with a height of 0, (..., 3)."""
    places = np.asarray(points, np.float64)
    return np.concatenate([places, np.zeros((*places.shape[:-1], 1))], axis=-1)


def _without_patches(levels: NDArray[np.int8], radius: float) -> NDArray[np.int8]:
    """Return levels of ground, where unknown patches smaller than a disc [cells] count as seen."""
    is_unknown = (levels == UNKNOWN).astype(np.uint8)
    _, labels, statistics, _ = cv2.connectedComponentsWithStats(is_unknown, connectivity=4)
    is_small = statistics[:, cv2.CC_STAT_AREA] < math.pi * radius**2
    is_small[0] = False
    return np.where(is_small[labels], np.int8(SEEN), levels)
