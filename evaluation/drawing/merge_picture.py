"""Picture of a merge: the maps of each group and of each refused pair, with what agrees and contradicts.

Each map has its colour.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.transforms import Affine2D
from numpy.typing import NDArray

from lidarium.envs.drawing.rendering import Colour, team_colours
from lidarium.evaluation.drawing.maps.merge_panels import Panel, contradicting, panels_of
from lidarium.evaluation.drawing.plain_words import plain_words
from lidarium.mapping.files.output import whole_file
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import FREE, OCCUPIED
from lidarium.mapping.merging.bend.deforming import Deformed
from lidarium.mapping.merging.fusion import FusedMap, fuse
from lidarium.mapping.merging.joining.merged_maps import Merged

INK, SEVERAL = "#1f2937", np.array([31, 41, 55], np.uint8)
DPI = 130
_HEIGHT, _WIDEST = 7.0, 14.0
_MOST_COLUMNS = 3

_MATCHED: dict[str, Any] = {
    "color": "#e11d48",
    "linewidth": 1.2,
    "marker": "o",
    "markersize": 3.5,
    "markerfacecolor": "none",
}


def save_merge_picture(
    path: Path, merged: Merged, corners: Mapping[str, Transform], deformed: Sequence[Deformed] = ()
) -> None:
    """Draw each group of joined maps, and each refused pair as it would lie best.

    Walls and free space have the colour of the map that saw them, walls that several saw are dark, and walls
    that stand where another map is free are red. Lines join the matched corners of each pair, as far apart as
    the maps' frames leave them. Axes are those of the ROS frame of each panel's first map.

    Parameters
    ----------
    path : Path
        The PNG file, written whole or not at all.
    merged : Merged
        What `merge_maps` found.
    corners : mapping of str to Transform
        From cells' metres into each map's ROS frame.
    deformed : sequence of Deformed
        How each group of two maps or more was bent: it is drawn so, with what agrees and contradicts then.
    """
    panels = panels_of(merged, deformed)
    if not panels:
        _save_nothing(path)
        return
    fused = [
        fuse(
            [one.levels for one in panel.layers],
            [one.common_from_cells for one in panel.layers],
            merged.resolution,
        )
        for panel in panels
    ]
    columns = min(len(panels), _MOST_COLUMNS)
    rows = -(-len(panels) // columns)
    ratio = max(one.levels.shape[1] / one.levels.shape[0] for one in fused)
    width = min(max(_HEIGHT * max(ratio, 0.4) * columns, 5.0), _WIDEST)
    height = min(_HEIGHT, max(width / columns / ratio, 2.0)) + 0.8
    figure = Figure(figsize=(width, height * rows), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    names = list(merged.levels)
    colours = dict(zip(names, team_colours(len(names)), strict=True))
    every = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes, panel, one in zip(every, panels, fused, strict=False):
        _draw_panel(axes, panel, one, (colours, corners[panel.names[0]]))
    for axes in every[len(panels) :]:
        axes.set_axis_off()
    with whole_file(path) as beside, plain_words(figure):
        figure.savefig(beside)


def _save_nothing(path: Path) -> None:
    """Draw that there is nothing to draw."""
    figure = Figure(figsize=(5.0, 1.0), dpi=DPI)
    FigureCanvasAgg(figure)
    figure.text(0.5, 0.5, "none of the maps knows anything", ha="center", va="center", color=INK)
    with whole_file(path) as beside:
        figure.savefig(beside)


def _draw_panel(
    axes: Axes,
    panel: Panel,
    fused: FusedMap,
    style: tuple[dict[str, Colour], Transform],
) -> None:
    colours, corner = style
    rows, columns = fused.levels.shape
    x, y = fused.origin
    right, top = x + columns * fused.resolution, y + rows * fused.resolution
    turn = Affine2D().rotate(corner.theta).translate(corner.x, corner.y)
    axes.imshow(
        _coloured(fused, [colours[name] for name in panel.names]),
        origin="lower",
        extent=(x, right, y, top),
        interpolation="nearest",
        transform=turn + axes.transData,
    )
    rim = corner.apply(np.array([(x, y), (right, y), (x, top), (right, top)]))
    axes.set_xlim(rim[:, 0].min(), rim[:, 0].max())
    axes.set_ylim(rim[:, 1].min(), rim[:, 1].max())
    for ends in panel.matched:
        axes.plot(*corner.apply(ends.reshape(-1, 2)).reshape(-1, 2, 2).transpose(2, 1, 0), **_MATCHED)
    places = corner.apply(contradicting(panel.layers, fused.resolution))
    axes.plot(*places.T, linestyle="none", marker="s", markersize=1.0, color="#dc2626", zorder=3)
    handles = [Patch(color="#{:02x}{:02x}{:02x}".format(*colours[name]), label=name) for name in panel.names]
    handles += [Patch(color=INK, label="agrees"), Patch(color="#dc2626", label="contradicts")]
    axes.legend(
        handles=handles,
        loc="upper center",
        bbox_to_anchor=(0.5, -0.06),
        ncols=min(len(handles), 4),
        frameon=False,
        fontsize=8,
    )
    names = " + ".join(panel.names) if len(panel.names) <= 4 else f"{len(panel.names)} maps"
    axes.set_title(f"{names}: {panel.title}", fontsize=9, color=INK)
    axes.set_xlabel(f"x in the frame of {panel.names[0]} [m]", fontsize=8)
    axes.tick_params(labelsize=8)


def _coloured(fused: FusedMap, colours: list[Colour]) -> NDArray[np.uint8]:
    """Return the map in colours of who saw what, shape (rows, columns, 3)."""
    counts = np.bitwise_count(fused.sources)
    total = np.zeros((*fused.levels.shape, 3))
    for index, colour in enumerate(colours):
        total[(fused.sources >> np.uint64(index) & np.uint64(1)).astype(np.bool_)] += colour
    mean = total / np.maximum(counts, 1)[..., None]
    picture = np.full((*fused.levels.shape, 3), 240.0)
    is_free, is_wall = fused.levels == FREE, fused.levels == OCCUPIED
    picture[is_free] = 255.0 - 0.25 * (255.0 - mean[is_free])
    picture[is_wall] = mean[is_wall]
    picture[is_wall & (counts > 1)] = SEVERAL
    return picture.astype(np.uint8)
