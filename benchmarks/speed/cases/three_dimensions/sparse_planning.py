"""Graphs of sparse maps made, repaired and asked for paths."""

import itertools
from collections.abc import Iterator

import numpy as np

from lidarium.benchmarks.speed.harness.lines import Line, shown
from lidarium.benchmarks.speed.harness.report import run_alone
from lidarium.benchmarks.speed.harness.timing import Contender, Effort, interleaved, rate, repeated
from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.mapping.sparse.changing_graph import ChangingGraph
from lidarium.mapping.sparse.graph import GraphSettings, TopologicalGraph, build_graph
from lidarium.mapping.sparse.planning import plan
from lidarium.mapping.sparse.swept_body import SweptBody

CORES = 1
CODES, REQUESTS, OBSTACLES = 3000, 500, 20
BODY = SweptBody(radius=0.3, height=1.2)
SETTINGS = GraphSettings(merge_radius=0.0)
"""No code is merged, so that as many stay as are asked for."""

LIMITS_MS = {"graph": 10.0, "repair": 0.5, "plan": 0.1, "plan, 95 %": 0.4}

NOTES = (
    f"*Sparse planning*: the furnished apartment with {CODES:,} free codes of the floor. *Repaired and replanned*: an "
    f"obstacle of 0.4 m appears on the path. *Plan*: median and 95th percentile of {REQUESTS} requests.",
)


def scene() -> tuple[np.ndarray, np.ndarray, TopologicalGraph]:
    """Return free codes (N, 3), boxes (M, 2, 3) and the graph of the apartment."""
    floor, generator = load_floor("apartment"), np.random.default_rng(0)
    boxes = np.array(
        [
            [[*solid.polygon.min(axis=0), max(solid.z_low, 0.0)], [*solid.polygon.max(axis=0), min(solid.z_high, 2.5)]]
            for solid in floor.solids
        ]
    )
    raster = floor.raster(0.025, BODY.clearance, BODY.height)
    rows, columns = np.nonzero(raster.solid == 0)
    parts: list[np.ndarray] = []
    while sum(map(len, parts)) < CODES:
        drawn = generator.choice(len(rows), CODES, replace=False)
        cells = np.stack([columns[drawn], rows[drawn]], axis=1) + 0.5
        points = np.column_stack([np.array(raster.origin) + cells * raster.resolution, np.zeros(CODES)])
        parts.append(build_graph(points, boxes, BODY, SETTINGS).nodes)
    free = np.concatenate(parts)[:CODES]
    return free, boxes, build_graph(free, boxes, BODY, SETTINGS)


def measure(effort: Effort) -> list[Line]:
    """Time a graph, its repair with a new plan, and plans."""
    free, boxes, graph = scene()
    requests = graph.nodes[np.random.default_rng(1).integers(0, len(graph.nodes), (REQUESTS, 2)), :2]
    changing, met = ChangingGraph(graph), list(_met(graph, requests))

    def repaired() -> None:
        for start, goal, block in met:
            box = np.array([[*(block[:2] - 0.2), 0.0], [*(block[:2] + 0.2), 1.0]])
            number = changing.insert(box)
            plan(changing.graph, start, goal)
            changing.remove(number)

    contenders: dict[str, Contender] = {
        "graph": repeated(lambda: build_graph(free, boxes, BODY, SETTINGS), 1),
        "repair": repeated(repaired, len(met)),
    }
    seconds = interleaved(contenders, effort)
    taken = {name: 1e3 / rate(seconds[name]) for name in contenders}
    each = 1e3 * np.array([_least_of_three(graph, request) for request in requests])
    taken |= {"plan": float(np.median(each)), "plan, 95 %": float(np.quantile(each, 0.95))}
    titles = {
        "graph": f"graph of {CODES:,} free codes",
        "repair": "repaired, replanned and restored",
        "plan": f"plan among {CODES:,} free codes",
        "plan, 95 %": f"plan among {CODES:,} free codes, 95 %",
    }
    return [
        Line(titles[name], f"{shown(taken[name])} ms", "-", None, limit, taken[name], True, "ms")
        for name, limit in LIMITS_MS.items()
    ]


def _met(graph: TopologicalGraph, requests: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Yield starts and goals whose paths bend, and a corner of each path."""
    bent = ((start, goal, plan(graph, start, goal).path) for start, goal in requests)
    found = ((start, goal, path[len(path) // 2]) for start, goal, path in bent if len(path) > 2)
    yield from itertools.islice(found, OBSTACLES)


def _least_of_three(graph: TopologicalGraph, request: np.ndarray) -> float:
    return min(repeated(lambda: plan(graph, *request))(0.0) for _ in range(3))


if __name__ == "__main__":
    run_alone(measure, "Graphs of sparse maps and their plans.")
