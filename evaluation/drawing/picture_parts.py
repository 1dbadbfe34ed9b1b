"""Parts of pictures, drawn from plain arrays: layout, cells of a floor, paths, coverage, lists of robots."""

import io
import math
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch
from matplotlib.patheffects import Normal, Stroke
from matplotlib.text import Text
from numpy.typing import NDArray

from lidarium.envs.drawing.frame_parts import DOOR, PERSON, Colour, team_colours
from lidarium.envs.drawing.prediction_layer import STRENGTH, tinted
from lidarium.envs.simulation.people.crowd import Crowd
from lidarium.mapping.files.guarded_reading import printable
from lidarium.mapping.files.output import whole_file


@contextmanager
def plain_words(figure: Figure) -> Iterator[None]:
    """Draw all texts of a figure literally: a name with ``$`` is no formula."""
    # Labels of ticks are made only when a figure is drawn.
    with rc_context({"text.parse_math": False}), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing from", UserWarning)
        for text in figure.findobj(Text):
            text.set_parse_math(False)
            text.set_text("\n".join(map(printable, text.get_text().split("\n"))))
        yield


INK, FAINT, SOLID = "#1f2937", "#6b7280", "#b6bec9"
DPI = 130
_COVERAGE = "#16a34a"
_LISTED_ROBOTS = 16
_WIDE = 2.1
_MOST_PIXELS = 3000
_MARGIN = 0.15


@dataclass(frozen=True, slots=True)
class _Box:
    """Part of a raster to show: rows, columns and extent [m].

    The extent is (x_min, x_max, y_min, y_max).
    """

    rows: slice
    columns: slice
    extent: tuple[float, float, float, float]

    @property
    def aspect(self) -> float:
        """Width over height."""
        x_min, x_max, y_min, y_max = self.extent
        return (x_max - x_min) / (y_max - y_min)


def box_around(free: NDArray[np.bool_], origin: tuple[float, float], resolution: float) -> _Box:
    """Return the part of a raster around the cells of a mask (rows, columns).

    The mask marks the cells that should be visible.
    """
    spans, limits = [], []
    for axis in (1, 0):
        used = np.flatnonzero(free.any(axis=axis))
        margin = math.ceil(_MARGIN / resolution)
        low, high = max(int(used[0]) - margin, 0), min(int(used[-1]) + 1 + margin, free.shape[1 - axis])
        spans.append(slice(low, high))
        limits.append((origin[axis] + low * resolution, origin[axis] + high * resolution))
    return _Box(spans[0], spans[1], (*limits[1], *limits[0]))


def page(aspect: float) -> tuple[Figure, Axes, Axes, Axes]:
    """Arrange a picture: the floor, the curve and the team.

    The curve and the team are at the side of the floor, or below it if it is wide.
    """
    if aspect > _WIDE:
        width = 14.0
        height = width / min(aspect, 8.0) + 1.0
        figure = Figure(figsize=(width, height + 3.4), layout="constrained")
        grid = figure.add_gridspec(2, 2, height_ratios=(height, 2.6), width_ratios=(1.3, 1.0))
        return (
            figure,
            figure.add_subplot(grid[0, :]),
            figure.add_subplot(grid[1, 0]),
            figure.add_subplot(grid[1, 1]),
        )
    height = 8.0 if aspect > 1.0 else 9.0
    width = max(height * aspect, 5.0)
    figure = Figure(figsize=(width + 4.6, height + 0.6), layout="constrained")
    grid = figure.add_gridspec(2, 2, height_ratios=(1.0, 1.25), width_ratios=(width, 4.2))
    return (
        figure,
        figure.add_subplot(grid[:, 0]),
        figure.add_subplot(grid[0, 1]),
        figure.add_subplot(grid[1, 1]),
    )


def save_titled_figure(path: Path, figure: Figure, title: str, subtitle: str) -> None:
    """Write a figure with its titles as a PNG file."""
    figure.suptitle(title, x=0.012, ha="left", fontsize=15, fontweight="bold", color=INK)
    figure.axes[0].set_title(subtitle, loc="left", fontsize=10.5, color=FAINT)
    save_figure(path, figure)


