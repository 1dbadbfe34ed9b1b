"""Places with holes in their floor, stairs that lead down, and pallets: paths stay on floor that was seen."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.benchmarks.studies.shared.study import Progress, do_missing
from lidarium.benchmarks.studies.sparse.maps import FRAME_CODES, FULL_CODES, RANGE_M, cloud_of
from lidarium.benchmarks.studies.sparse.places import (
    BODY,
    CLEAR_M,
    TURNS,
    Frame,
    Place,
    PlaceTask,
    frames_of,
    load_place,
    place_of,
    place_tasks,
    requests_of,
)
from lidarium.envs.floors.floor import Solid
from lidarium.evaluation.report.tables import markdown_table
from lidarium.mapping.sparse.graph import build_graph
from lidarium.mapping.sparse.mapper.full import map_cloud
from lidarium.mapping.sparse.mapper.incremental import IncrementalMapper
from lidarium.mapping.sparse.planning import plan
from lidarium.mapping.sparse.settings import MapperSettings
from lidarium.mapping.sparse.sparse_map import SparseMap

KINDS = ("hole", "stairwell", "pallet")
AREAS_A_KIND = 2
SIDES_M = (0.4, 0.9)
"""Least and largest side of an area [m]."""

PALLET_M = 0.09
STAIR_M, TREAD_M, STAIRS = 0.17, 0.25, 8
"""Height and depth of a stair [m], and their number."""


@dataclass(frozen=True, eq=False)
class Areas:
    """Stairwells, holes and pallets on the floor of a place.

    `kinds`: of ``KINDS``, one for each area; `boxes` (N, 2, 2) float64: low and high corner of each [m].
    """

    kinds: tuple[str, ...]
    boxes: NDArray[np.float64]

    def of(self, *kinds: str) -> NDArray[np.float64]:
        """Return the boxes of some kinds."""
        return self.boxes[[kind in kinds for kind in self.kinds]]


def areas_of(place: Place, seed: int = 0) -> Areas:
    """Draw areas that the robot can come to, apart from each other and from its start."""
    generator, count = np.random.default_rng(seed), AREAS_A_KIND * len(KINDS)
    boxes: list[NDArray[np.float64]] = []
    start = place.floor.starts[0, :2]
    while len(boxes) < count:
        middle = place.drawn_points(BODY.radius, 1, int(generator.integers(2**31)))[0]
        half = 0.5 * generator.uniform(*SIDES_M, 2)
        box = np.array([middle - half, middle + half])
        is_apart = all((box[0] > each[1] + 0.1).any() or (box[1] < each[0] - 0.1).any() for each in boxes)
        from_start = np.hypot(*np.maximum(np.maximum(box[0] - start, start - box[1]), 0.0))
        if is_apart and from_start > BODY.radius + CLEAR_M:
            boxes.append(box)
    return Areas(KINDS * AREAS_A_KIND, np.array(boxes))


def _solids(boxes: NDArray[np.float64], height: float) -> tuple[Solid, ...]:
    return tuple(
        Solid(np.array([low, [high[0], low[1]], high, [low[0], high[1]]]), z_high=height) for low, high in boxes
    )


def with_areas(place: Place, areas: Areas) -> tuple[Place, Place]:
    """Return the place that a camera sees, with pallets, and the true one, in which areas are as solid as walls."""
    pallets = _solids(areas.of("pallet"), PALLET_M)
    solids = (*place.floor.solids, *pallets)
    seen = place_of(place.name, replace(place.floor, solids=solids))
    true = replace(place.floor, solids=(*solids, *_solids(areas.of("hole", "stairwell"), BODY.height)))
    return seen, place_of(place.name, true)


def frames_with_areas(place: Place, areas: Areas, turns: int = TURNS) -> Iterator[Frame]:
    """Yield the frames of a survey: without the floor in holes, and with stairs for that of stairwells."""
    for frame in frames_of(place, turns):
        points, eye = frame.in_map, frame.pose[:3, 3]
        on_floor = points[:, 2] < 0.02
        is_gone = on_floor & _are_in(points, areas.of("hole"))
        for box in areas.of("stairwell"):
            through = np.flatnonzero(on_floor & _are_in(points, box[None]))
            points[through] = _on_stairs(points[through], eye, box)
        kept = points[~is_gone] - eye
        yield replace(frame, points=kept @ frame.pose[:3, :3])


def _are_in(points: NDArray[np.float64], boxes: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which points (N, 3) are above one of boxes (M, 2, 2), (N,) bool."""
    flat = points[:, None, :2]
    inside: NDArray[np.bool_] = np.all((flat >= boxes[:, 0]) & (flat <= boxes[:, 1]), axis=2)
    return np.asarray(np.any(inside, axis=1))


def _on_stairs(points: NDArray[np.float64], eye: NDArray[np.float64], box: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return where the rays to points of the floor meet the treads below it, or the sides of the well."""
    rays = (points - eye) / (eye[2] - points[:, 2:])  # a metre down
    found, is_met = points.copy(), np.zeros(len(points), np.bool_)
    for stair in range(1, STAIRS + 1):
        below = points + rays * (stair * STAIR_M + points[:, 2:])
        tread = np.floor((below[:, 0] - box[0, 0]) / TREAD_M) + 1
        # The ray is below the tread there, or has left the well, behind one of its sides.
        meets = ~is_met & ((tread <= stair) | ~_are_in(below, box[None]) | (stair == STAIRS))
        found[meets] = np.clip(below, [*box[0], -np.inf], [*box[1], np.inf])[meets]
        is_met |= meets
    return found


DROPS_FILE = "drops.jsonl"


def measure(task: PlaceTask) -> dict[str, Any]:
    """Map a place with areas; count the requests that are answered, and the paths over areas."""
    place = load_place(task.name)
    areas = areas_of(place)
    seen, true = with_areas(place, areas)
    mapper, parts = IncrementalMapper(FRAME_CODES, MapperSettings(range_m=RANGE_M)), []
    for frame in frames_with_areas(seen, areas, task.turns):
        mapper.add(frame.points, frame.pose)
        parts.append(frame)
    maps = {"incremental": mapper.map, "full": map_cloud(cloud_of(parts), FULL_CODES)}
    requests = requests_of(true)
    line: dict[str, Any] = {"place": task.name, "requests": len(requests)}
    for name, found in maps.items():
        line[name] = _counts(true, found, requests)
        line[f"{name}, all floor"] = _counts(true, replace(found, seen_floor=None), requests)
    return line


def _counts(true: Place, found: SparseMap, requests: NDArray[np.float64]) -> dict[str, int]:
    """Return how many requests are answered, and how many of the paths collide or lead over areas."""
    graph = build_graph(found.free, found.boxes, BODY, floor=found.seen_floor)
    paths = [answer.path for start, goal in requests if (answer := plan(graph, start, goal)).is_found]
    return {"answered": len(paths), "over": sum(true.collides(path) for path in paths)}


def work(folder: Path, every: int) -> Progress:
    """Measure every N-th place."""
    yield from do_missing(folder / DROPS_FILE, "drops", place_tasks(every), measure, 1)


def drops_table(lines: list[dict[str, Any]]) -> str:
    """Return the counts of all places."""
    rows = []
    for line in lines:
        for usage in ("incremental", "full"):
            own, blind = line[usage], line[f"{usage}, all floor"]
            share = f"{100.0 * own['answered'] / line['requests']:.1f}"
            rows.append([line["place"], usage, share, str(own["over"]), str(blind["over"])])
    header = ("place", "usage", "answered [%]", "paths over areas", "the same if all floor counts as seen")
    return markdown_table(header, rows)
