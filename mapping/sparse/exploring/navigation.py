"""What a robot drives and explores on: the graph of its sparse map, and the ground that it has seen."""

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.planning.frontiers.frontier_map import Clusters
from lidarium.mapping.sparse.exploring.ground_map import BLOCKED, SEEN, UNKNOWN, GroundMap
from lidarium.mapping.sparse.exploring.routes import (
    PlannedRoute,
    is_route_free,
    path_to_stand,
    plan_route,
    plan_straight,
)
from lidarium.mapping.sparse.exploring.views import Places, Sight, Unknown, View, best_view
from lidarium.mapping.sparse.graph.nodes import reduced_nodes, standing_nodes
from lidarium.mapping.sparse.graph.obstacles import ChangingGraph
from lidarium.mapping.sparse.graph.topological_graph import GraphSettings, TopologicalGraph, graph_of_nodes
from lidarium.mapping.sparse.mapper.explained_points import are_near
from lidarium.mapping.sparse.planning.reach import costs_from
from lidarium.mapping.sparse.swept_body import BoxIndex, SweptBody, index_boxes

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
    """What a robot knows, ready to be planned on.

    Attributes
    ----------
    graph : TopologicalGraph or None
        Where its body can be driven; None where it knows no place to stand.
    index : BoxIndex
        What stands there.
    body : SweptBody
        Its body, wider by a margin.
    margin_m : float
        The margin [m].
    ground : GroundMap
        What it has seen of the ground.
    trail : (T, 3) float64
        Where it has been, the last place last [m].
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
            return plan_straight(self.index, self.body.numbers, first, last)
        return plan_route(self.graph, self.ground, first, last, self.trail, self.margin_m)

    def is_free(self, points: NDArray[np.float64]) -> bool:
        """Whether a route (P, 2) [m] can be driven."""
        return is_route_free(self.index, self.body.numbers, on_ground(points))

    def nearest_standing(self, place: NDArray[np.float64], within_m: float) -> NDArray[np.float64] | None:
        """Return the node nearest to x, y (2,) within a distance [m], x, y (2,); None where there is none."""
        if self.graph is None:
            return None
        gaps = np.hypot(*(self.graph.nodes[:, :2] - place).T)
        nearest = int(np.argmin(gaps))
        return self.graph.nodes[nearest, :2].copy() if gaps[nearest] <= within_m else None

    def unknown_ground(self, least_m: float) -> Clusters:
        """Return the unknown cells beside seen ground, in connected groups.

        Only ground counts that is joined to where the robot has been by seen ground: behind the foot of a
        wall is none. Groups shorter than ``least_m`` [m] are left out, and patches on which the body could
        not stand.
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

    def best_view(
        self, pose: NDArray[np.float64], frontier: NDArray[np.float64], sight: Sight
    ) -> View | None:
        """Return the best view of unknown ground beside what was seen, (F, 2) [m].

        None where a robot at x, y, theta (3,) cannot come to see enough of it.
        """
        cell_m = self.ground.cell_m
        area = (self._sample_step * cell_m) ** 2
        unknown = Unknown(on_ground(frontier), cell_m, on_ground(self.unknown_samples()), area)
        return best_view(self.index, self._places(pose), unknown, sight)

    def nearest_view(self, pose: NDArray[np.float64], points: NDArray[np.float64]) -> View:
        """Return the view towards points (F, 2) [m] from as near as a robot at x, y, theta (3,) can come."""
        places = self._places(pose)
        gaps = points[None] - places.points[:, None, :2]
        place, point = np.unravel_index(int(np.argmin(np.hypot(*gaps.transpose(2, 0, 1)))), gaps.shape[:2])
        run, rise = gaps[place, point]
        heading = math.atan2(rise, run)
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
        """Return the places for views: where the robot is, and nodes that it can come to."""
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
        """Return the nodes (N, 3), and what it costs to come to each [m], inf where one cannot."""
        if self.graph is None:
            return np.empty((0, 3)), np.empty(0)
        path_out = path_to_stand(self.graph, on_ground(pose[:2]), self.trail)
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
    """Return what is known, ready to be planned on.

    Parameters
    ----------
    free : (N, 3) float64
        Free codes [m].
    boxes : (M, 2, 3) float64
        Boxes of occupied codes [m].
    ground : GroundMap
        What was seen of the ground.
    trail : (T, 3) float64
        Where the robot has been, the last place last [m]; nodes as well.
    body : SweptBody
        The robot's body.
    margin_m : float
        By how much it is taken to be wider [m].
    settings : GraphSettings or None
        How the graph is made; the defaults where None.
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
