"""Pictures of runs and of floors.

They are PNG files, drawn without a display.
"""

import math
from collections import Counter
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from lidarium.envs.floors.floor import Floor
from lidarium.envs.simulation.coverage import unpack_bits
from lidarium.envs.simulation.people.crowd import crowd_of
from lidarium.evaluation.drawing.picture_parts import (
    INK,
    SOLID,
    box_around,
    draw_curve,
    draw_people_and_doors,
    draw_start,
    draw_trajectories,
    drawn_together,
    list_robots,
    page,
    rgb,
    save_titled_figure,
    show_cells,
)
from lidarium.evaluation.drawing.supervision_marks import draw_supervision
from lidarium.evaluation.episodes.runner import Episode
from lidarium.evaluation.truth.beliefs import team_log_odds
from lidarium.evaluation.truth.true_map import occupied_in_truth
from lidarium.mapping.grids.occupancy import FREE, OCCUPIED, UNKNOWN, three_levels
from lidarium.mapping.grids.speckle_filter import without_small_components
from lidarium.mapping.planning.frontiers.frontier_map import IGNORED
from lidarium.mapping.planning.grid_planning import centres_of

FRONTIER_COLOUR, GIVEN_UP_COLOUR, UNSEEN_COLOUR, UNCOUNTED_COLOUR = "#e11d48", "#7c3aed", "#ffd9a0", "#dfe3ea"
GOAL_COLOUR = "#d97706"
_START_COLOUR = "#2563eb"


def save_run_picture(path: Path, episode: Episode, policy: str) -> None:
    """Draw a run: truth, team map, paths, frontiers and coverage.

    Starts and ends are marked. Frontiers are those left and those given up; coverage is over time.
    """
    env, scorer = episode.env, episode.env.scorer
    if env.floor is None:
        raise ValueError("the episode was interrupted before it began, there is nothing to draw")
    x_min, y_min, x_max, y_max = env.floor.bounds
    figure, floor_axes, curve_axes, team_axes = page((x_max - x_min) / (y_max - y_min))
    _draw_maps(floor_axes, episode)
    draw_trajectories(
        floor_axes,
        np.stack([poses for _, poses in scorer.track] + [env.world.poses]),
        env.settings.robot.radius,
    )
    entries = draw_people_and_doors(floor_axes, crowd_of(env.simulation.population))
    entries += draw_supervision(floor_axes, env, episode.report)
    _draw_legend(figure, *_draw_frontiers(floor_axes, episode), entries)
    draw_curve(curve_axes, scorer.curve, scorer.times, scorer.time)
    _list_robots(team_axes, episode)
    area = float(env.score.counted[0]) * env.settings.occupancy.resolution**2
    robots = "1 robot" if env.settings.robots == 1 else f"{env.settings.robots} robots"
    how = ", interrupted" if episode.is_interrupted else ""
    title = f"{env.floor.name}: {100 * scorer.coverage:.1f} % of {area:.0f} m² explored in {scorer.time:.1f} s{how}"
    subtitle = f"{robots}, {policy}, seed {episode.seed}, {float(env.world.travelled.sum()):.1f} m driven"
    save_titled_figure(path, figure, title, subtitle)


def save_floor_picture(path: Path, floor: Floor, height: float, resolution: float = 0.025) -> None:
    """Draw a floor at the laser's height [m], with its starts and its goal."""
    raster = floor.raster(resolution, height, height)
    box = box_around(raster.solid == 0, raster.origin, resolution)
    figure = Figure(figsize=_floor_size(box.aspect), layout="constrained")
    axes = figure.add_subplot()
    solid = drawn_together((raster.solid[box.rows, box.columns] != 0).astype(np.uint8))
    show_cells(axes, np.stack([rgb("#ffffff"), rgb(INK)])[solid], box, INK)
    for k, (x, y, theta) in enumerate(floor.starts):
        draw_start(axes, k, float(x), float(y), _START_COLOUR)
        ahead = (x + 0.6 * math.cos(theta), y + 0.6 * math.sin(theta))
        axes.annotate("", ahead, (x, y), arrowprops={"arrowstyle": "->", "color": _START_COLOUR})
    if floor.goal is not None:
        axes.plot(
            *([value] for value in floor.goal),
            marker="*",
            markersize=15,
            color=GOAL_COLOUR,
            markeredgecolor="white",
            zorder=8,
        )
    x_min, y_min, x_max, y_max = floor.bounds
    save_titled_figure(
        path,
        figure,
        floor.name,
        f"{x_max - x_min:.1f} x {y_max - y_min:.1f} m, seen at a height of {height:g} m",
    )