def save_figure(path: Path, figure: Figure) -> None:
    """Write a figure as a PNG file, whole or not at all."""
    FigureCanvasAgg(figure)
    content = io.BytesIO()
    with plain_words(figure):
        figure.savefig(content, format="png", dpi=DPI, facecolor="white")
    with whole_file(path) as beside:
        beside.write_bytes(content.getvalue())


def rgb(colour: str) -> NDArray[np.uint8]:
    """Return red, green and blue of a colour such as ``#1f2937``."""
    return np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)], np.uint8)


def show_cells(axes: Axes, picture: NDArray[np.uint8], box: _Box, outside: str) -> None:
    """Show cells (rows, columns, 3) of a box, in metres.

    Beyond them the colour ``outside``.
    """
    axes.imshow(picture, origin="lower", extent=box.extent, interpolation="antialiased", zorder=0)
    x_min, x_max, y_min, y_max = box.extent
    axes.set_xlim(x_min - _MARGIN, x_max + _MARGIN)
    axes.set_ylim(y_min - _MARGIN, y_max + _MARGIN)
    axes.set_facecolor(outside)
    axes.set_aspect("equal")
    axes.xaxis.set_major_formatter("{x:g} m")
    axes.yaxis.set_major_formatter("{x:g} m")
    axes.tick_params(colors=FAINT, labelsize=8)
    for side in axes.spines.values():
        side.set_visible(False)


