"""Worlds and models of SDF, as Gazebo reads them: collisions of models are solids with their heights.

References
----------
Open Robotics, SDFormat specification 1.11: world, model, link, collision, geometry, include, pose.
"""

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from pathlib import Path
from xml.etree.ElementTree import Element

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.floor import Floor, Solid, check_extent
from lidarium.envs.floors.importers.common import enclosed, floor_name, read_text, refuse_resolution
from lidarium.mapping.files.guarded_reading import printable
from lidarium.mapping.geometry.bounds import shown

SUFFIXES = (".sdf", ".world")

GROUND_M = 0.02
"""Lower shapes are ground, not solids [m]."""

_ROUND_PARTS = 32
_MAX_NESTED = 16
_OF_GAZEBO = ("sun", "ground_plane")
"""Models of Gazebo's own library that every world has: its light, and the ground."""

_SHAPES = "box, cylinder, capsule, sphere, ellipsoid, polyline, plane"

Pose = NDArray[np.float64]
"""Pose of a frame in the world, (4, 4)."""


def load(path: Path, resolution: float | None) -> Floor:
    """Read a world or a model.

    Models whose collisions are meshes are refused, as are included models that are not next to the world file.
    """
    refuse_resolution(path, resolution)
    solids = [solid for solid in _solids(path, _root(path), np.eye(4), 0) if solid is not None]
    if not solids:
        raise ValueError(f"{path} has no collision above the ground; want models that stand there ({_SHAPES})")
    points = np.concatenate([solid.polygon for solid in solids])
    low, high = points.min(axis=0), points.max(axis=0)
    bounds = float(low[0]), float(low[1]), float(high[0]), float(high[1])
    check_extent(str(path), bounds, points.reshape(-1, 1, 2))
    return Floor(floor_name(path), bounds, (*_surroundings(path, solids, low, high), *solids))


def _root(path: Path) -> Element:
    try:
        root = ElementTree.fromstring(read_text(path))
    except ElementTree.ParseError as error:
        raise ValueError(f"{path} is not XML: {error}") from error
    if root.tag != "sdf":
        raise ValueError(f"{path} begins with {shown(root.tag)}; want an sdf element")
    return root


def _surroundings(
    path: Path, solids: list[Solid], low: NDArray[np.float64], high: NDArray[np.float64]
) -> tuple[Solid, ...]:
    """Return the surroundings of the walls as a solid; none if they enclose nothing."""
    edges = np.concatenate([solid.edges for solid in solids])
    try:
        rings = enclosed(path, edges, low, high)
    except ValueError:
        return ()
    around = np.array([low - 1.0, (high[0] + 1.0, low[1] - 1.0), high + 1.0, (low[0] - 1.0, high[1] + 1.0)])
    return (Solid(around, holes=rings),)


def _solids(path: Path, element: Element, around: Pose, depth: int) -> Iterator[Solid | None]:
    """Yield the solids of an element and of its children."""
    if depth > _MAX_NESTED:
        raise ValueError(f"{path} has models nested more than {_MAX_NESTED} deep; want a world")
    # A world saved while it ran lists the current poses of its models separately.
    saved = {model.get("name"): model for model in element.findall("state/model")}
    for child in element:
        if child.tag in ("world", "model", "link"):
            placed = saved.get(child.get("name"), child) if child.tag == "model" else child
            yield from _solids(path, child, around @ _pose(path, placed), depth + 1)
        elif child.tag == "include" and _model_name(child) not in _OF_GAZEBO:
            file = _included(path, child)
            yield from _solids(file, _root(file), around @ _pose(path, child), depth + 1)
        elif child.tag == "collision":
            geometry = child.find("geometry")
            if geometry is not None:
                name = printable(child.get("name") or "a collision")
                yield _solid(path, name, geometry, around @ _pose(path, child))


def _model_name(include: Element) -> str:
    uri = (include.findtext("uri") or "").strip()
    return uri.removeprefix("model://").removeprefix("file://").strip("/")


def _included(path: Path, include: Element) -> Path:
    """Return the file of an included model, next to the world file or in a folder ``models`` next to it."""
    name = _model_name(include)
    for folder in (path.parent, path.parent / "models", path.parent.parent, path.parent.parent / "models"):
        for file in (folder / name / "model.sdf", folder / name):
            if name and ".." not in Path(name).parts and file.is_file():
                return file
    raise ValueError(
        f"{path} includes {shown(name)}, which is not there; want its folder beside the world or in models/"
    )