def frontiers_left(episode: Episode) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the frontier cells that are left and those given up [m].

    Their shapes are (N, 2) and (M, 2), in the floor's frame.
    """
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
            centres = centres_of(
                points,
                (float(env.beliefs.origins[row, 0]), float(env.beliefs.origins[row, 1])),
                navigation.resolution,
            )
            group.append(centres if env.settings.known_starts else _moved(centres, env.world.starts[row]))
    return np.concatenate(left), np.concatenate(given_up)


def _moved(points: NDArray[np.float64], pose: NDArray[np.float64]) -> NDArray[np.float64]:
    cosine, sine = math.cos(pose[2]), math.sin(pose[2])
    return np.asarray(points @ np.array([[cosine, sine], [-sine, cosine]]) + pose[:2])


def _floor_size(aspect: float) -> tuple[float, float]:
    width = min(max(9.0 * math.sqrt(aspect), 6.0), 16.0)
    return width, min(max(width / aspect + 0.8, 3.0), 14.0)


def _draw_maps(axes: Axes, episode: Episode) -> None:
    """Draw the truth in pale colours and the team's map over it."""
    env = episode.env
    log_odds, origin = team_log_odds(env)
    solid = occupied_in_truth(env)
    counted = unpack_bits(env.score.counted_masks[0], solid.shape[1])
    rows, columns = np.flatnonzero(solid.any(axis=1))[-1] + 1, np.flatnonzero(solid.any(axis=0))[-1] + 1
    levels = without_small_components(three_levels(log_odds))
    solid, counted, levels = solid[:rows, :columns], counted[:rows, :columns], levels[:rows, :columns]
    # In order of priority if cells are drawn together.
    classes = np.zeros(solid.shape, np.uint8)
    classes[solid] = 1
    classes[counted] = 2
    classes[levels == FREE] = 3
    classes[levels == OCCUPIED] = 4
    palette = np.stack([rgb(colour) for colour in (UNCOUNTED_COLOUR, SOLID, UNSEEN_COLOUR, "#ffffff", INK)])
    box = box_around(~solid, origin, env.settings.occupancy.resolution)
    show_cells(axes, palette[drawn_together(classes[box.rows, box.columns])], box, SOLID)


def _draw_frontiers(axes: Axes, episode: Episode) -> tuple[bool, bool]:
    is_border, origin = _border_of_team_map(episode)
    resolution = episode.env.settings.occupancy.resolution
    left, given_up = (_within(points, is_border, origin, resolution) for points in frontiers_left(episode))
    axes.scatter(left[:, 0], left[:, 1], s=5, color=FRONTIER_COLOUR, linewidths=0, zorder=3)
    axes.scatter(given_up[:, 0], given_up[:, 1], s=5, color=GIVEN_UP_COLOUR, linewidths=0, zorder=3)
    return bool(len(left)), bool(len(given_up))


def _border_of_team_map(episode: Episode) -> tuple[NDArray[np.bool_], tuple[float, float]]:
    """Return the border cells of the team's map for drawing, and its origin.

    They lie within a cell of both free and unknown cells.

    Frontiers of one robot's map may have been seen by another.
    """
    log_odds, origin = team_log_odds(episode.env)
    levels = without_small_components(three_levels(log_odds))
    square = np.ones((3, 3), np.uint8)
    free, unknown = (cv2.dilate((levels == level).astype(np.uint8), square) != 0 for level in (FREE, UNKNOWN))
    return np.asarray(free & unknown), origin


def _within(
    points: NDArray[np.float64], mask: NDArray[np.bool_], origin: tuple[float, float], resolution: float
) -> NDArray[np.float64]:
    """Return the points (n, 2) that lie in cells of a mask."""
    columns, rows = np.floor((points - origin) / resolution).astype(np.int64).T
    is_inside = (rows >= 0) & (rows < mask.shape[0]) & (columns >= 0) & (columns < mask.shape[1])
    inside = points[is_inside]
    return np.asarray(inside[mask[rows[is_inside], columns[is_inside]]])


def _draw_legend(figure: Figure, has_left: bool, has_given_up: bool, more: list[Line2D]) -> None:
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
    entries += more
    columns = len(entries) if figure.get_figwidth() > 13.0 else 5
    figure.legend(
        handles=entries,
        loc="outside lower left",
        ncols=columns,
        frameon=False,
        fontsize=8.5,
        labelcolor=INK,
        handlelength=1.2,
    )


def _list_robots(axes: Axes, episode: Episode) -> None:
    """List each robot's ending, path and share of F, and below the frontiers given up."""
    env, world = episode.env, episode.env.world
    counted = max(int(env.score.counted[0]), 1)
    endings = [env.scorer.ended_because.get(agent, "still at work") for agent in env.possible_agents]
    robots = [
        (reason, f"{way:.1f} m", f"{100.0 * seen / counted:.0f} %")
        for reason, way, seen in zip(endings, world.travelled, env.score.seen, strict=True)
    ]
    reasons = Counter(entry.reason.replace("_", " ") for entry in episode.given_up)
    given_up = ", ".join(f"{count} {reason}" for reason, count in reasons.most_common()) or "nothing"
    list_robots(
        axes,
        ("drove", "saw"),
        robots,
        (f"collisions: {int(world.collisions.sum())}", f"given up on the way: {given_up}"),
    )
