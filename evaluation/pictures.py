"""Pictures: what a run found on a floor, and floors themselves (PNG, drawn without a display)."""

import io
import math
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch
from matplotlib.patheffects import Normal, Stroke
from numpy.typing import NDArray

from lidarium.envs.coverage import unpack_bits
from lidarium.envs.floors.floor import Floor
from lidarium.envs.rendering import team_colours
from lidarium.evaluation.beliefs import team_log_odds
from lidarium.evaluation.output import whole_file
from lidarium.evaluation.runner import Episode
from lidarium.evaluation.truth import occupied_in_truth
from lidarium.mapping.frontiers import IGNORED
from lidarium.mapping.grid_planning import centres_of

INK, FAINT, SOLID = "#1f2937", "#6b7280", "#b6bec9"
FRONTIER_COLOUR, GIVEN_UP_COLOUR, UNSEEN_COLOUR, UNCOUNTED_COLOUR = "#e11d48", "#7c3aed", "#ffd9a0", "#dfe3ea"
DPI = 130
_START_COLOUR = "#2563eb"
_LISTED_ROBOTS = 16
_WIDE = 2.1
_MOST_PIXELS = 3000
_MARGIN = 0.15


@dataclass(frozen=True, slots=True)
class _Box:
    """What part of a raster is shown: rows, columns, and its extent in metres (x_min, x_max, y_min, y_max)."""

    rows: slice
    columns: slice
    extent: tuple[float, float, float, float]

    @property
    def aspect(self) -> float:
        x_min, x_max, y_min, y_max = self.extent
        return (x_max - x_min) / (y_max - y_min)


def save_run_picture(path: Path, episode: Episode, policy: str) -> None:
    """Draw what a run found: truth, team map, ways, starts and ends, frontiers left and given up, coverage over time.

    Parameters
    ----------
    path : Path
        The PNG file, written whole or not at all.
    episode : Episode
        What `run_episode` left, finished or interrupted.
    policy : str
        Name of the policy.
    """
    env, scorer = episode.env, episode.env.scorer
    if env.floor is None:
        raise ValueError("the episode was interrupted before it began, there is nothing to draw")
    x_min, y_min, x_max, y_max = env.floor.bounds
    figure, floor_axes, curve_axes, team_axes = _page((x_max - x_min) / (y_max - y_min))
    _draw_maps(floor_axes, episode)
    _draw_ways(floor_axes, episode)
    _draw_legend(figure, *_draw_frontiers(floor_axes, episode))
    _draw_curve(curve_axes, episode)
    _list_robots(team_axes, episode)
    area = float(env.world.counted[0]) * env.settings.occupancy.resolution**2
    robots = "1 robot" if env.settings.robots == 1 else f"{env.settings.robots} robots"
    how = ", interrupted" if episode.is_interrupted else ""
    title = f"{env.floor.name}: {100 * scorer.coverage:.1f} % of {area:.0f} m² explored in {scorer.time:.1f} s{how}"
    subtitle = f"{robots}, {policy}, seed {episode.seed}, {float(env.world.travelled.sum()):.1f} m driven"
    _save(path, figure, title, subtitle)


def save_floor_picture(path: Path, floor: Floor, height: float, resolution: float = 0.025) -> None:
    """Draw a floor: what the laser sees at a height [m], and where its starts are.

    Parameters
    ----------
    path : Path
        The PNG file, written whole or not at all.
    floor : Floor
        The floor.
    height, resolution : float
        Height of the plane, and side of a cell [m].
    """
    raster = floor.raster(resolution, height, height)
    box = _box_around(raster.solid == 0, raster.origin, resolution)
    figure = Figure(figsize=_floor_size(box.aspect), layout="constrained")
    axes = figure.add_subplot()
    solid = _drawn_together((raster.solid[box.rows, box.columns] != 0).astype(np.uint8))
    _show(axes, np.stack([_rgb("#ffffff"), _rgb(INK)])[solid], box, INK)
    for k, (x, y, theta) in enumerate(floor.starts):
        _draw_start(axes, k, float(x), float(y), _START_COLOUR)
        ahead = (x + 0.6 * math.cos(theta), y + 0.6 * math.sin(theta))
        axes.annotate("", ahead, (x, y), arrowprops={"arrowstyle": "->", "color": _START_COLOUR})
    x_min, y_min, x_max, y_max = floor.bounds
    _save(path, figure, floor.name, f"{x_max - x_min:.1f} x {y_max - y_min:.1f} m, seen at a height of {height:g} m")