def _pose(path: Path, element: Element) -> Pose:
    """Return the pose of an element: x, y, z, roll, pitch, yaw [m, rad]."""
    text = element.findtext("pose") or "0 0 0 0 0 0"
    x, y, z, roll, pitch, yaw = _numbers(path, text, 6, "pose")
    found = element.find("pose")
    if found is not None and (frame := found.get("relative_to") or found.get("frame")):
        raise ValueError(f"{path} has a pose relative to {shown(frame)}; want poses in the element around")
    if found is not None and found.get("degrees") in ("true", "1"):
        roll, pitch, yaw = (math.radians(angle) for angle in (roll, pitch, yaw))
    pose = np.eye(4)
    for axis, angle in ((2, yaw), (1, pitch), (0, roll)):
        pose[:3, :3] = pose[:3, :3] @ _turn(axis, angle)
    pose[:3, 3] = x, y, z
    return pose


def _turn(axis: int, angle: float) -> NDArray[np.float64]:
    """Return a rotation about an axis, (3, 3)."""
    first, second = ((1, 2), (2, 0), (0, 1))[axis]
    turn = np.eye(3)
    turn[first, first] = turn[second, second] = math.cos(angle)
    turn[second, first], turn[first, second] = math.sin(angle), -math.sin(angle)
    return turn


def _solid(path: Path, name: str, geometry: Element, pose: Pose) -> Solid | None:
    """Return the prism around a shape; None if it is not an obstacle, as the ground."""
    if geometry.find("plane") is not None or geometry.find("empty") is not None:
        return None
    points = _points(path, name, geometry) @ pose[:3, :3].T + pose[:3, 3]
    z_low, z_high = float(points[:, 2].min()), float(points[:, 2].max())
    if z_high <= GROUND_M:
        return None
    is_upright = abs(pose[2, 2]) > 1.0 - 1e-9
    if geometry.find("polyline") is not None and is_upright:
        ring = points[: len(points) // 2, :2]
    else:
        ring = np.asarray(cv2.convexHull(points[:, :2].astype(np.float32))[:, 0, :], np.float64)
    return Solid(ring, max(z_low, 0.0), max(z_high, max(z_low, 0.0) + 1e-3))


def _points(path: Path, name: str, geometry: Element) -> NDArray[np.float64]:
    """Return points whose hull is a shape, (n, 3), in the shape's frame [m]."""
    for shape in geometry:
        if shape.tag == "box":
            size = _numbers(path, shape.findtext("size") or "", 3, "size of a box")
            corners = np.stack(np.meshgrid(*[(-0.5, 0.5)] * 3), axis=-1).reshape(-1, 3)
            return np.asarray(corners * size)
        if shape.tag in ("cylinder", "capsule"):
            radius = _numbers(path, shape.findtext("radius") or "", 1, "radius")[0]
            half = 0.5 * _numbers(path, shape.findtext("length") or "", 1, "length")[0]
            half += radius if shape.tag == "capsule" else 0.0
            return _between(_circle(radius), -half, half)
        if shape.tag in ("sphere", "ellipsoid"):
            text = shape.findtext("radius" if shape.tag == "sphere" else "radii") or ""
            radii = np.array(_numbers(path, text, 1 if shape.tag == "sphere" else 3, "radius")) * np.ones(3)
            levels = np.linspace(-1.0, 1.0, _ROUND_PARTS // 2 + 1)
            rings = [_between(_circle(math.sqrt(1.0 - level * level)), level, level) for level in levels]
            return np.asarray(np.concatenate(rings) * radii)
        if shape.tag == "polyline":
            ring = np.array([_numbers(path, each.text or "", 2, "point") for each in shape.findall("point")])
            height = _numbers(path, shape.findtext("height") or "1", 1, "height")[0]
            if len(ring) < 3:
                raise ValueError(f"{path}: {name} has a polyline of {len(ring)} points; want at least 3")
            return _between(ring, 0.0, height)
    kinds = ", ".join(printable(str(shape.tag)) for shape in geometry) or "nothing"
    uri = printable((geometry.findtext("mesh/uri") or "").strip())
    what = f"mesh {uri!r}" if uri else kinds
    raise ValueError(f"{path}: {name} collides as {what}; want one of {_SHAPES}")


def _circle(radius: float) -> NDArray[np.float64]:
    turns = np.arange(_ROUND_PARTS) * (2.0 * math.pi / _ROUND_PARTS)
    return radius * np.stack([np.cos(turns), np.sin(turns)], axis=1)


def _between(ring: NDArray[np.float64], low: float, high: float) -> NDArray[np.float64]:
    """Return a ring at two heights, one after the other, (2 n, 3)."""
    return np.concatenate([np.column_stack([ring, np.full(len(ring), height)]) for height in (low, high)])


def _numbers(path: Path, text: str, count: int, what: str) -> list[float]:
    words = text.split()
    try:
        found = [float(word) for word in words]
    except ValueError:
        found = []
    if len(found) != count or not np.isfinite(found).all():
        raise ValueError(f"{path} has the {what} {shown(text.strip())}; want {count} numbers")
    return found
