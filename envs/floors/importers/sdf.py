"""Worlds and models of SDF, as Gazebo reads them: collisions of models are solids with their heights.

References
----------
Open Robotics, SDFormat specification 1.11: world, model, link, collision, geometry, include, pose; and its
"Specifying pose" and "Pose frame semantics".
"""

import math
import os
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from xml.etree.ElementTree import Element
from xml.parsers import expat

import cv2
import numpy as np
import scipy
from numpy.typing import NDArray

from lidarium.envs.floors.drawing import fill_shapes
from lidarium.envs.floors.floor import CEILING, Floor, Solid, check_extent
from lidarium.envs.floors.importers.common import enclosed, floor_name, read_text, refuse_resolution
from lidarium.mapping.files.guarded_reading import printable, read_bytes, reading
from lidarium.mapping.geometry.bounds import shown

SUFFIXES = (".sdf", ".world")

GROUND_M = 0.02
"""Lower shapes are ground, not solids [m]."""

_HIGHEST_GROUND_M, _LOWEST_CEILING_M = 0.5, 1.5
"""Up to which height a slab below all else is the ground, and above which one over all else is the ceiling [m]."""

_SLAB_SHARE = 0.8
"""Least share of the rectangle of all other shapes that ground or ceiling cover."""

_SLAB_CELLS = 200
"""Cells along the longer side of that rectangle, by which the share is measured."""

_ROUND_PARTS = 32
_MAX_NESTED = 16
_OF_GAZEBO = ("sun", "ground_plane")
"""Models of Gazebo's own library that every world has: its light, and the ground."""

_SHAPES = "box, cylinder, cone, capsule, sphere, ellipsoid, polyline, plane"
_FRAMES = ("link", "model", "include", "frame", "joint")
"""Elements whose names poses may be relative to."""

_NAMED = 10
"""Most meshes that a message names."""

Pose = NDArray[np.float64]
"""Pose of a frame in the world, (4, 4)."""

_MAX_MESH_BYTES = 64 << 20
_STL_HEADER, _STL_FACET = 84, 50
_VERTICES = re.compile(rb"^[ \t]*v(?:ertex)?[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)", re.MULTILINE)


@dataclass(slots=True)
class _Found:
    """The content of a world.

    Attributes
    ----------
    solids : list of Solid
        Its shapes above the ground.
    boxes : list of Solid
        Bounding boxes of meshes.
    boxed, unread : list of str
        Names of these meshes, and of shapes that cannot be read.
    """

    solids: list[Solid] = field(default_factory=list)
    boxes: list[Solid] = field(default_factory=list)
    boxed: list[str] = field(default_factory=list)
    unread: list[str] = field(default_factory=list)


def load(path: Path, resolution: float | None, *, skip_meshes: bool = False) -> Floor:
    """Read a world or a model; ``skip_meshes`` leaves out the collisions that are meshes.

    Otherwise these stand as their bounding boxes. Included models have to be beside the world file.
    """
    refuse_resolution(path, resolution)
    found = _Found()
    _Scope(path, _root(path), np.eye(4)).collect(found)
    if found.unread and not skip_meshes:
        raise ValueError(
            f"{path} has {len(found.unread)} collisions that cannot be read: {_listed(found.unread)}; want {_SHAPES}, "
            "or meshes (stl, obj) beside the world; --skip-meshes leaves them out"
        )
    remarks = []
    if skip_meshes and (left_out := [*found.boxed, *found.unread]):
        remarks.append(f"{len(left_out)} collisions are left out: {_listed(left_out)}")
    elif found.boxed:
        remarks.append(f"{len(found.boxed)} meshes stand as their bounding boxes: {_listed(found.boxed)}")
    solids, ceiling = _without_slabs(found.solids + ([] if skip_meshes else found.boxes))
    for name, box in [] if skip_meshes else zip(found.boxed, found.boxes, strict=True):
        # The box of a mesh of a whole building fills it.
        if any(np.array_equal(solid.polygon, box.polygon) for solid in solids) and _covers_all(box, solids):
            raise ValueError(f"{path}: the box of mesh {name} fills the world; want walls of boxes, or --skip-meshes")
    if not solids:
        raise ValueError(f"{path} has no collision above the ground; want models that stand there ({_SHAPES})")
    points = np.concatenate([solid.polygon for solid in solids])
    low, high = points.min(axis=0), points.max(axis=0)
    bounds = float(low[0]), float(low[1]), float(high[0]), float(high[1])
    check_extent(str(path), bounds, points.reshape(-1, 1, 2))
    everything = (*_surroundings(path, solids, low, high), *solids)
    wall_height = _wall_height(solids, ceiling)
    return Floor(
        floor_name(path), bounds, everything, ceiling=ceiling, wall_height=wall_height, remark="; ".join(remarks)
    )