def frontiers_left(episode: Episode) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the frontier cells that are left and those that were given up, (N, 2) and (M, 2), in the floor's frame [m]."""
    env = episode.env
    shared = env.perception.shared_map() if episode.policy.shares_map else None
    rows = [0] if shared is not None else list(range(env.settings.robots))
    left: list[NDArray[np.float64]] = []
    given_up: list[NDArray[np.float64]] = []
    for row in rows:
        navigation = env.perception.own_map(row) if shared is None else shared
        cells = navigation.frontiers.cells()
        ignored = np.argwhere(navigation.frontiers.flags == IGNORED)
        for points, group in ((cells, left), (ignored, given_up)):
            centres = centres_of(points, (float(env.world.origins[row, 0]), float(env.world.origins[row, 1])), navigation.resolution)
            group.append(centres if env.settings.known_starts else _moved(centres, env.world.starts[row]))
    return np.concatenate(left), np.concatenate(given_up)


def _moved(points: NDArray[np.float64], pose: NDArray[np.float64]) -> NDArray[np.float64]:
    cosine, sine = math.cos(pose[2]), math.sin(pose[2])
    return np.asarray(points @ np.array([[cosine, sine], [-sine, cosine]]) + pose[:2])


def _box_around(free: NDArray[np.bool_], origin: tuple[float, float], resolution: float) -> _Box:
    spans, limits = [], []
    for axis in (1, 0):
        used = np.flatnonzero(free.any(axis=axis))
        margin = math.ceil(_MARGIN / resolution)
        low, high = max(int(used[0]) - margin, 0), min(int(used[-1]) + 1 + margin, free.shape[1 - axis])
        spans.append(slice(low, high))
        limits.append((origin[axis] + low * resolution, origin[axis] + high * resolution))
    return _Box(spans[0], spans[1], (*limits[1], *limits[0]))


def _floor_size(aspect: float) -> tuple[float, float]:
    width = min(max(9.0 * math.sqrt(aspect), 6.0), 16.0)
    return width, min(max(width / aspect + 0.8, 3.0), 14.0)


def _page(aspect: float) -> tuple[Figure, Axes, Axes, Axes]:
    """Lay the page out: the floor, and beside or (where it is wide) below it the curve and the team."""
    if aspect > _WIDE:
        width = 14.0
        height = width / min(aspect, 8.0) + 1.0
        figure = Figure(figsize=(width, height + 3.4), layout="constrained")
        grid = figure.add_gridspec(2, 2, height_ratios=(height, 2.6), width_ratios=(1.3, 1.0))
        return figure, figure.add_subplot(grid[0, :]), figure.add_subplot(grid[1, 0]), figure.add_subplot(grid[1, 1])
    height = 8.0 if aspect > 1.0 else 9.0
    width = max(height * aspect, 5.0)
    figure = Figure(figsize=(width + 4.6, height + 0.6), layout="constrained")
    grid = figure.add_gridspec(2, 2, height_ratios=(1.0, 1.25), width_ratios=(width, 4.2))
    return figure, figure.add_subplot(grid[:, 0]), figure.add_subplot(grid[0, 1]), figure.add_subplot(grid[1, 1])


def _save(path: Path, figure: Figure, title: str, subtitle: str) -> None:
    figure.suptitle(title, x=0.012, ha="left", fontsize=15, fontweight="bold", color=INK)
    figure.axes[0].set_title(subtitle, loc="left", fontsize=10.5, color=FAINT)
    FigureCanvasAgg(figure)
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=DPI, facecolor="white")
    with whole_file(path) as beside:
        beside.write_bytes(content.getvalue())


def _rgb(colour: str) -> NDArray[np.uint8]:
    return np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)], np.uint8)


def _show(axes: Axes, picture: NDArray[np.uint8], box: _Box, outside: str) -> None:
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


