"""KTH campus floors: rooms as contours of walls, windows and portals (XML).

Room contours run along the inner faces of the walls, so the gap between two rooms is the wall. A portal is an
open door: the gap between its segments on both sides is carved out.

References
----------
A. Aydemir, P. Jensfelt and J. Folkesson, What can we learn from 38,000 rooms? Reasoning about unexplored
space in indoor environments, IROS 2012.
"""

import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.drawing import fill_shapes, ring_edges, strip, strip_edges
from lidarium.envs.floors.floor import MAX_RASTER_CELLS, Floor, check_extent
from lidarium.envs.floors.importers.common import floor_of_cells, read_text, refuse_resolution
from lidarium.mapping.geometry.bounds import shown

RESOLUTION = 0.025

# Rooms that touch are parted by a wall of this thickness, half of it in each room [m].
_THIN_WALL = 0.05

# Facing portals belong together up to this distance, and a portal that faces none opens a wall up to this
# thickness [m].
_THICKEST_WALL = 1.5
_DEEPEST_BREACH = 0.6
_PARALLEL = 0.9
_MARGIN = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class _Space:
    """A room: its contour segments, (N, 4) [m], and the type of each."""

    segments: NDArray[np.float64]
    types: tuple[str, ...]


def load(path: Path, resolution: float | None) -> Floor:
    """Read a floor, in cells of 0.025 m.

    Free are the rooms and the doorways between them.
    """
    refuse_resolution(path, resolution)
    spaces = _spaces(path)
    points = np.concatenate([space.segments for space in spaces]).reshape(-1, 2)
    low = points.min(axis=0) - _MARGIN
    check_extent(str(path), (*low.tolist(), *points.max(axis=0).tolist()), points.reshape(-1, 2, 2))
    columns, rows = (int(size) + 1 for size in (points.max(axis=0) + _MARGIN - low) / RESOLUTION)
    if rows * columns > MAX_RASTER_CELLS:
        raise ValueError(
            f"{path} has {columns} x {rows} cells at {RESOLUTION} m, more than {MAX_RASTER_CELLS}; check its scale"
        )
    origin = (float(low[0]), float(low[1]))
    free = np.zeros((rows, columns), dtype=np.uint8)
    _draw_free_space(free, origin, spaces)
    return floor_of_cells(path, free != 0, origin, RESOLUTION)


def _draw_free_space(free: NDArray[np.uint8], origin: tuple[float, float], spaces: list[_Space]) -> None:
    fill_shapes(free, origin, RESOLUTION, [space.segments for space in spaces], 1)
    walls = [
        segment
        for space in spaces
        for segment, kind in zip(space.segments, space.types, strict=True)
        if kind != "Portal"
    ]
    edges = strip_edges(np.array(walls).reshape(-1, 4), _THIN_WALL, 0.5)
    fill_shapes(free, origin, RESOLUTION, edges, 0)

    def is_free(point: NDArray[np.float64]) -> bool:
        column, row = ((point - origin) / RESOLUTION).astype(int)
        return bool(free[row, column]) if 0 <= row < free.shape[0] and 0 <= column < free.shape[1] else False

    doorways = [ring_edges(doorway) for doorway in _doorways(spaces, is_free)]
    fill_shapes(free, origin, RESOLUTION, doorways, 1)


def _spaces(path: Path) -> list[_Space]:
    try:
        root = ElementTree.fromstring(read_text(path))
    except ElementTree.ParseError as error:
        raise ValueError(f"{path} is not XML: {error}") from error
    scale = _scale(path, root)
    found = [_space(path, element, scale) for element in root.iter("space")]
    spaces = [space for space in found if len(space.segments) >= 3]
    if not spaces:
        raise ValueError(f"{path} has no space with a contour; want the XML of a KTH floor")
    return spaces


def _scale(path: Path, root: ElementTree.Element) -> float:
    element = root.find("Scale")
    if element is None:
        raise ValueError(f"{path} has no Scale; want PixelDistance and RealDistance")
    try:
        pixels, metres = float(element.get("PixelDistance", "")), float(element.get("RealDistance", ""))
    except ValueError:
        pixels = metres = 0.0
    if not (0.0 < pixels < np.inf and 0.0 < metres < np.inf):
        raise ValueError(f"{path} has Scale {shown(element.attrib)}; want positive PixelDistance and RealDistance")
    return metres / pixels


