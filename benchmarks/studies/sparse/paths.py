"""Paths on sparse maps, and the optimum they are compared with."""

import time
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from lidarium.benchmarks.studies.shared.study import Progress, do_missing
from lidarium.benchmarks.studies.sparse.grids import LASER_M, laser_grid
from lidarium.benchmarks.studies.sparse.maps import Planner, noisy_maps, size_of, survey
from lidarium.benchmarks.studies.sparse.places import (
    BODY,
    CELL_M,
    Place,
    PlaceTask,
    load_place,
    place_tasks,
    requests_of,
)
from lidarium.mapping.sparse.graph import TopologicalGraph, build_graph
from lidarium.mapping.sparse.planning import measure_path, plan
from lidarium.mapping.sparse.sparse_map import SparseMap
from lidarium.mapping.sparse.swept_body import are_free

ARC_SEGMENTS = 8
"""Straight pieces of a quarter circle around a grown corner."""

TOUCH_M = 1e-5
"""By how much what has grown shrinks again, so that paths may run along it [m]."""

LINES_AT_ONCE = 200_000


class ShortestPaths:
    """The shortest paths of the body in a place."""

    def __init__(self, place: Place) -> None:
        solids = [
            shapely.Polygon(solid.polygon, list(solid.holes))
            for solid in place.floor.solids
            if solid.z_low < BODY.height and solid.z_high > BODY.clearance
        ]
        grown = shapely.union_all([solid.buffer(BODY.radius, quad_segs=ARC_SEGMENTS) for solid in solids])
        self._barrier = grown.buffer(-TOUCH_M)
        shapely.prepare(self._barrier)
        self._corners = self._reached_corners(place, grown)
        count = len(self._corners)
        first, second = np.triu_indices(count, 1)
        seen = self._see(self._corners[first], self._corners[second])
        self._first, self._second = first[seen], second[seen]
        self._gaps = np.linalg.norm(self._corners[self._first] - self._corners[self._second], axis=1)

    @staticmethod
    def _reached_corners(place: Place, grown: shapely.Geometry) -> NDArray[np.float64]:
        """Return the corners of what has grown beside which the body can be, (C, 2) [m]."""
        corners = np.unique(shapely.get_coordinates(grown.simplify(1e-3)), axis=0)
        low_x, low_y, high_x, high_y = place.floor.bounds
        inside = (corners > (low_x, low_y)).all(axis=1) & (corners < (high_x, high_y)).all(axis=1)
        return np.asarray(corners[inside])

    def _see(self, starts: NDArray[np.float64], ends: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which pairs of points (N, 2) are joined by a free straight line, (N,) bool."""
        parts = []
        for first in range(0, len(starts), LINES_AT_ONCE):
            part = slice(first, first + LINES_AT_ONCE)
            lines = shapely.linestrings(np.stack([starts[part], ends[part]], axis=1))
            parts.append(~shapely.intersects(self._barrier, lines))
        return np.concatenate(parts) if parts else np.zeros(0, np.bool_)

    def lengths(self, requests: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the length of the shortest path of each request (N, 2, 2) [m]; inf if there is none."""
        count, corners = len(self._corners), self._corners
        found = np.empty(len(requests))
        for k, (start, goal) in enumerate(requests):
            ends = np.stack([start, goal])
            tips, nodes = np.repeat([count, count + 1], count), np.tile(np.arange(count), 2)
            seen = self._see(np.repeat(ends, count, axis=0), np.tile(corners, (2, 1)))
            direct = np.linalg.norm(goal - start) if self._see(start[None], goal[None])[0] else np.inf
            rows = np.concatenate([self._first, tips[seen]])
            columns = np.concatenate([self._second, nodes[seen]])
            gaps = np.linalg.norm(np.repeat(ends, count, axis=0) - np.tile(corners, (2, 1)), axis=1)[seen]
            weights = np.concatenate([self._gaps, np.maximum(gaps, 1e-12)])
            shortest: Any = dijkstra
            graph = csr_array((weights, (rows, columns)), shape=(count + 2, count + 2))
            gone = shortest(graph, directed=False, indices=count)
            found[k] = min(direct, gone[count + 1])
        return found


PATHS_FILE = "places.jsonl"
LOW_POINTS = 2000
"""Points under and beside table tops and seats that are asked for."""

LENGTH, POINTS, SECONDS, DISPERSION, TURNING, RAW_DISPERSION, RAW_TURNING, COLLIDES = range(8)
"""Places of what is kept of an answer."""


def measure(task: PlaceTask) -> dict[str, Any]:
    """Map a place in all modes and answer its requests; return what is kept of each answer."""
    place = load_place(task.name)
    found, requests = survey(place, task.turns), requests_of(place)
    optimum = ShortestPaths(place)
    for planner in found.planners.values():
        planner(*requests[0])  # compiles
    return {
        "place": task.name,
        "turns": task.turns,
        "frames": found.frames,
        "requests": len(requests),
        "straight": np.linalg.norm(requests[:, 1] - requests[:, 0], axis=1).round(4).tolist(),
        "optimum": [round(length, 4) for length in optimum.lengths(requests).tolist()],
        "answers": _answers(place, found.planners, requests),
        "maps": {name: size_of(each) for name, each in found.sparse.items()},
        "graphs": {name: [len(each.nodes), len(each.edges)] for name, each in found.graphs.items()},
        "tree": [found.tree.bits, found.tree.full, found.tree.bits_deflated],
        "tops": _tops(place, found.graphs),
        "noisy": {name: _noisy(place, each, requests) for name, each in noisy_maps(place, task.turns).items()},
    }


def _answers(
    place: Place, planners: dict[str, Planner], requests: NDArray[np.float64]
) -> dict[str, list[list[float] | None]]:
    """Return what is kept of each planner's answers; None for no path. Planners take turns."""
    kept: dict[str, list[list[float] | None]] = {name: [] for name in planners}
    for start, goal in requests:
        for name, planner in planners.items():
            began = time.perf_counter()
            path = planner(start, goal)
            seconds = time.perf_counter() - began
            kept[name].append(None if path is None else _kept(place, path, seconds))
    return kept


def _kept(place: Place, path: NDArray[np.float64], seconds: float) -> list[float]:
    even, raw = measure_path(path), measure_path(path, None)
    numbers = (even.length, even.points, seconds, even.dispersion, even.turning, raw.dispersion, raw.turning)
    return [*(round(float(number), 7) for number in numbers), float(place.collides(path))]


def _tops(place: Place, graphs: dict[str, TopologicalGraph]) -> dict[str, float]:
    """Return the share of places taken by tops and seats alone at which each map lets no robot stand."""
    at_plane = place.floor.raster(CELL_M, LASER_M, LASER_M).solid != 0
    at_body = place.floor.raster(CELL_M, BODY.clearance, BODY.height).solid != 0
    rows, columns = np.nonzero(at_body & ~at_plane)
    drawn = np.random.default_rng(0).integers(0, len(rows), LOW_POINTS)
    points = place.origin + (np.stack([columns[drawn], rows[drawn]], axis=1) + 0.5) * CELL_M
    shares = {"laser": float(laser_grid(place).are_blocked(points).mean())}
    for name in ("incremental", "full"):
        graph = graphs[name]
        on_floor = np.column_stack([points, np.full(len(points), graph.nodes[:, 2].mean())])
        shares[name] = float((~are_free(graph.index, on_floor, on_floor, graph.body.numbers)).mean())
    return shares


def _noisy(place: Place, noisy: SparseMap, requests: NDArray[np.float64]) -> dict[str, int]:
    """Return how many requests a map of noisy frames answers, how many of the paths collide, and its boxes."""
    graph = build_graph(noisy.free, noisy.boxes, BODY, floor=noisy.seen_floor)
    paths = [plan(graph, start, goal) for start, goal in requests]
    answered = [each.path for each in paths if each.is_found]
    collide = sum(place.collides(path) for path in answered)
    return {"answered": len(answered), "collide": collide, "occupied": len(noisy.occupied)}


def work(folder: Path, every: int) -> Progress:
    """Measure every N-th place; plans are timed, so one after the other."""
    yield from do_missing(folder / PATHS_FILE, "places", place_tasks(every), measure, 1)
