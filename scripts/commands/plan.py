"""`lidarium plan`: plan a path on a sparse map."""

from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, ClassVar, Protocol

from tyro.conf import Positional, arg

from lidarium.scripts.commands.sparse_map import numbers_of
from lidarium.scripts.common import DONE, NO, Answer, Command, Outputs, notify, table

if TYPE_CHECKING:
    from lidarium.mapping.sparse.graph import TopologicalGraph
    from lidarium.mapping.sparse.sparse_map import SparseMap

OUTPUTS = Outputs(("path.json", "path.png", "path_3d.png"), "path.json", "graph")


@dataclass(frozen=True, kw_only=True)
class _Plan(Command):
    """Plan a path on a sparse map.

    With --out, path.json and pictures are written there. Exit code 3 if there is no path.
    """

    compiles: ClassVar[bool] = True

    map: Positional[Path]
    """the map, as `lidarium sparse-map` writes it"""
    start: Annotated[str, arg(name="from")]
    """x,y or x,y,z of the start [m]"""
    goal: Annotated[str, arg(name="to")]
    """x,y or x,y,z of the goal [m]"""
    radius: float = 0.3
    """radius of the robot [m]"""
    height: float = 1.2
    """height of the robot [m]"""
    max_step: float = 0.05
    """highest step of the floor, up or down, that the robot climbs [m]"""
    clearance_weight: float = 0.0
    """additional cost of paths near obstacles, as a share"""


class _Driven(Protocol):
    """A command that plans for a robot."""

    @property
    def map(self) -> Path: ...
    @property
    def radius(self) -> float: ...
    @property
    def height(self) -> float: ...
    @property
    def max_step(self) -> float: ...
    @property
    def clearance_weight(self) -> float: ...


def graph_for(command: _Driven, sparse_map: "SparseMap") -> "tuple[TopologicalGraph, list[str]]":
    """Return the graph of a map for a command's robot, with remarks."""
    from lidarium.mapping.sparse.graph import GraphSettings, build_graph
    from lidarium.mapping.sparse.swept_body import SweptBody

    body = SweptBody(radius=command.radius, height=command.height, clearance=command.max_step)
    settings = GraphSettings(clearance_weight=command.clearance_weight)
    graph = build_graph(sparse_map.free, sparse_map.boxes, body, settings, sparse_map.seen_floor)
    if sparse_map.seen_floor is not None:
        return graph, []
    return graph, [
        f"{command.map} does not know which floor was seen: paths may lead over holes and steps; make it again by "
        "lidarium sparse-map"
    ]


def execute(command: _Plan) -> Answer:
    """Plan a path."""
    import numpy as np

    from lidarium.evaluation.drawing.sparse_picture import save_sparse_pictures
    from lidarium.mapping.files.output import write_json
    from lidarium.mapping.sparse.map_files import read_sparse_map
    from lidarium.mapping.sparse.planning import check_on_map, map_bounds, plan

    if command.out is not None:
        OUTPUTS.check(command.out, (command.map,))
    start, goal = (
        np.array(numbers_of(name, text, (2, 3))) for name, text in (("--from", command.start), ("--to", command.goal))
    )
    sparse_map, _ = read_sparse_map(command.map)
    graph, remarks = graph_for(command, sparse_map)
    for remark in remarks:
        notify(remark)
    for name, point in (("--from", start), ("--to", goal)):
        check_on_map(map_bounds(graph), name, point)
    plan(graph, start, goal)  # compiles
    began = perf_counter()
    answer = plan(graph, start, goal)
    seconds = perf_counter() - began
    result = {
        "map": str(command.map),
        **answer.result,
        "graph": {"nodes": len(graph.nodes), "edges": len(graph.edges)},
        "seconds": round(seconds, 6),
        "remarks": remarks,
    }
    files = []
    if command.out is not None:
        write_json(command.out / "path.json", result)
        pictures = save_sparse_pictures(
            command.out / "path.smap", sparse_map.boxes, sparse_map.free, graph, answer.path
        )
        files = [str(command.out / "path.json"), *pictures]
    found = f"{answer.length:.2f} m, {len(answer.path)} points" if answer.is_found else f"none: {answer.reason}"
    facts = [
        ("path", found),
        ("graph", f"{len(graph.nodes)} nodes, {len(graph.edges)} edges"),
        ("time", f"{1e3 * seconds:.3f} ms"),
        *([("files", ", ".join(files))] if files else []),
    ]
    return Answer(result, table(facts), DONE if answer.is_found else NO)
