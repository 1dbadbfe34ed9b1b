"""Style of the plots of a report: colours, axes and legends.

The colours can be distinguished by the colour-blind.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from numpy.typing import ArrayLike

from lidarium.envs.drawing.rendering import team_colours
from lidarium.evaluation.drawing.picture_parts import FAINT, INK, save_figure

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#4b4b4b")
"""Colours of Okabe and Ito, Color universal design (2008), without yellow.

Yellow is pale on white.
"""

DASHES = ("-", "--", "-.", (0, (1, 1.2)), (0, (5, 1, 1, 1, 1, 1)), (0, (7, 2)), (0, (3, 1, 1, 1)))
GRID, FRAME = "#e5e7eb", "#d1d5db"


def colours(count: int) -> list[str]:
    """Return colours for policies or robots, first those that all can distinguish."""
    return [*COLOURS, *(f"#{red:02x}{green:02x}{blue:02x}" for red, green, blue in team_colours(count))][:count]


def dash(index: int) -> Any:  # noqa: ANN401
    """Return the line style of a policy, so that lines differ without colour, too."""
    return DASHES[index % len(DASHES)]


def dress(axes: Axes, title: str, x_label: str, y_label: str) -> None:
    """Give axes a title, labels, a pale grid, and no frame above and to the right."""
    axes.set_title(title, loc="left", fontsize=10.5, color=INK)
    axes.set_xlabel(x_label, fontsize=9, color=FAINT)
    axes.set_ylabel(y_label, fontsize=9, color=FAINT)
    axes.tick_params(colors=FAINT, labelsize=8.5)
    axes.grid(color=GRID, linewidth=0.8)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(FRAME)


def band(
    axes: Axes,
    x: ArrayLike,
    low: ArrayLike,
    high: ArrayLike,
    colour: str,
    step: Literal["pre", "post", "mid"] | None = None,
) -> None:
    """Shade an interval, with thin edges that show overlaps."""
    appearance: dict[str, Any] = {"facecolor": f"{colour}1f", "edgecolor": f"{colour}80", "linewidth": 0.7}
    axes.fill_between(np.asarray(x), np.asarray(low), np.asarray(high), step=step, **appearance)


def save(path: Path, figure: Figure, title: str, subtitle: str = "") -> None:
    """Write a figure with a title and, below it, an explanation."""
    height = figure.get_figheight()
    figure.text(0.012, 1.0 - 0.12 / height, title, ha="left", va="top", fontsize=13, fontweight="bold", color=INK)
    figure.text(0.012, 1.0 - 0.40 / height, subtitle, ha="left", va="top", fontsize=9, color=FAINT)
    engine = figure.get_layout_engine()
    if isinstance(engine, ConstrainedLayoutEngine):
        engine.set(rect=(0.0, 0.0, 1.0, 1.0 - 0.66 / height))
    save_figure(path, figure)


def legend(figure: Figure, names: Sequence[str], handles: Sequence[Artist]) -> None:
    """Put one legend below all axes, in as many columns as there is room for."""
    # Width of the longest entry [inch] at this size of letters, line and gaps included.
    width = 0.072 * max(len(name) for name in names) + 0.66
    most = max(int((figure.get_figwidth() - 0.2) / width), 1)
    lines = -(-len(names) // most)
    columns = -(-len(names) // lines)
    figure.legend(
        list(handles),
        list(names),
        loc="outside lower left",
        ncols=columns,
        frameon=False,
        fontsize=9,
        labelcolor=INK,
        handlelength=2.4,
    )