def drawn_together(classes: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Draw blocks of cells as one if there are more than the picture has pixels.

    The highest class shows.
    """
    block = -(-max(classes.shape) // _MOST_PIXELS)
    if block == 1:
        return classes
    rows, columns = (-(-side // block) * block for side in classes.shape)
    padded = np.pad(classes, ((0, rows - classes.shape[0]), (0, columns - classes.shape[1])), mode="edge")
    return np.asarray(padded.reshape(rows // block, block, columns // block, block).max(axis=1).max(axis=2))


def with_prediction(
    picture: NDArray[np.uint8], is_unknown: NDArray[np.bool_], free: NDArray[np.float32]
) -> NDArray[np.uint8]:
    """Return a picture of cells that may be drawn together, its unknown ones tinted by how probably they are free."""
    block = -(-max(free.shape) // _MOST_PIXELS)
    return tinted(picture, STRENGTH * is_unknown * free[::block, ::block])


def prediction_patch(unknown: str) -> Patch:
    """Return the entry of a legend for unknown cells of a colour that are probably free."""
    red, green, blue = tinted(rgb(unknown), np.array(STRENGTH)).tolist()
    return Patch(facecolor=_hex((red, green, blue)), label="unknown, probably free")


def draw_trajectories(axes: Axes, track: NDArray[np.float64], radius: float) -> None:
    """Draw the paths of robots along their poses (times, robots, 3).

    The robots have a radius [m]; paths run from start to end.
    """
    shown = max(radius, 0.009 * float(np.ptp(axes.get_xlim())))
    colours = hex_colours(track.shape[1])
    halo = [Stroke(linewidth=3.6, foreground="white", alpha=0.85), Normal()]
    for robot, colour in enumerate(colours):
        axes.plot(
            track[:, robot, 0],
            track[:, robot, 1],
            color=colour,
            linewidth=1.7,
            zorder=4,
            path_effects=halo,
            solid_joinstyle="round",
        )
    for robot, colour in enumerate(colours):
        x, y, theta = (float(value) for value in track[-1, robot])
        axes.add_patch(Circle((x, y), shown, facecolor=colour, edgecolor="white", linewidth=1.2, zorder=6))
        axes.plot(
            [x, x + shown * math.cos(theta)],
            [y, y + shown * math.sin(theta)],
            color="white",
            linewidth=1.6,
            zorder=7,
        )
        draw_start(axes, robot, float(track[0, robot, 0]), float(track[0, robot, 1]), colour)


def draw_people_and_doors(axes: Axes, crowd: Crowd | None) -> list[Line2D]:
    """Draw people, and the leaves of doors that are not open; return the entries of the legend."""
    if crowd is None:
        return []
    person, door = _hex(PERSON), _hex(DOOR)
    for x, y, to_x, to_y in crowd.leaves[crowd.opened < 1.0]:
        axes.plot([x, to_x], [y, to_y], color=door, linewidth=2.4, zorder=3.5)
    for x, y, radius in crowd.people:
        axes.add_patch(Circle((x, y), radius, facecolor=person, edgecolor="white", linewidth=1.0, zorder=5))
    people = [Line2D([], [], marker="o", markersize=9, color=person, linewidth=0, label="person at the end")]
    doors = [Line2D([], [], color=door, linewidth=2.4, label="door")]
    return people * bool(len(crowd.people)) + doors * bool(len(crowd.doors))


def draw_start(axes: Axes, number: int, x: float, y: float, colour: str) -> None:
    """Draw the start of robot ``number``."""
    axes.plot(
        [x],
        [y],
        marker="o",
        markersize=13,
        markerfacecolor="white",
        markeredgecolor=colour,
        markeredgewidth=2,
        zorder=8,
    )
    axes.text(
        x,
        y,
        str(number),
        ha="center",
        va="center_baseline",
        fontsize=8,
        fontweight="bold",
        color=colour,
        zorder=9,
    )


def hex_colours(robots: int) -> list[str]:
    """Return the colour of each robot."""
    return [_hex(colour) for colour in team_colours(robots)]


def _hex(colour: Colour) -> str:
    red, green, blue = colour
    return f"#{red:02x}{green:02x}{blue:02x}"


def draw_curve(
    axes: Axes,
    curve: Sequence[tuple[float, float]] | NDArray[np.float64],
    reached: Mapping[float, float],
    end_s: float,
) -> None:
    """Draw coverage over time.

    Parameters
    ----------
    curve : sequence of (time [s], coverage)
        Coverage at every change.
    """
    times, shares = [time for time, _ in curve], [100.0 * share for _, share in curve]
    end = max(end_s, 1.0)
    axes.fill_between([*times, end], [*shares, shares[-1]], step="post", color=_COVERAGE, alpha=0.15, linewidth=0)
    axes.step([*times, end], [*shares, shares[-1]], where="post", color=_COVERAGE, linewidth=1.8)
    axes.plot(list(reached.values()), [100.0 * share for share in reached], "o", color=_COVERAGE, markersize=4)
    words = "\n".join(f"{100 * share:.0f} % at {time:.1f} s" for share, time in reached.items())
    axes.text(0.97, 0.05, words, transform=axes.transAxes, ha="right", va="bottom", fontsize=8.5, color=INK)
    axes.set_xlim(0.0, end)
    axes.set_ylim(0.0, 104.0)
    axes.set_title("coverage", loc="left", fontsize=10.5, color=INK)
    axes.set_xlabel("simulated time [s]", fontsize=9, color=FAINT)
    axes.set_ylabel("C_free [%]", fontsize=9, color=FAINT)
    axes.tick_params(colors=FAINT, labelsize=8)
    axes.grid(color="#e5e7eb", linewidth=0.8)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color("#d1d5db")


def list_robots(axes: Axes, columns: Sequence[str], robots: Sequence[Sequence[str]], below: Sequence[str]) -> None:
    """List each robot's ending and some figures.

    Below them is the text on the team.
    """
    axes.set_axis_off()
    axes.set_xlim(0.0, 1.0)
    shown = min(len(robots), _LISTED_ROBOTS)
    axes.set_ylim(max(shown + 5, 9), -0.6)
    style: dict[str, Any] = {"fontsize": 9, "va": "center", "color": INK}
    heading: dict[str, Any] = {**style, "color": FAINT}
    places = [1.0 - 0.26 * k for k in reversed(range(len(columns)))]
    axes.text(0.0, 0.0, "robot", ha="left", **heading)
    for x, text in zip(places, columns, strict=True):
        axes.text(x, 0.0, text, ha="right", **heading)
    for robot, colour in enumerate(hex_colours(len(robots))[:shown]):
        reason, *figures = robots[robot]
        line = robot + 1.0
        axes.plot([0.018], [line], marker="o", markersize=8, color=colour, clip_on=False)
        axes.text(0.06, line, f"{robot}  {reason.replace('_', ' ')}", ha="left", **style)
        for x, figure in zip(places, figures, strict=True):
            axes.text(x, line, figure, ha="right", **style)
    if shown < len(robots):
        axes.text(0.06, shown + 1.0, f"and {len(robots) - shown} more", ha="left", **style)
    for k, text in enumerate(below):
        axes.text(0.0, shown + 2.0 + k, text, ha="left", **style)
