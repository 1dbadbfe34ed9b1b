"""Picture of a merge: the overlaid maps of each group with matched corners.

Each group's maps have its colours.
"""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from lidarium.envs.drawing.rendering import Colour, team_colours
from lidarium.evaluation.drawing.plain_words import plain_words
from lidarium.evaluation.episodes.output import whole_file
from lidarium.mapping.files.map_files import FREE, OCCUPIED
from lidarium.mapping.merging.fusion import FusedMap
from lidarium.mapping.merging.merger import Merged

INK, SEVERAL = "#1f2937", np.array([31, 41, 55], np.uint8)
DPI = 130
_HEIGHT, _WIDEST = 7.0, 14.0
_MOST_LINES = 60


def save_merge_picture(path: Path, merged: Merged) -> None:
    """Draw each group of joined maps.

    Walls and free space have the colour of the map that saw them, walls that several saw are dark. Lines join
    the matched corners of each pair, as far apart as the maps' frames leave them.

    Parameters
    ----------
    path : Path
        The PNG file, written whole or not at all.
    merged : Merged
        What `merge_maps` found.
    """
    groups = [group for group in merged.groups() if len(group) > 1] or merged.groups()
    fused = [merged.fused(group) for group in groups]
    widths = [max(one.levels.shape[1] / one.levels.shape[0], 0.4) for one in fused]
    width = min(max(_HEIGHT * sum(widths), 5.0), _WIDEST)
    figure = Figure(figsize=(width, min(_HEIGHT, width / sum(widths)) + 0.8), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    names = list(merged.levels)
    colours = dict(zip(names, team_colours(len(names)), strict=True))
    axes_of_groups = figure.subplots(1, len(groups), width_ratios=widths, squeeze=False)[0]
    for axes, group, one in zip(axes_of_groups, groups, fused, strict=True):
        _draw_group(axes, merged, group, one, colours)
    with whole_file(path) as beside, plain_words(figure):
        figure.savefig(beside)


def _draw_group(
    axes: Axes, merged: Merged, group: list[str], fused: FusedMap, colours: dict[str, Colour]
) -> None:
    rows, columns = fused.levels.shape
    x, y = fused.origin
    extent = (x, x + columns * fused.resolution, y, y + rows * fused.resolution)
    axes.imshow(
        _coloured(fused, [colours[name] for name in group]),
        origin="lower",
        extent=extent,
        interpolation="nearest",
    )
    lines, walls_m = 0, 0.0
    for (a, b), result in merged.pairs.items():
        if result.is_accepted and a in group and b in group:
            first, second = merged.tree.lookup(group[0], a), merged.tree.lookup(group[0], b)
            assert first is not None and second is not None  # noqa: PT018
            ends = np.stack([first.apply(result.joined[0]), second.apply(result.joined[1])], axis=1)
            axes.plot(
                *ends.transpose(2, 1, 0),
                color="#e11d48",
                linewidth=1.2,
                marker="o",
                markersize=3.5,
                markerfacecolor="none",
            )
            lines += len(ends)
            walls_m += result.agreement.agreeing_m
    handles = [Patch(color="#{:02x}{:02x}{:02x}".format(*colours[name]), label=name) for name in group]
    axes.legend(
        handles=handles,
        loc="upper center",
        bbox_to_anchor=(0.5, -0.06),
        ncols=min(len(group), 4),
        frameon=False,
        fontsize=8,
    )
    found = f"{walls_m:.0f} m of walls agree, {lines} matched corners" if len(group) > 1 else "joins none"
    axes.set_title(
        f"{' + '.join(group) if len(group) <= 4 else f'{len(group)} maps'}: {found}", fontsize=9, color=INK
    )
    axes.set_xlabel(f"x in the frame of {group[0]} [m]", fontsize=8)
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
