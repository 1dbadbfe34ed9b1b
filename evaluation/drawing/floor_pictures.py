"""Pictures of the robots' paths and of their time spent on a floor.

The paths are drawn over the map that the robots made.
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patheffects import Normal, Stroke
from numpy.typing import NDArray

from lidarium.evaluation.analysis.episodes import Row, pair_key_of
from lidarium.evaluation.analysis.groups import Group
from lidarium.evaluation.analysis.records import Entry, Key, Track, read_track, record_key
from lidarium.evaluation.drawing.picture_parts import FAINT, INK
from lidarium.evaluation.drawing.style import colours, legend, save

VISIT_CELL_M = 0.25
"""Side of a cell of the maps of visits [m]."""

MOST_PANELS = 6
_COLOUR_MAP = "viridis_r"
_MARGIN_M = 0.4
_LEVELS = {0: (55, 65, 81), 127: (226, 230, 236), 255: (255, 255, 255)}

Extent = tuple[float, float, float, float]
"""x_min, x_max, y_min, y_max [m]."""


@dataclass(frozen=True, slots=True)
class _Visits:
    """Positions of the robots of a policy on a floor.

    Attributes
    ----------
    seconds : (rows, columns) float64
        Time that robots spent in each cell, mean of the runs [s].
    extent : tuple of float
        Extent of the cells [m].
    runs : int
        Number of runs.
    """

    seconds: NDArray[np.float64]
    extent: Extent
    runs: int


def recorded_pair(group: Group, floor: str, records: dict[Key, Entry]) -> dict[str, Row]:
    """Return the first recorded runs on a floor that share starts and seed.

    They are keyed by policy, from the pair that is recorded for the most policies.
    """
    by_pair: dict[tuple[Any, ...], dict[str, Row]] = {}
    for policy, rows in group.on_floor(floor).items():
        for row in rows:
            if record_key(row) in records:
                by_pair.setdefault(pair_key_of(row), {})[policy] = row
    most = max((len(runs) for runs in by_pair.values()), default=0)
    return next((runs for runs in by_pair.values() if len(runs) == most), {})


def save_paths(path: Path, group: Group, floor: str, records: dict[Key, Entry]) -> None:
    """Draw the paths of one run of each policy over the map that the team made.

    The runs have the same starts and seed.
    """
    runs = dict(list(recorded_pair(group, floor, records).items())[:MOST_PANELS])
    tracks = {policy: read_track(records[record_key(row)]) for policy, row in runs.items()}
    extent = _united([_known_extent(track) for track in tracks.values()])
    figure, panels = _panels(len(tracks), extent, 0.0)
    for axes, (policy, track) in zip(panels, tracks.items(), strict=True):
        _show_map(axes, track, extent)
        _draw_paths(axes, track)
        _caption(axes, policy, _ending_of(runs[policy]))
    chosen = colours(group.robots)
    handles: list[Line2D] = [Line2D([], [], color=colour, linewidth=2.2) for colour in chosen]
    names = [f"robot {k}" for k in range(group.robots)]
    if group.robots > len(_numbers()):
        handles, names = handles[:1], ["robots"]
    handles += [
        Line2D(
            [],
            [],
            marker="o",
            markersize=9,
            markerfacecolor="white",
            markeredgecolor=INK,
            markeredgewidth=1.6,
            linewidth=0,
        ),
        Line2D([], [], marker="o", markersize=8, color=INK, linewidth=0),
    ]
    legend(figure, [*names, "start", "end"], handles)
    seed = next(iter(runs.values()))["seed"]
    save(
        path,
        figure,
        f"Paths on {floor}: {group.robots} robot{'s' if group.robots != 1 else ''}, seed {seed}",
        "over the map that the team made; same starts for all policies",
    )


def visits_on(group: Group, floor: str, records: dict[Key, Entry]) -> tuple[dict[str, _Visits], dict[str, Track]]:
    """Return the positions of the robots of each policy on a floor, and a track.

    All recorded runs count; the track is for the map below.
    """
    tracks = {
        policy: [read_track(records[record_key(row)]) for row in rows if record_key(row) in records]
        for policy, rows in list(group.on_floor(floor).items())[:MOST_PANELS]
    }
    tracks = {policy: found for policy, found in tracks.items() if found}
    extent = _united([_known_extent(track) for found in tracks.values() for track in found])
    x_min, x_max, y_min, y_max = extent
    columns, rows = (math.ceil((high - low) / VISIT_CELL_M) for low, high in ((x_min, x_max), (y_min, y_max)))
    covered = (x_min, x_min + columns * VISIT_CELL_M, y_min, y_min + rows * VISIT_CELL_M)
    visits = {}
    for policy, found in tracks.items():
        seconds = np.zeros((rows, columns))
        for track in found:
            seconds += _seconds_in_cells(track, covered, seconds.shape)
        visits[policy] = _Visits(seconds / len(found), covered, len(found))
    return visits, {policy: found[0] for policy, found in tracks.items()}


def save_visits(path: Path, group: Group, floor: str, visits: dict[str, _Visits], tracks: dict[str, Track]) -> None:
    """Draw the positions of the robots of each policy over time on a floor."""
    extent = next(iter(visits.values())).extent
    figure, panels = _panels(len(visits), extent, 0.9)
    most = max(max(float(each.seconds.max()) for each in visits.values()), 0.2)
    scale = LogNorm(0.1, most)
    for axes, (policy, each) in zip(panels, visits.items(), strict=True):
        _show_map(axes, tracks[policy], extent)
        shown = np.ma.masked_less(each.seconds, 1e-9)
        appearance: dict[str, Any] = {
            "norm": scale,
            "cmap": _COLOUR_MAP,
            "interpolation": "nearest",
            "zorder": 2,
            "alpha": 0.92,
        }
        axes.imshow(shown, origin="lower", extent=each.extent, **appearance)
        _caption(axes, policy, f"{each.runs} run{'s' if each.runs != 1 else ''}")
    bar = figure.colorbar(ScalarMappable(scale, _COLOUR_MAP), ax=panels, alpha=0.92, shrink=0.85, pad=0.015, aspect=28)
    bar.set_label(f"robots' time per run in a cell of {VISIT_CELL_M:g} m [s]", fontsize=9, color=FAINT)
    bar.ax.tick_params(labelsize=8.5, colors=FAINT)
    ticks = [digit * 10.0**power for power in range(-1, 5) for digit in (1, 2, 5) if digit * 10.0**power <= most]
    bar.set_ticks(ticks, labels=[f"{tick:g}" for tick in ticks])
    bar.minorticks_off()
    bar.outline.set_visible(False)
    save(
        path,
        figure,
        f"Where the robots were on {floor}: {group.robots} robot{'s' if group.robots != 1 else ''}",
        "mean over the recorded runs; logarithmic scale; underneath, a map that the team made",
    )


def _seconds_in_cells(track: Track, extent: Extent, shape: tuple[int, int]) -> NDArray[np.float64]:
    # Each pose holds until the next one.
    durations = np.diff(track.times, append=track.times[-1])
    x, y = track.poses[..., 0].ravel(), track.poses[..., 1].ravel()
    rows, columns = (
        np.floor((y - extent[2]) / VISIT_CELL_M).astype(int),
        np.floor((x - extent[0]) / VISIT_CELL_M).astype(int),
    )
    seconds = np.zeros(shape)
    np.add.at(
        seconds,
        (np.clip(rows, 0, shape[0] - 1), np.clip(columns, 0, shape[1] - 1)),
        np.repeat(durations, track.poses.shape[1]),
    )
    return seconds


def _ending_of(row: Row) -> str:
    if row["t99_s"] is not None:
        return f"99 % in {row['t99_s']:.0f} s"
    return f"{100.0 * row['coverage_final']:.1f} % in {row['time_s']:.0f} s"


def _known_extent(track: Track) -> Extent:
    is_known = track.levels != 127
    if not is_known.any():
        (x_min, y_min), (x_max, y_max) = (end(track.poses[..., :2], axis=(0, 1)) for end in (np.min, np.max))
        return float(x_min), float(x_max), float(y_min), float(y_max)
    rows, columns = (
        np.flatnonzero(is_known.any(axis=1)).tolist(),
        np.flatnonzero(is_known.any(axis=0)).tolist(),
    )
    (x, y), side = track.origin, track.resolution
    return x + columns[0] * side, x + (columns[-1] + 1) * side, y + rows[0] * side, y + (rows[-1] + 1) * side


def _united(extents: list[Extent]) -> Extent:
    x_min, x_max, y_min, y_max = zip(*extents, strict=True)
    return min(x_min) - _MARGIN_M, max(x_max) + _MARGIN_M, min(y_min) - _MARGIN_M, max(y_max) + _MARGIN_M


def _panels(count: int, extent: Extent, bar: float) -> tuple[Figure, list[Axes]]:
    """Arrange equal panels of a floor's shape, with room for a colour bar [inch].

    The colour bar is at the side of the panels.
    """
    aspect = (extent[1] - extent[0]) / (extent[3] - extent[2])
    most = 3 if aspect < 2.2 else 2 if aspect < 4.0 else 1
    lines = -(-count // most)
    columns = -(-count // lines)
    width = min(4.2 * math.sqrt(aspect), (13.0 if columns > 1 else 11.0) / columns)
    height = min(max(width / aspect, 1.3), 8.0)
    # A floor has the numbers of its axis at its side, above it two lines of caption, around all of them title
    # and legend.
    size = (max(columns * (width + 0.55) + bar, 6.6), lines * (height + 0.75) + 1.1)
    figure = Figure(figsize=size, layout="constrained")
    return figure, [figure.add_subplot(lines, columns, k + 1) for k in range(count)]


def _show_map(axes: Axes, track: Track, extent: Extent) -> None:
    picture = np.full((*track.levels.shape, 3), _LEVELS[127], np.uint8)
    for level, colour in _LEVELS.items():
        picture[track.levels == level] = colour
    rows, columns = track.levels.shape
    (x, y), side = track.origin, track.resolution
    red, green, blue = (part / 255.0 for part in _LEVELS[127])
    axes.set_facecolor((red, green, blue))
    axes.imshow(
        picture,
        origin="lower",
        extent=(x, x + columns * side, y, y + rows * side),
        interpolation="antialiased",
        zorder=0,
    )
    axes.set_xlim(extent[0], extent[1])
    axes.set_ylim(extent[2], extent[3])
    axes.set_aspect("equal")
    axes.xaxis.set_major_formatter("{x:g} m")
    axes.yaxis.set_major_formatter("{x:g} m")
    axes.tick_params(colors=FAINT, labelsize=7.5)
    axes.spines[:].set_visible(False)


def _draw_paths(axes: Axes, track: Track) -> None:
    halo = [Stroke(linewidth=3.0, foreground="white", alpha=0.85), Normal()]
    for robot, colour in enumerate(colours(track.poses.shape[1])):
        x, y = track.poses[:, robot, 0], track.poses[:, robot, 1]
        axes.plot(x, y, color=colour, linewidth=1.5, zorder=4, path_effects=halo, solid_joinstyle="round")
        axes.plot(x[-1:], y[-1:], marker="o", markersize=7.5, color=colour, markeredgecolor="white", zorder=6)
        axes.plot(
            x[:1],
            y[:1],
            marker="o",
            markersize=11,
            markerfacecolor="white",
            markeredgecolor=colour,
            markeredgewidth=1.7,
            zorder=7,
        )
        axes.text(
            x[0],
            y[0],
            str(robot),
            ha="center",
            va="center_baseline",
            fontsize=7,
            fontweight="bold",
            color=colour,
            zorder=8,
        )


def _caption(axes: Axes, policy: str, text: str) -> None:
    axes.set_title(f"{policy}\n{text}", loc="left", fontsize=9.5, color=INK)


def _numbers() -> range:
    return range(12)
