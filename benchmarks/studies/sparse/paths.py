"""Requests in the furnished places, on sparse maps and on grids: who answers, and with which paths."""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.benchmarks.studies.shared.kept import Progress, do_missing
from lidarium.benchmarks.studies.sparse.grids import LASER_M, laser_grid
from lidarium.benchmarks.studies.sparse.maps import Planner, noisy_map, size_of, survey
from lidarium.benchmarks.studies.sparse.optimum import ShortestPaths
from lidarium.benchmarks.studies.sparse.places import BODY, CELL_M, PLACES, Place, load_place, requests_of
from lidarium.mapping.sparse.graph import TopologicalGraph, build_graph
from lidarium.mapping.sparse.planning import measure_path, plan
from lidarium.mapping.sparse.swept_body import are_free

PATHS_FILE = "places.jsonl"
LOW_POINTS = 2000
"""Points under and beside table tops and seats that are asked for."""

LENGTH, POINTS, SECONDS, DISPERSION, TURNING, RAW_DISPERSION, RAW_TURNING, COLLIDES = range(8)
"""Places of what is kept of an answer."""


@dataclass(frozen=True, slots=True)
class PlaceTask:
    """One of the places."""

    name: str

    @property
    def key(self) -> str:
        """Name that no other one of its file has."""
        return self.name


def measure(task: PlaceTask) -> dict[str, Any]:
    """Map a place in all modes and answer its requests; return what is kept of each answer."""
    place = load_place(task.name)
    found, requests = survey(place), requests_of(place)
    optimum = ShortestPaths(place)
    for planner in found.planners.values():
        planner(*requests[0])  # compiles
    noisy = noisy_map(place)
    noisy_graph = build_graph(noisy.free, noisy.boxes, BODY)
    return {
        "place": task.name,
        "frames": found.frames,
        "requests": len(requests),
        "straight": np.linalg.norm(requests[:, 1] - requests[:, 0], axis=1).round(4).tolist(),
        "optimum": [round(length, 4) for length in optimum.lengths(requests).tolist()],
        "answers": _answers(place, found.planners, requests),
        "maps": {name: size_of(each) for name, each in found.sparse.items()},
        "graphs": {name: [len(each.nodes), len(each.edges)] for name, each in found.graphs.items()},
        "tree": [found.tree.bits, found.tree.full, found.tree.bits_deflated],
        "tops": _tops(place, found.graphs),
        "noisy": _noisy(place, noisy_graph, requests) | {"occupied": len(noisy.occupied)},
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


def _noisy(place: Place, graph: TopologicalGraph, requests: NDArray[np.float64]) -> dict[str, int]:
    """Return how many requests a map of noisy frames answers, and how many of the paths collide."""
    paths = [plan(graph, start, goal) for start, goal in requests]
    answered = [each.path for each in paths if each.is_found]
    return {"answered": len(answered), "collide": sum(place.collides(path) for path in answered)}


def work(folder: Path, every: int) -> Progress:
    """Measure every N-th place; plans are timed, so one after the other."""
    tasks = [PlaceTask(name) for name in PLACES[::every]]
    yield from do_missing(folder / PATHS_FILE, "places", tasks, measure, 1)
