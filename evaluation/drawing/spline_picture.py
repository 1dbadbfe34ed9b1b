"""Picture of a spline map over the true floor, with the robot's path.

The robot's tree is drawn if there is one.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from lidarium.envs.floors.floor import Floor
from lidarium.evaluation.drawing.picture_parts import (
    SOLID,
    box_around,
    drawn_together,
    rgb,
    save_titled_figure,
    show_cells,
)
from lidarium.mapping.splines.spline_map import SplineMap

CURVE_COLOURS = ("#2563eb", "#0d9488", "#7c3aed", "#c026d3")
CORNER_COLOUR, PEAK_COLOUR, TRUE_COLOUR, BELIEVED_COLOUR, TREE_COLOUR, GOAL_COLOUR = (
    "#dc2626",
    "#ea580c",
    "#6b7280",
    "#16a34a",
    "#92400e",
    "#d97706",
)
LASER_HEIGHT = 0.3
_SPACING = 0.02
_HEIGHT = 8.0
_TRUSTED = 3


def save_spline_picture(
    path: Path,
    floor: Floor,
    spline_map: SplineMap | None,
    true_path: NDArray[np.float64] | None = None,
    believed_path: NDArray[np.float64] | None = None,
    tree: Sequence[tuple[tuple[float, float], tuple[float, float]]] = (),
    title: str | None = None,
    safe_regions: Sequence[NDArray[np.float64]] = (),
) -> None:
    """Draw a spline map over the true floor.

    Parameters
    ----------
    spline_map : SplineMap or None
        The map; None to draw a tree alone.
    true_path, believed_path : (times, 2 or more) float64 or None
        Positions of the robot x, y first [m].
    tree : sequence of ((x, y), (x, y))
        Edges of an exploration tree, parent first [m].
    safe_regions : sequence of (n, 2) float64
        Outlines of the safe regions of the tree's nodes [m].
    """
    raster = floor.raster(0.01, LASER_HEIGHT, LASER_HEIGHT)
    box = box_around(raster.solid == 0, raster.origin, raster.resolution)
    figure = Figure(figsize=(max(_HEIGHT * box.aspect, 5.0) + 0.4, _HEIGHT + 1.0), layout="constrained")
    axes = figure.add_subplot()
    solid = drawn_together((raster.solid[box.rows, box.columns] != 0).astype(np.uint8))
    show_cells(axes, np.stack([rgb("#ffffff"), rgb(SOLID)])[solid], box, SOLID)
    handles = [
        *([] if spline_map is None else _draw_map(axes, spline_map)),
        *_draw_paths(axes, true_path, believed_path),
    ]
    if tree:
        handles.append(_draw_tree(axes, tree, safe_regions))
    if floor.goal is not None:
        goal = axes.plot(
            [floor.goal[0]],
            [floor.goal[1]],
            "*",
            color=GOAL_COLOUR,
            markersize=14,
            markeredgecolor="white",
            zorder=8,
        )
        goal[0].set_label("goal")
        handles += goal
    axes.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.05), ncols=3, frameon=False, fontsize=8.5)
    note = f"{len(safe_regions)} safe regions" if spline_map is None else _note(spline_map)
    save_titled_figure(path, figure, title or floor.name, note)


def _note(spline_map: SplineMap) -> str:
    controls = sum(len(curve.spline.control_points) for curve in spline_map.curves)
    return f"{len(spline_map.curves)} curves with {controls} control points, {spline_map.length:.1f} m of wall"


def _draw_tree(
    axes: Axes,
    tree: Sequence[tuple[tuple[float, float], tuple[float, float]]],
    safe_regions: Sequence[NDArray[np.float64]],
) -> Line2D:
    """Draw the edges, nodes and safe regions of a tree, and return its handle for the legend."""
    axes.add_collection(
        PolyCollection(list(safe_regions), facecolors=TREE_COLOUR, alpha=0.06, edgecolors="none", zorder=1)
    )
    axes.add_collection(LineCollection([np.array(edge) for edge in tree], colors=TREE_COLOUR, linewidths=1.1, zorder=4))
    nodes = np.array([point for edge in tree for point in edge])
    axes.plot(*nodes.T, "o", color=TREE_COLOUR, markersize=3.5, zorder=5)
    return Line2D([], [], color=TREE_COLOUR, marker="o", markersize=3.5, label="tree")


def _draw_map(axes: Axes, spline_map: SplineMap) -> list[Line2D]:
    """Draw curves in several colours, neighbours in different ones.

    Return entries of the legend.
    """
    for k, curve in enumerate(spline_map.curves):
        colour = CURVE_COLOURS[k % len(CURVE_COLOURS)]
        axes.plot(*curve.spline.sample(_SPACING).T, color=colour, linewidth=2.0, zorder=3, solid_capstyle="round")
        axes.plot(*curve.spline.control_points.T, ".", color=colour, markersize=3.0, alpha=0.6, zorder=3)
    for marks, marker, colour in (
        (spline_map.corners, "^", CORNER_COLOUR),
        (spline_map.peaks, "s", PEAK_COLOUR),
    ):
        trusted = marks.points[marks.counts >= _TRUSTED]
        axes.plot(*trusted.T, marker, color=colour, markersize=5, zorder=6)
    return [
        Line2D([], [], color=CURVE_COLOURS[0], linewidth=2.0, marker=".", label="curves and control points"),
        Line2D([], [], color=CORNER_COLOUR, marker="^", linestyle="none", label="corners"),
        Line2D([], [], color=PEAK_COLOUR, marker="s", linestyle="none", label="peaks"),
    ]


def _draw_paths(
    axes: Axes, true_path: NDArray[np.float64] | None, believed_path: NDArray[np.float64] | None
) -> list[Line2D]:
    handles: list[Line2D] = []
    for points, colour, style, label in (
        (true_path, TRUE_COLOUR, "-", "true path"),
        (believed_path, BELIEVED_COLOUR, "--", "believed path"),
    ):
        if points is not None:
            handles += axes.plot(points[:, 0], points[:, 1], style, color=colour, linewidth=1.2, zorder=4, label=label)
    return handles
