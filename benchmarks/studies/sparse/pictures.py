"""Curves of errors over codes, and of paths over the distance that they bridge."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from lidarium.benchmarks.studies.sparse.paths import COLLIDES, DISPERSION, LENGTH, SECONDS, TURNING
from lidarium.benchmarks.studies.sparse.tables import answered, answers_of
from lidarium.evaluation.drawing.style import colours, dash, dress
from lidarium.mapping.files.output import whole_file

Line = Mapping[str, Any]

TITLES = {"kmeans": "K-means", "lbg": "LBG", "kmeans++": "K-means++"}
PLANNERS = {
    "grid": "OctoMap, projected",
    "incremental": "sparse, incremental",
    "full": "sparse, full",
    "thesis incremental": "thesis's form, incremental",
    "thesis full": "thesis's form, full",
}
BIN_M = 1.0
LEAST_IN_BIN = 20
PANELS = (
    ("Length", "m", LENGTH, 1.0),
    ("Time", "ms", SECONDS, 1e3),
    ("Dispersion", "m", DISPERSION, 1.0),
    ("Turning", "rad", TURNING, 1.0),
    ("Paths that collide", "%", COLLIDES, 100.0),
)


def draw_errors(path: Path, lines: Sequence[Line]) -> None:
    """Draw mean distances and times over the number of codes, a column for each kind of clouds."""
    kinds = list(dict.fromkeys(line["kind"] for line in lines))
    figure = Figure(figsize=(3.4 * len(kinds), 6.0), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(2, len(kinds), squeeze=False)
    for column, kind in enumerate(kinds):
        own = [line["figures"] for line in lines if line["kind"] == kind]
        for number, (method, title) in enumerate(TITLES.items()):
            mean = np.mean([figures[method] for figures in own], axis=0)
            for row, (place, unit) in enumerate(((1, 1.0), (3, 1e3))):
                panels[row, column].plot(
                    mean[:, 0],
                    mean[:, place] * unit,
                    color=colours(3)[number],
                    linestyle=dash(number),
                    marker="o" if method == "lbg" else None,
                    markersize=3,
                    label=title,
                )
        dress(panels[0, column], kind, "codes", "mean distance [m]")
        dress(panels[1, column], "", "codes", "time [ms]")
        panels[0, column].set_yscale("log")
        panels[0, column].set_xscale("log", base=2)
    panels[0, 0].legend(fontsize=8, frameon=False)
    with whole_file(path) as beside:
        figure.savefig(beside)


def draw_paths(path: Path, lines: Sequence[Line]) -> None:
    """Draw what is measured of paths over the straight distance of their ends, of all places."""
    straight = np.concatenate([line["straight"] for line in lines])
    bins = np.floor(straight / BIN_M).astype(np.int64)
    figure = Figure(figsize=(12.0, 6.4), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(2, 3).ravel()
    for number, (name, title) in enumerate(PLANNERS.items()):
        values = np.concatenate([answers_of(line, name) for line in lines])
        has = np.concatenate([answered(line, name) for line in lines])
        for axes, (_, _, column, unit) in zip(panels, PANELS, strict=False):
            drawn = [bins == place for place in range(int(bins.max()) + 1)]
            drawn = [part & has for part in drawn if (part & has).sum() >= LEAST_IN_BIN]
            middles = [straight[part].mean() for part in drawn]
            # A median time is not that of what else the machine did.
            middle_of = np.median if column == SECONDS else np.mean
            drawn_values = [middle_of(values[part, column]) * unit for part in drawn]
            axes.plot(middles, drawn_values, color=colours(5)[number], linestyle=dash(number), label=title)
    for axes, (title, shown, _, _) in zip(panels, PANELS, strict=False):
        dress(axes, title, "straight distance [m]", shown)
    panels[1].set_yscale("log")
    panels[-1].axis("off")
    handles, labels = panels[0].get_legend_handles_labels()
    panels[-1].legend(handles, labels, loc="center", fontsize=10, frameon=False)
    with whole_file(path) as beside:
        figure.savefig(beside)