def _space(path: Path, element: ElementTree.Element, scale: float) -> _Space:
    name = element.get("name", "")
    lines = list(element.iter("linesegment"))
    to_metres = np.array([scale, -scale, scale, -scale])  # y of the drawing points down
    try:
        segments = np.array([[float(line.attrib[key]) for key in ("x1", "y1", "x2", "y2")] for line in lines]).reshape(
            -1, 4
        )
    except (KeyError, ValueError):
        segments = np.full((1, 4), np.nan)
    if not np.isfinite(segments).all():
        raise ValueError(f"{path}: space {shown(name)} has a linesegment without numbers x1, y1, x2, y2")
    return _Space(segments * to_metres, tuple(line.get("type", "Wall") for line in lines))


def _doorways(spaces: list[_Space], is_free: Callable[[NDArray[np.float64]], bool]) -> list[NDArray[np.float64]]:
    """Return the polygons of doorways between facing portals.

    For portals that face none, the polygon goes through the wall in front of them.

    Portals are paired by place: the names of their targets are often those of rooms elsewhere, or of none.
    """
    portals = [
        (number, segment)
        for number, space in enumerate(spaces)
        for segment, kind in zip(space.segments, space.types, strict=True)
        if kind == "Portal" and not np.array_equal(segment[:2], segment[2:])
    ]
    middles = np.array([(segment[:2] + segment[2:]) / 2.0 for _, segment in portals]).reshape(-1, 2)
    doorways = []
    for k, (number, segment) in enumerate(portals):
        doorways.append(strip(segment, 2.0 * _THIN_WALL))
        near = np.flatnonzero(np.hypot(*(middles - middles[k]).T) <= _THICKEST_WALL)
        facing = [portals[n][1] for n in near if portals[n][0] != number and _face(segment, portals[n][1])]
        if facing:
            other = min(facing, key=lambda candidate: _apart(segment, candidate))
            corners = np.concatenate([segment, other]).reshape(-1, 2)
            doorways.append(np.asarray(cv2.convexHull(corners.astype(np.float32))[:, 0, :], dtype=np.float64))
        else:
            doorways.extend(_breaches(segment, is_free))
    return [doorway for doorway in doorways if len(doorway) >= 3]


def _face(segment: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    """Return whether two portals are parallel and lie across a wall from each other."""
    along, along_other = segment[2:] - segment[:2], other[2:] - other[:2]
    length, length_other = float(np.hypot(*along)), float(np.hypot(*along_other))
    between = (other[:2] + other[2:] - segment[:2] - segment[2:]) / 2.0
    parallel = abs(float(along @ along_other)) > _PARALLEL * length * length_other
    beside = abs(float(between @ along)) / length > max(length, length_other) / 2.0
    return parallel and not beside


def _breaches(
    segment: NDArray[np.float64], is_free: Callable[[NDArray[np.float64]], bool]
) -> list[NDArray[np.float64]]:
    """Return the rectangles from a portal to the first free place on either side."""
    middle, along = (segment[:2] + segment[2:]) / 2.0, segment[2:] - segment[:2]
    across = np.array([-along[1], along[0]]) / np.hypot(*along)
    breaches = []
    for normal in (across, -across):
        for depth in np.arange(_THIN_WALL, _DEEPEST_BREACH, RESOLUTION):
            if is_free(middle + depth * normal):
                far = (depth + _THIN_WALL) * normal
                breaches.append(np.array([segment[:2], segment[2:], segment[2:] + far, segment[:2] + far]))
                break
    return breaches


def _apart(first: NDArray[np.float64], second: NDArray[np.float64]) -> float:
    """Return the distance between the middles of two segments [m]."""
    return float(np.hypot(*(first.reshape(2, 2).mean(axis=0) - second.reshape(2, 2).mean(axis=0))))
