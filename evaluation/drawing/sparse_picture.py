"""Pictures of sparse maps: their boxes, free codes, graph and path, in the plane and in space."""

import math
from pathlib import Path

import imageio.v3 as imageio
import numpy as np
from matplotlib import colormaps
from matplotlib.collections import LineCollection, PatchCollection
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from lidarium.envs.drawing.shading import Viewpoint, shade
from lidarium.envs.floors.faces import GROUND, Faces
from lidarium.evaluation.drawing.picture_parts import INK
from lidarium.mapping.files.output import whole_file
from lidarium.mapping.sparse.graph import TopologicalGraph

OUTERMOST = 0.005
"""Share of the codes on each side that may lie outside of a picture."""

MARGIN_M = 0.4
"""Margin around the codes [m]."""

PATH_COLOUR = "#dc2626"
_PATH_RGB = (220, 38, 38)
_SIZE = 720, 960
_SIDES = ((0, 1, 5, 4), (1, 3, 7, 5), (3, 2, 6, 7), (2, 0, 4, 6), (4, 5, 7, 6), (1, 0, 2, 3))
"""Corners of a box's faces, counter-clockwise seen from the outside; bits 0 to 2 of a corner are x, y, z."""


def picture_paths(path: Path) -> tuple[Path, Path]:
    """Return the files of the pictures of a sparse map, from above and in space."""
    return path.with_suffix(".png"), path.with_name(f"{path.stem}_3d.png")


def save_sparse_pictures(
    path: Path,
    boxes: NDArray[np.float64],
    free: NDArray[np.float64],
    graph: TopologicalGraph | None = None,
    way: NDArray[np.float64] | None = None,
) -> list[str]:
    """Draw a sparse map next to its file, from above and in space.

    Parameters
    ----------
    boxes : (M, 2, 3) float64
        Occupied codes [m].
    free : (N, 3) float64
        Free codes [m].
    way : (P, 3) float64 or None
        A path [m].
    """
    plane, space = picture_paths(path)
    _save_plane(plane, boxes, free, graph, way)
    with whole_file(space) as beside:
        imageio.imwrite(beside, _in_space(boxes, free, way), extension=".png")
    return [str(plane), str(space)]


def _save_plane(
    path: Path,
    boxes: NDArray[np.float64],
    free: NDArray[np.float64],
    graph: TopologicalGraph | None,
    way: NDArray[np.float64] | None,
) -> None:
    low, high = _extent(boxes, free)
    size = np.maximum(high - low, 1.0)
    figure = Figure(figsize=(9.0, min(max(9.0 * size[1] / size[0], 4.0), 14.0)), layout="constrained")
    axes = figure.subplots()
    order = np.argsort(boxes[:, 1, 2], kind="stable")
    patches = [Rectangle(tuple(box[0, :2]), *(box[1, :2] - box[0, :2])) for box in boxes[order]]
    # Walls that were measured exactly have no thickness: their outlines show them.
    heights = PatchCollection(patches, cmap="viridis_r", alpha=0.75, linewidth=1.0, edgecolor="face")
    heights.set_array(boxes[order, 1, 2])
    axes.add_collection(heights)
    if graph is not None:
        ends = graph.nodes[graph.edges][:, :, :2]
        axes.add_collection(LineCollection(list(ends), colors="#94a3b8", linewidths=0.35))
    axes.plot(*free[:, :2].T, ".", color="#2563eb", markersize=2.0)
    if way is not None and len(way):
        axes.plot(*way[:, :2].T, "-o", color=PATH_COLOUR, linewidth=2.0, markersize=3.5)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), xlabel="x [m]", ylabel="y [m]", aspect="equal")
    axes.tick_params(colors=INK)
    if len(boxes):
        figure.colorbar(heights, ax=axes, label="top of boxes [m]", shrink=0.8)
    with whole_file(path) as beside:
        figure.savefig(beside, format="png", dpi=120)


def _extent(boxes: NDArray[np.float64], free: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the low and the high corner of a picture [m]: all but the outermost codes."""
    points = np.concatenate([boxes.reshape(-1, 3), free, np.zeros((0, 3))])[:, :2]
    if len(points) == 0:
        return np.zeros(2), np.ones(2)
    low, high = np.quantile(points, [OUTERMOST, 1.0 - OUTERMOST], axis=0)
    return low - MARGIN_M, high + MARGIN_M


def _in_space(
    boxes: NDArray[np.float64], free: NDArray[np.float64], way: NDArray[np.float64] | None
) -> NDArray[np.uint8]:
    """Return a picture of the boxes over their floor from above, (rows, columns, 3)."""
    low, high = _extent(boxes, free)
    floor = float(np.median(free[:, 2])) if len(free) else 0.0
    ground = np.array([[(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])]])
    ground = np.concatenate([ground, np.full((1, 4, 1), floor)], axis=2)
    ribbon = _ribbon(way, floor) if way is not None and len(way) > 1 else np.zeros((0, 2, 3))
    both = np.concatenate([boxes, ribbon])
    corners = np.concatenate([ground, faces_of_boxes(both)])
    owners = np.concatenate([[GROUND], np.repeat(np.arange(len(both)), len(_SIDES))]).astype(np.int32)
    faces = Faces.of_corners(corners, owners)
    middle = np.array([*(low + high) / 2.0, floor])
    pitch, field_of_view = math.radians(55.0), math.radians(35.0)
    across = max(high[0] - low[0], (high[1] - low[1]) * _SIZE[1] / _SIZE[0] * math.sin(pitch))
    away = 0.62 * across / math.tan(0.5 * field_of_view) + 0.3 * (high[1] - low[1])
    eye = middle + away * np.array([0.0, -math.cos(pitch), math.sin(pitch)])
    tops = both[:, 1, 2] - floor
    shades = colormaps["viridis_r"](np.clip(tops / max(float(tops.max(initial=0.1)), 0.1), 0.0, 1.0))[:, :3] * 255.0
    shades[len(boxes) :] = _PATH_RGB
    return shade(faces, Viewpoint.towards(eye, middle, field_of_view), _SIZE, np.zeros((0, 5)), [], shades)


def _ribbon(way: NDArray[np.float64], floor: float) -> NDArray[np.float64]:
    """Return small boxes along a path (P, 3), just above the floor."""
    lengths = np.linalg.norm(np.diff(way[:, :2], axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    places = np.arange(0.0, along[-1] + 0.04, 0.04)
    x, y = (np.interp(places, along, way[:, axis]) for axis in (0, 1))
    points = np.stack([x, y, np.full(len(x), floor + 0.02)], axis=1)
    half = np.array([0.035, 0.035, 0.02])
    return np.stack([points - half, points + half], axis=1)


def faces_of_boxes(boxes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the faces of boxes (N, 2, 3), (6 N, 4, 3) [m]."""
    corner = np.arange(8)
    picked = np.stack([corner & 1, corner >> 1 & 1, corner >> 2 & 1], axis=1)
    corners = np.take_along_axis(boxes, picked[None], axis=1)
    return np.asarray(corners[:, np.array(_SIDES)].reshape(-1, 4, 3))
