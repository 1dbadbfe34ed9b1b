"""Picture of the regions of maps and of the doors between them."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.transforms import Affine2D
from numpy.typing import NDArray

from lidarium.envs.drawing.rendering import team_colours
from lidarium.evaluation.drawing.picture_parts import plain_words
from lidarium.mapping.files.output import whole_file
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import OCCUPIED
from lidarium.mapping.merging.regions.graph import RegionGraph
from lidarium.mapping.merging.regions.segmentation import NONE

INK, DOOR = "#1f2937", "#e11d48"
DPI = 130
_SIDE, _MOST_COLUMNS, _MOST_MAPS = 5.5, 3, 12


@dataclass(frozen=True, slots=True, eq=False)
class RegionMap:
    """A map with its regions.

    Attributes
    ----------
    levels : (rows, columns) uint8
        Known cells.
    resolution : float
        Side of its cells [m].
    graph : RegionGraph
        Its regions and doors.
    corner : Transform
        Position of its lower left corner in its ROS frame.
    """

    levels: NDArray[np.uint8]
    resolution: float
    graph: RegionGraph
    corner: Transform


def save_region_picture(path: Path, maps: Mapping[str, RegionMap]) -> None:
    """Draw the regions of maps in colours, with their areas, and doors as bars across their gaps.

    Axes are those of each map's ROS frame; of many maps the first are drawn.
    """
    shown = list(maps.items())[:_MOST_MAPS]
    columns = min(len(shown), _MOST_COLUMNS)
    rows = -(-len(shown) // columns)
    figure = Figure(figsize=(_SIDE * columns, _SIDE * rows), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    every = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes, (name, one) in zip(every, shown, strict=False):
        _draw_map(axes, name, one)
    for axes in every[len(shown) :]:
        axes.set_axis_off()
    with whole_file(path) as beside, plain_words(figure):
        figure.savefig(beside)


def door_ends(graph: RegionGraph) -> NDArray[np.float64]:
    """Return the two ends of each door's gap in the map's frame, (n, 2, 2) [m]."""
    doors = graph.doors
    across = np.column_stack([-np.sin(doors.normals), np.cos(doors.normals)])
    half = 0.5 * doors.widths[:, None] * across
    return np.stack([doors.places - half, doors.places + half], axis=1)


def _draw_map(axes: Axes, name: str, one: RegionMap) -> None:
    graph, corner = one.graph, one.corner
    turn = Affine2D().rotate(corner.theta).translate(corner.x, corner.y)
    for picture, side, origin in (
        (_walls(one.levels), one.resolution, (0.0, 0.0)),
        (_coloured(graph), graph.resolution, graph.corner),
    ):
        rows, columns = picture.shape[:2]
        box = (origin[0], origin[0] + columns * side, origin[1], origin[1] + rows * side)
        axes.imshow(
            picture,
            origin="lower",
            extent=box,
            interpolation="nearest",
            transform=turn + axes.transData,
        )
    rows, columns = graph.labels.shape
    ends = np.array([(0.0, 0.0), (columns, 0.0), (0.0, rows), (columns, rows)]) * graph.resolution
    rim = corner.apply(ends + graph.corner)
    margin = 2.0 * graph.resolution
    axes.set_xlim(rim[:, 0].min() - margin, rim[:, 0].max() + margin)
    axes.set_ylim(rim[:, 1].min() - margin, rim[:, 1].max() + margin)
    axes.set_aspect("equal")
    for line in corner.apply(door_ends(graph).reshape(-1, 2)).reshape(-1, 2, 2):
        axes.plot(*line.T, color=DOOR, linewidth=2.5, solid_capstyle="butt")
    for (x, y), area in zip(corner.apply(graph.centres).tolist(), graph.areas, strict=True):
        axes.text(x, y, f"{area:.0f} m²", ha="center", va="center", fontsize=7, color=INK, clip_on=True)
    count = len(graph.doors.widths)
    axes.set_title(f"{name}: {len(graph)} regions, {count} doors", fontsize=9, color=INK)
    axes.set_xlabel(f"x in the frame of {name} [m]", fontsize=8)
    axes.tick_params(labelsize=8)


def _walls(levels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the walls of a map as dark pixels on light ones, (rows, columns, 3)."""
    return np.repeat(np.where(levels == OCCUPIED, 31, 240).astype(np.uint8)[..., None], 3, axis=2)


def _coloured(graph: RegionGraph) -> NDArray[np.uint8]:
    """Return the regions in light colours, clear elsewhere, (rows, columns, 4)."""
    colours = np.zeros((len(graph) + 1, 4), np.uint8)
    colours[: len(graph), :3] = 255 - (255 - np.array(team_colours(len(graph)), int).reshape(-1, 3)) // 3
    colours[: len(graph), 3] = 255
    # The last colour is that of cells in no region.
    return colours[np.where(graph.labels == NONE, len(graph), graph.labels)]