def _wall_height(solids: list[Solid], ceiling: float) -> float:
    """Return the height at which the longest outlines end, if no solid reaches the ceiling; otherwise infinity."""
    lengths: dict[float, float] = {}
    for solid in solids:
        height = round(solid.z_high, 3)
        lengths[height] = lengths.get(height, 0.0) + float(np.hypot(*(solid.edges[:, 2:] - solid.edges[:, :2]).T).sum())
    return math.inf if max(lengths) >= ceiling else max(lengths, key=lambda height: lengths[height])


def _listed(names: list[str]) -> str:
    """Return the first of some names."""
    return ", ".join(names[:_NAMED]) + (", ..." if len(names) > _NAMED else "")


def _root(path: Path) -> Element:
    """Return the root of a file by the rules of Gazebo's reader.

    It takes prefixes that are bound nowhere, hyphens in comments, and declarations behind something else.
    """
    text = re.sub(r"<!--.*?-->|<\?xml\b.*?\?>", "", read_text(path), flags=re.DOTALL).strip()
    builder = ElementTree.TreeBuilder()
    parser = expat.ParserCreate()  # without name spaces: a prefix is a part of the name
    parser.StartElementHandler, parser.EndElementHandler = builder.start, builder.end
    parser.CharacterDataHandler = builder.data
    parser.EntityDeclHandler = _refuse_entity
    try:
        parser.Parse(text.encode(), True)
    except expat.ExpatError as error:
        raise ValueError(f"{path} is not XML: {error}") from error
    root = builder.close()
    if root.tag != "sdf":
        raise ValueError(f"{path} begins with {shown(root.tag)}; want an sdf element")
    return root


def _refuse_entity(name: str, *rest: object) -> None:
    raise ValueError(f"it declares the entity {shown(name)}; want a world without entities")


def _without_slabs(solids: list[Solid]) -> tuple[list[Solid], float]:
    """Return solids without ground and ceiling, with heights above that ground, and the height of the ceiling.

    Ground and ceiling are slabs that together cover nearly all of the rectangle of the other solids.
    """
    ground, others = _parted(solids, lambda solid: solid.z_high <= _HIGHEST_GROUND_M)
    level = max((solid.z_high for solid in ground), default=0.0)
    above = [
        replace(solid, z_low=max(solid.z_low - level, 0.0), z_high=solid.z_high - level)
        for solid in others
        if solid.z_high - level > GROUND_M
    ]
    roof, standing = _parted(above, lambda solid: solid.z_low >= _LOWEST_CEILING_M)
    return standing, min((solid.z_low for solid in roof), default=CEILING)


def _parted(solids: list[Solid], may_be: Callable[[Solid], bool]) -> tuple[list[Solid], list[Solid]]:
    """Return the slabs among some solids that together cover nearly all of the others' rectangle, and the others."""
    candidates = [solid for solid in solids if may_be(solid)]
    others = [solid for solid in solids if not may_be(solid)]
    if candidates and others and _covered_share(candidates, others) >= _SLAB_SHARE:
        return candidates, others
    return [], solids


def _covers_all(box: Solid, solids: list[Solid]) -> bool:
    others = [solid for solid in solids if not np.array_equal(solid.polygon, box.polygon)]
    return not others or _covered_share([box], others) >= _SLAB_SHARE


