"""Pictures of merges: the maps of each group and of each refused pair, with agreement and contradictions.

Each map has its colour; maps are laid over each other rigidly or bent.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.transforms import Affine2D
from numpy.typing import NDArray

from lidarium.envs.drawing.rendering import Colour, team_colours
from lidarium.evaluation.drawing.picture_parts import plain_words
from lidarium.mapping.files.guarded_reading import shortened
from lidarium.mapping.files.output import whole_file
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import FREE, OCCUPIED, UNKNOWN
from lidarium.mapping.merging.bend.deforming import Deformed, Laid
from lidarium.mapping.merging.fusion import FusedMap, fuse
from lidarium.mapping.merging.joining import Merged

MOST_PANELS = 6
"""Maximum number of panels of a picture."""

MISS_M = 0.15
"""A wall contradicts if all within this distance is free [m]."""

_MOST_TITLE = 60


@dataclass(frozen=True, slots=True, eq=False)
class _Panel:
    """Maps that are drawn over each other.

    Attributes
    ----------
    names : list of str
        The maps; the drawing is in the frame of the first.
    layers : list of Laid
        Each map as drawn in the cells of that frame, bent if it was.
    title : str
        Text below them.
    matched : list of (n, 2, 2) float64
        Matched corners of pairs of them, in the first map's frame [m].
    """

    names: list[str]
    layers: list[Laid]
    title: str
    matched: list[NDArray[np.float64]]


def panels_of(merged: Merged, deformed: Sequence[Deformed] = ()) -> list[_Panel]:
    """Return the panels: joined groups and refused pairs of maps outside them, otherwise the maps alone."""
    known = {name for name, levels in merged.levels.items() if (levels != UNKNOWN).any()}
    groups = [group for group in merged.groups() if len(group) > 1]
    if deformed:
        panels = [_bent_panel(merged, *each) for each in zip(groups, deformed, strict=True)]
    else:
        panels = [_group_panel(merged, group) for group in groups]
    joined = {name for panel in panels for name in panel.names}
    for (a, b), result in merged.pairs.items():
        is_refused = {a, b} <= known and not {a, b} <= joined
        if len(panels) < MOST_PANELS and is_refused and result.a_from_b is not None:
            title = f"refused, {shortened(result.reason, _MOST_TITLE)}"
            layers = [Laid(merged.levels[a], Transform()), Laid(merged.levels[b], result.a_from_b)]
            panels.append(_Panel([a, b], layers, title, []))
    return panels or [
        _Panel([name], [Laid(merged.levels[name], Transform())], "joins none", [])
        for name in sorted(known)[:MOST_PANELS]
    ]


def contradicting(layers: Sequence[Laid], resolution: float) -> NDArray[np.float64]:
    """Return the walls that lie in free space of another map, in the common frame (n, 2) [m]."""
    found = [
        one.common_from_cells.apply(_against(one, other, resolution))
        for one in layers
        for other in layers
        if one is not other
    ]
    return np.concatenate(found) if found else np.zeros((0, 2))


def _group_panel(merged: Merged, group: list[str]) -> _Panel:
    """Return a group as its maps were joined."""
    layers = [Laid(merged.levels[name], merged.tree.lookup(group[0], name) or Transform()) for name in group]
    matched, walls_m = [], 0.0
    for (a, b), result in merged.pairs.items():
        if result.is_accepted and a in group and b in group:
            ends = [
                layers[group.index(name)].common_from_cells.apply(points)
                for name, points in zip((a, b), result.joined, strict=True)
            ]
            matched.append(np.stack(ends, axis=1))
            walls_m += result.agreement.agreeing_m
    title = f"{walls_m:.0f} m of walls agree, {sum(map(len, matched))} matched corners"
    return _Panel(group, layers, title, matched)


def _bent_panel(merged: Merged, group: list[str], deformed: Deformed) -> _Panel:
    """Return a group as its maps were bent; matched corners move with them."""
    bent = [one for one in deformed.deformations if one is not None]
    if not bent:
        return _group_panel(merged, group)
    matched = []
    for (a, b), result in merged.pairs.items():
        if result.is_accepted and a in group and b in group:
            ends = [
                deformed.places(group.index(name), points) for name, points in zip((a, b), result.joined, strict=True)
            ]
            matched.append(np.stack(ends, axis=1))
    walls_m, most_m = sum(one.agreement.agreeing_m for one in bent), max(one.most_m for one in bent)
    title = f"bent by {most_m:.2f} m at most, {walls_m:.0f} m of walls agree then"
    return _Panel(group, deformed.laid, title, matched)


def _against(one: Laid, other: Laid, resolution: float) -> NDArray[np.float64]:
    """Return the walls of a map that lie in free space of another one, in its own metres (n, 2)."""
    walls = np.argwhere(one.levels == OCCUPIED)[:, ::-1] + 0.5
    other_from_one = other.common_from_cells.inverse() @ one.common_from_cells
    cells = np.floor(other_from_one.apply(walls * resolution) / resolution).astype(np.int64)
    rows, columns = other.levels.shape
    is_on = (cells >= 0).all(axis=1) & (cells[:, 0] < columns) & (cells[:, 1] < rows)
    walls, cells = walls[is_on], cells[is_on]
    clear = cv2.distanceTransform((other.levels == FREE).astype(np.uint8), cv2.DIST_L2, 5)
    reach = max(MISS_M / resolution, 1.5)
    return np.asarray(walls[clear[cells[:, 1], cells[:, 0]] > reach] * resolution)


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

    Walls and free space have the colour of the map that saw them, walls that several saw are dark, and walls that lie
    in free space of another map are red. Lines join the matched corners of each pair, as far apart as the maps'
    frames leave them. Axes are those of the ROS frame of each panel's first map.
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
    panel: _Panel,
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
    """Return the map in colours of the robots that saw each cell, shape (rows, columns, 3)."""
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
