"""All maps of a place: sparse ones in both modes and both usages, and the grids besides them."""

import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.benchmarks.studies.sparse.grids import OctoMap, TreeSizes, laser_grid
from lidarium.benchmarks.studies.sparse.places import BODY, CAMERA, Frame, Place, frames_of
from lidarium.envs.settings.cameras import CAMERAS
from lidarium.mapping.sparse.graph import TopologicalGraph, build_graph
from lidarium.mapping.sparse.map_files import binary_content, text_content
from lidarium.mapping.sparse.mapper.full import map_cloud
from lidarium.mapping.sparse.mapper.incremental import IncrementalMapper
from lidarium.mapping.sparse.planning import plan
from lidarium.mapping.sparse.settings import MapperSettings
from lidarium.mapping.sparse.sparse_map import SparseMap
from lidarium.mapping.sparse.thesis_graph import ThesisGraphSettings, build_thesis_graph

FRAME_CODES, FULL_CODES = 256, 2048
RANGE_M = 4.0
SHARE_OF_PIXELS = 1 / 16
"""Of each frame, in the cloud of a whole place."""

THESIS_FRAME_CODES = 32


@dataclass(frozen=True, slots=True, kw_only=True)
class ThesisPlace:
    """What the thesis says of a place, tables 5.5 and 5.6.

    `frames`: frames of the incremental map, its codes over 32; `codes`: codes of the full map; `height`,
    `connection_radius`, `neighbours`: parameters of the graph [m, m, nodes].
    """

    frames: int
    codes: int
    height: float
    connection_radius: float
    neighbours: int


THESIS = {
    "robotics_laboratory": ThesisPlace(frames=122, codes=1024, height=1.0, connection_radius=0.3, neighbours=8),
    "signal_laboratory": ThesisPlace(frames=117, codes=2048, height=1.2, connection_radius=0.2, neighbours=6),
    "home_arena": ThesisPlace(frames=38, codes=1024, height=1.0, connection_radius=0.3, neighbours=6),
    "apartment": ThesisPlace(frames=165, codes=2048, height=1.5, connection_radius=0.3, neighbours=6),
}

Planner = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64] | None]


@dataclass(frozen=True, eq=False)
class Survey:
    """All that was made of the frames of a place."""

    frames: int
    sparse: dict[str, SparseMap]
    graphs: dict[str, TopologicalGraph]
    planners: dict[str, Planner]
    tree: TreeSizes


def survey(place: Place, turns: int) -> Survey:
    """Drive through a place, turn by a number of frames, make all maps of it, and the planners on them."""
    frames = _kept_frames(place, turns)
    octomap, mapper = OctoMap(), IncrementalMapper(FRAME_CODES, MapperSettings(range_m=RANGE_M))
    for frame in frames:
        octomap.add(frame)
        mapper.add(frame.points, frame.pose)
    cloud, thesis = cloud_of(frames), THESIS[place.name]
    few = [frames[k] for k in np.linspace(0, len(frames) - 1, thesis.frames).astype(int)]
    by_codes = MapperSettings(range_m=RANGE_M, mode="thesis", robot_height_m=thesis.height)
    thesis_mapper = IncrementalMapper(THESIS_FRAME_CODES, by_codes)
    for frame in few:
        thesis_mapper.add(frame.points, frame.pose)
    sparse = {
        "incremental": mapper.map,
        "full": map_cloud(cloud, FULL_CODES),
        "thesis incremental": thesis_mapper.map,
        "thesis full": map_cloud(cloud, thesis.codes, replace(by_codes, range_m=None)),
    }
    graphs = {name: _graph(name, found, thesis) for name, found in sparse.items()}
    grid, laser = octomap.projected(place), laser_grid(place)
    planners: dict[str, Planner] = {"grid": grid.plan, "laser": laser.plan}
    planners |= {name: _sparse_planner(graph, "thesis" not in name) for name, graph in graphs.items()}
    return Survey(len(frames), sparse, graphs, planners, octomap.sizes())


def noisy_maps(place: Place, turns: int) -> dict[str, SparseMap]:
    """Return the incremental maps of a place by a camera with noise: of all its points, and of the precise ones."""
    camera = replace(CAMERAS["xtion_noisy"], height=CAMERA.height, pitch=CAMERA.pitch)
    ranges = {"all": RANGE_M, "precise": camera.precise_m}
    mappers = {name: IncrementalMapper(FRAME_CODES, MapperSettings(range_m=far)) for name, far in ranges.items()}
    for frame in frames_of(place, turns, camera):
        for mapper in mappers.values():
            mapper.add(frame.points, frame.pose)
    return {name: mapper.map for name, mapper in mappers.items()}


def _kept_frames(place: Place, turns: int) -> list[Frame]:
    """Return the frames, of half the pixels' precision: as many fit into memory."""
    return [replace(frame, points=frame.points.astype(np.float32)) for frame in frames_of(place, turns)]


def cloud_of(frames: list[Frame]) -> NDArray[np.float32]:
    """Return the cloud of a whole place: some pixels of every frame, (N, 3) [m]."""
    generator, parts = np.random.default_rng(1), []
    for frame in frames:
        chosen = generator.random(len(frame.points)) < SHARE_OF_PIXELS
        parts.append(replace(frame, points=frame.points[chosen]).in_map.astype(np.float32))
    return np.concatenate(parts)


def _graph(name: str, found: SparseMap, thesis: ThesisPlace) -> TopologicalGraph:
    if "thesis" not in name:
        return build_graph(found.free, found.boxes, BODY, floor=found.seen_floor)
    settings = ThesisGraphSettings(
        height=thesis.height, connection_radius=thesis.connection_radius, neighbours=thesis.neighbours
    )
    return build_thesis_graph(found.free, found.centres, settings)


def _sparse_planner(graph: TopologicalGraph, shortens: bool) -> Planner:
    def planned(start: NDArray[np.float64], goal: NDArray[np.float64]) -> NDArray[np.float64] | None:
        found = plan(graph, start, goal, shortens)
        return found.path if found.is_found else None

    return planned


def size_of(found: SparseMap) -> dict[str, Any]:
    """Return the codes of a map, and the bytes of its files."""
    content, text = binary_content(found), text_content(found)
    codes = len(found.occupied) + len(found.ground)
    return {
        "occupied": len(found.occupied),
        "free": len(found.ground),
        "text": len(text.encode()),
        "binary": len(content),
        "thesis_binary": 16 * codes,
        "text_deflated": len(zlib.compress(text.encode(), 9)),
    }