def _covered_share(slabs: list[Solid], others: list[Solid]) -> float:
    """Return the share of the others' rectangle that slabs cover."""
    points = np.concatenate([solid.polygon for solid in others])
    low, size = points.min(axis=0), np.maximum(np.ptp(points, axis=0), 1e-6)
    cell = float(size.max()) / _SLAB_CELLS
    columns, rows = (max(int(side / cell), 1) for side in size)
    covered = np.zeros((rows, columns), np.uint8)
    fill_shapes(covered, (float(low[0]), float(low[1])), cell, [solid.edges for solid in slabs], 1)
    return float(covered.mean())


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


class _Scope:
    """A file, world, model or link: its frames by name, and where it is.

    Parameters
    ----------
    path : Path
        The file that it is in.
    element : Element
        Its element.
    around : (4, 4) float64
        Its pose in the world.
    model : _Scope or None
        Of a link, the scope of its model, whose frames it knows.
    """

    def __init__(
        self, path: Path, element: Element, around: Pose, depth: int = 0, model: "_Scope | None" = None
    ) -> None:
        if depth > _MAX_NESTED:
            raise ValueError(f"{path} has models nested more than {_MAX_NESTED} deep; want a world")
        self._path, self._element, self._around, self._depth, self._model = path, element, around, depth, model
        self._named = {child.get("name") or child.findtext("name"): child for child in element if child.tag in _FRAMES}
        # A world saved while it ran lists the current poses of its models separately.
        self._saved = {model.get("name"): model for model in element.findall("state/model")}

    def collect(self, found: _Found) -> None:
        """Add the solids of the element and of all in it."""
        for child in self._element:
            if child.tag in ("world", "model", "link") or (
                child.tag == "include" and _model_name(child) not in _OF_GAZEBO
            ):
                self._inside(child).collect(found)
            elif child.tag == "collision" and (geometry := child.find("geometry")) is not None:
                name = printable(child.get("name") or "a collision")
                _add_shape(found, self._path, name, geometry, self._pose(child, 0))

    def _inside(self, child: Element, steps: int = 0) -> "_Scope":
        """Return the scope of a part.

        The pose of an include takes the place of the model's own.
        """
        path, inner, placed = self._path, child, child
        if child.tag == "include":
            path = _included(self._path, child)
            root = _root(path)
            own = root.find("model")
            inner = root if own is None else own
            placed = child if own is None or child.find("pose") is not None else own
        if child.tag in ("model", "include"):
            placed = self._saved.get(child.get("name") or child.findtext("name"), placed)
        around = self._pose(placed, steps)
        if anchor := child.findtext("placement_frame") or inner.get("placement_frame"):
            inside = _Scope(path, inner, np.eye(4), self._depth + 1)
            around = around @ np.linalg.inv(inside._frame(anchor.strip(), steps + 1))
        return _Scope(path, inner, around, self._depth + 1, self if child.tag == "link" else None)

    def _pose(self, element: Element, steps: int) -> Pose:
        """Return the pose of an element in the world, by the frame that its pose is relative to."""
        found = element.find("pose")
        frame = "" if found is None else (found.get("relative_to") or found.get("frame") or "")
        if not frame and element.tag == "frame":
            frame = element.get("attached_to") or ""
        if not frame and element.tag == "joint":
            frame = (element.findtext("child") or "").strip()
        return self._frame(frame, steps + 1) @ _pose(self._path, element)

    def _frame(self, name: str, steps: int) -> Pose:
        """Return the pose of a frame in the world."""
        if steps > _MAX_NESTED:
            raise ValueError(f"{self._path} has poses that are relative to each other, as {shown(name)}")
        if name and self._model is not None:
            return self._model._frame(name, steps)
        if name in ("", "__model__") or (name == "world" and self._element.tag == "world"):
            return self._around
        first, _, rest = name.partition("::")
        if first not in self._named:
            raise ValueError(f"{self._path} has a pose relative to {shown(name)}; want a frame of the same model")
        child = self._named[first]
        if child.tag in ("frame", "joint"):
            return self._pose(child, steps)
        return self._inside(child, steps)._frame(rest, steps + 1)