def _draw_maps(axes: Axes, episode: Episode) -> None:
    """Draw the truth in pale colours and the team's map over it."""
    env = episode.env
    log_odds, origin = team_log_odds(env)
    solid = occupied_in_truth(env)
    counted = unpack_bits(env.world.counted_masks[0], solid.shape[1])
    rows, columns = np.flatnonzero(solid.any(axis=1))[-1] + 1, np.flatnonzero(solid.any(axis=0))[-1] + 1
    solid, counted, log_odds = solid[:rows, :columns], counted[:rows, :columns], log_odds[:rows, :columns]
    # In the order of what shows where cells are drawn together.
    classes = np.zeros(solid.shape, np.uint8)
    classes[solid] = 1
    classes[counted] = 2
    classes[log_odds < 0] = 3
    classes[log_odds > 0] = 4
    palette = np.stack([_rgb(colour) for colour in (UNCOUNTED_COLOUR, SOLID, UNSEEN_COLOUR, "#ffffff", INK)])
    box = _box_around(~solid, origin, env.settings.occupancy.resolution)
    _show(axes, palette[_drawn_together(classes[box.rows, box.columns])], box, SOLID)


def _drawn_together(classes: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Draw blocks of cells as one where there are more than the picture has pixels; the highest class shows."""
    block = -(-max(classes.shape) // _MOST_PIXELS)
    if block == 1:
        return classes
    rows, columns = (-(-side // block) * block for side in classes.shape)
    padded = np.pad(classes, ((0, rows - classes.shape[0]), (0, columns - classes.shape[1])), mode="edge")
    return np.asarray(padded.reshape(rows // block, block, columns // block, block).max(axis=1).max(axis=2))


def _draw_ways(axes: Axes, episode: Episode) -> None:
    env = episode.env
    track = np.stack([poses for _, poses in env.scorer.track] + [env.world.poses])
    radius = max(env.settings.robot.radius, 0.009 * float(np.ptp(axes.get_xlim())))
    halo = [Stroke(linewidth=3.6, foreground="white", alpha=0.85), Normal()]
    for robot, colour in enumerate(_hex_colours(env.settings.robots)):
        axes.plot(track[:, robot, 0], track[:, robot, 1], color=colour, linewidth=1.7, zorder=4, path_effects=halo, solid_joinstyle="round")
    for robot, colour in enumerate(_hex_colours(env.settings.robots)):
        x, y, theta = (float(value) for value in env.world.poses[robot])
        axes.add_patch(Circle((x, y), radius, facecolor=colour, edgecolor="white", linewidth=1.2, zorder=6))
        axes.plot([x, x + radius * math.cos(theta)], [y, y + radius * math.sin(theta)], color="white", linewidth=1.6, zorder=7)
        _draw_start(axes, robot, float(env.world.starts[robot, 0]), float(env.world.starts[robot, 1]), colour)


def _draw_start(axes: Axes, number: int, x: float, y: float, colour: str) -> None:
    axes.plot([x], [y], marker="o", markersize=13, markerfacecolor="white", markeredgecolor=colour, markeredgewidth=2, zorder=8)
    axes.text(x, y, str(number), ha="center", va="center_baseline", fontsize=8, fontweight="bold", color=colour, zorder=9)


def _hex_colours(robots: int) -> list[str]:
    return [f"#{red:02x}{green:02x}{blue:02x}" for red, green, blue in team_colours(robots)]


def _draw_frontiers(axes: Axes, episode: Episode) -> tuple[bool, bool]:
    left, given_up = frontiers_left(episode)
    axes.scatter(left[:, 0], left[:, 1], s=5, color=FRONTIER_COLOUR, linewidths=0, zorder=3)
    axes.scatter(given_up[:, 0], given_up[:, 1], s=5, color=GIVEN_UP_COLOUR, linewidths=0, zorder=3)
    return bool(len(left)), bool(len(given_up))


def _draw_legend(figure: Figure, has_left: bool, has_given_up: bool) -> None:
    start: dict[str, Any] = {"markerfacecolor": "white", "markeredgecolor": INK, "markeredgewidth": 1.6}
    entries: list[Patch | Line2D] = [
        Patch(facecolor="white", edgecolor=SOLID, label="explored"),
        Patch(facecolor=INK, label="wall on the team's map"),
        Patch(facecolor=SOLID, label="solid in truth"),
        Patch(facecolor=UNSEEN_COLOUR, label="not explored"),
        Patch(facecolor=UNCOUNTED_COLOUR, label="out of reach, not counted"),
        Line2D([], [], marker="o", markersize=9, linewidth=0, label="start", **start),
        Line2D([], [], marker="o", markersize=9, color=INK, linewidth=0, label="end"),
    ]
    if has_left:
        entries.append(Patch(facecolor=FRONTIER_COLOUR, label="frontier left"))
    if has_given_up:
        entries.append(Patch(facecolor=GIVEN_UP_COLOUR, label="frontier given up"))
    columns = len(entries) if figure.get_figwidth() > 13.0 else 5
    figure.legend(handles=entries, loc="outside lower left", ncols=columns, frameon=False, fontsize=8.5, labelcolor=INK, handlelength=1.2)


def _draw_curve(axes: Axes, episode: Episode) -> None:
    scorer = episode.env.scorer
    times, shares = [time for time, _ in scorer.curve], [100.0 * share for _, share in scorer.curve]
    end = max(scorer.time, 1.0)
    axes.fill_between([*times, end], [*shares, shares[-1]], step="post", color="#16a34a", alpha=0.15, linewidth=0)
    axes.step([*times, end], [*shares, shares[-1]], where="post", color="#16a34a", linewidth=1.8)
    axes.plot(list(scorer.times.values()), [100.0 * share for share in scorer.times], "o", color="#16a34a", markersize=4)
    reached = "\n".join(f"{100 * share:.0f} % at {time:.1f} s" for share, time in scorer.times.items())
    axes.text(0.97, 0.05, reached, transform=axes.transAxes, ha="right", va="bottom", fontsize=8.5, color=INK)
    axes.set_xlim(0.0, end)
    axes.set_ylim(0.0, 104.0)
    axes.set_title("coverage", loc="left", fontsize=10.5, color=INK)
    axes.set_xlabel("simulated time [s]", fontsize=9, color=FAINT)
    axes.set_ylabel("C_free [%]", fontsize=9, color=FAINT)
    axes.tick_params(colors=FAINT, labelsize=8)
    axes.grid(color="#e5e7eb", linewidth=0.8)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color("#d1d5db")


def _list_robots(axes: Axes, episode: Episode) -> None:
    """List each robot's ending, way and share of F, and below what was given up."""
    env, world = episode.env, episode.env.world
    axes.set_axis_off()
    axes.set_xlim(0.0, 1.0)
    shown = min(env.settings.robots, _LISTED_ROBOTS)
    lines = max(shown + 5, 9)
    axes.set_ylim(lines, -0.6)
    style: dict[str, Any] = {"fontsize": 9, "va": "center", "color": INK}
    heading: dict[str, Any] = {**style, "color": FAINT}
    for x, text, side in ((0.0, "robot", "left"), (0.74, "drove", "right"), (1.0, "saw", "right")):
        axes.text(x, 0.0, text, ha=side, **heading)
    for robot, colour in enumerate(_hex_colours(env.settings.robots)[:shown]):
        agent, line = env.possible_agents[robot], robot + 1.0
        reason = env.scorer.ended_because.get(agent, "still at work")
        axes.plot([0.018], [line], marker="o", markersize=8, color=colour, clip_on=False)
        axes.text(0.06, line, f"{robot}  {reason.replace('_', ' ')}", ha="left", **style)
        axes.text(0.74, line, f"{world.travelled[robot]:.1f} m", ha="right", **style)
        axes.text(1.0, line, f"{100.0 * world.seen[robot] / max(int(world.counted[0]), 1):.0f} %", ha="right", **style)
    line = shown + 1.0
    if shown < env.settings.robots:
        axes.text(0.06, line, f"and {env.settings.robots - shown} more", ha="left", **style)
    reasons = Counter(entry.reason.replace("_", " ") for entry in episode.given_up)
    given_up = ", ".join(f"{count} {reason}" for reason, count in reasons.most_common()) or "nothing"
    axes.text(0.0, line + 1.0, f"collisions: {int(world.collisions.sum())}", ha="left", **style)
    axes.text(0.0, line + 2.0, f"given up on the way: {given_up}", ha="left", **style)