def _model_name(include: Element) -> str:
    uri = (include.findtext("uri") or "").strip()
    return uri.removeprefix("model://").removeprefix("file://").strip("/")


def _included(path: Path, include: Element) -> Path:
    """Return the file of an included model, next to the world file or in a folder ``models`` next to it."""
    name = _model_name(include)
    file = _beside(path, name, "model.sdf") or _beside(path, name)
    if file is None:
        raise ValueError(
            f"{path} includes {shown(name)}, which is not there; want its folder beside the world or in models/"
        )
    return file


def _beside(path: Path, *parts: str) -> Path | None:
    """Return a file beside another one, in a folder ``models`` next to it, or in those around; None if absent."""
    if not parts[0] or any(".." in Path(part).parts or Path(part).is_absolute() for part in parts):
        return None
    folders = (path.parent, path.parent / "models", path.parent.parent, path.parent.parent / "models")
    return next((file for folder in folders if os.path.isfile(file := folder.joinpath(*parts))), None)


def _pose(path: Path, element: Element) -> Pose:
    """Return the pose of an element in the frame that it names: x, y, z, roll, pitch, yaw [m, rad]."""
    found = element.find("pose")
    text = "" if found is None else found.text or ""
    if found is not None and found.get("rotation_format") == "quat_xyzw":
        x, y, z, *quaternion = _numbers(path, text or "0 0 0 0 0 0 1", 7, "pose")
        pose = np.eye(4)
        pose[:3, :3] = scipy.spatial.transform.Rotation.from_quat(quaternion).as_matrix()
        pose[:3, 3] = x, y, z
        return pose
    x, y, z, roll, pitch, yaw = _numbers(path, text if text.strip() else "0 0 0 0 0 0", 6, "pose")
    if found is not None and found.get("degrees") in ("true", "1"):
        roll, pitch, yaw = (math.radians(angle) for angle in (roll, pitch, yaw))
    pose = np.eye(4)
    pose[:3, :3] = scipy.spatial.transform.Rotation.from_euler("xyz", [roll, pitch, yaw]).as_matrix()
    pose[:3, 3] = x, y, z
    return pose


def _add_shape(found: _Found, path: Path, name: str, geometry: Element, pose: Pose) -> None:
    """Add a shape to the content: a solid, or a mesh that is boxed or cannot be read."""
    if any(geometry.find(tag) is not None for tag in ("plane", "empty")):
        return
    mesh = geometry.find("mesh")
    if mesh is not None:
        uri = (mesh.findtext("uri") or "").strip()
        what = f"{name} ({printable(uri)})"
        corners = _mesh_box(path, mesh, uri)
        if corners is None:
            found.unread.append(what)
        elif (solid := _solid(corners @ pose[:3, :3].T + pose[:3, 3])) is not None:
            found.boxed.append(what)
            found.boxes.append(solid)
        return
    lines = [_prism(path, name, shape) for shape in geometry.findall("polyline")]
    if lines and abs(pose[2, 2]) > 1.0 - 1e-9:
        found.solids += _prisms([points @ pose[:3, :3].T + pose[:3, 3] for points in lines])
        return
    try:
        points = np.concatenate(lines) if lines else _points(path, name, geometry)
    except LookupError as error:
        found.unread.append(str(error.args[0]))
        return
    if (solid := _solid(points @ pose[:3, :3].T + pose[:3, 3])) is not None:
        found.solids.append(solid)


def _mesh_box(path: Path, mesh: Element, uri: str) -> NDArray[np.float64] | None:
    """Return the corners of the bounding box of a mesh in its frame, (8, 3) [m]; None if it cannot be read."""
    name = re.sub(r"^(model|file|package)://", "", uri).lstrip("/")
    file = _beside(path, name)
    if file is None or mesh.find("submesh") is not None:
        return None
    vertices = _vertices_of_mesh(file)
    if vertices is None:
        return None
    scale = np.array(_numbers(path, mesh.findtext("scale") or "1 1 1", 3, "scale of a mesh"))
    low, high = (vertices * scale).min(axis=0), (vertices * scale).max(axis=0)
    return np.stack(np.meshgrid(*zip(low, high, strict=True)), axis=-1).reshape(-1, 3)


def _solid(
    points: NDArray[np.float64],
    ring: NDArray[np.float64] | None = None,
    holes: tuple[NDArray[np.float64], ...] = (),
) -> Solid | None:
    """Return the prism of a ring, or around the points of a shape in the world, (n, 3); None if below the ground."""
    z_low, z_high = float(points[:, 2].min()), float(points[:, 2].max())
    if z_high <= GROUND_M:
        return None
    if ring is None:
        ring = np.asarray(cv2.convexHull(points[:, :2].astype(np.float32))[:, 0, :], np.float64)
    return Solid(ring, max(z_low, 0.0), max(z_high, max(z_low, 0.0) + 1e-3), holes)


def _prism(path: Path, name: str, line: Element) -> NDArray[np.float64]:
    """Return the ring of a polyline at the ground and at its height, (2 n, 3), in the shape's frame [m]."""
    ring = np.array([_numbers(path, each.text or "", 2, "point") for each in line.findall("point")])
    height = _numbers(path, line.findtext("height") or "1", 1, "height")[0]
    if len(ring) < 3:
        raise ValueError(f"{path}: {name} has a polyline of {len(ring)} points; want at least 3")
    return _between(ring, 0.0, height)


def _prisms(shapes: list[NDArray[np.float64]]) -> Iterator[Solid]:
    """Yield the solids of upright polylines in the world: those within another one are holes, and so on."""
    rings = [points[: len(points) // 2, :2] for points in shapes]
    contours = [ring.astype(np.float32) for ring in rings]
    around = [
        [
            k
            for k, contour in enumerate(contours)
            if k != number and cv2.pointPolygonTest(contour, ring[0].tolist(), measureDist=False) > 0
        ]
        for number, ring in enumerate(contours)
    ]
    for number, (points, ring) in enumerate(zip(shapes, rings, strict=True)):
        if len(around[number]) % 2 == 0:
            within = len(around[number]) + 1
            holes = [rings[k] for k, outer in enumerate(around) if number in outer and len(outer) == within]
            if (solid := _solid(points, ring, tuple(holes))) is not None:
                yield solid


def _points(path: Path, name: str, geometry: Element) -> NDArray[np.float64]:
    """Return points whose hull is a shape, (n, 3), in the shape's frame [m]."""
    for shape in geometry:
        if shape.tag == "box":
            size = _numbers(path, shape.findtext("size") or "", 3, "size of a box")
            corners = np.stack(np.meshgrid(*[(-0.5, 0.5)] * 3), axis=-1).reshape(-1, 3)
            return np.asarray(corners * size)
        if shape.tag in ("cylinder", "cone", "capsule"):
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
    kinds = ", ".join(printable(str(shape.tag)) for shape in geometry) or "nothing"
    raise LookupError(f"{name} ({kinds})")


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


def _vertices_of_mesh(path: Path) -> NDArray[np.float64] | None:
    """Return the vertices of a mesh, (n, 3) [m]; None if it is of another format."""
    if path.suffix.lower() not in (".stl", ".obj"):
        return None
    content = read_bytes(path, _MAX_MESH_BYTES)
    with reading(path, "a mesh"):
        count = int.from_bytes(content[80:_STL_HEADER], "little")
        if path.suffix.lower() == ".stl" and len(content) == _STL_HEADER + count * _STL_FACET:
            facets = np.frombuffer(content, np.dtype([("numbers", "<f4", 12), ("other", "<u2")]), offset=_STL_HEADER)
            vertices = facets["numbers"][:, 3:].reshape(-1, 3).astype(np.float64)
        else:
            vertices = np.array(_VERTICES.findall(content)).astype(np.float64).reshape(-1, 3)
        if not len(vertices) or not np.isfinite(vertices).all():
            raise ValueError("it has no vertices, or some that are not finite")
    return vertices
