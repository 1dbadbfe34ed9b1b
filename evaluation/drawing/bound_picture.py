"""A picture of the tours of a team that knows the floor."""

import math
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from lidarium.envs.floors.floor import Floor
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.simulation.kernels.floor_cache import floor_tables
from lidarium.evaluation.bounds.bound import KnownFloorBound
from lidarium.evaluation.drawing.picture_parts import (
    SOLID,
    box_around,
    draw_start,
    hex_colours,
    rgb,
    save_titled_figure,
    show_cells,
)

LOOK_M = 0.5
"""Length of the arrows towards the points that robots turn to [m]."""


def save_bound_picture(
    path: Path, floor: Floor, settings: ExplorationSettings, bound: KnownFloorBound, name: str
) -> None:
    """Draw a floor and tours of a team, with arrows at turns towards a target."""
    tables = floor_tables(floor, settings.raster_resolution, settings.lidar.height, settings.robot.height)
    raster = tables.laser
    box = box_around(raster.solid == 0, raster.origin, raster.resolution)
    cells = np.where(raster.solid[box.rows, box.columns, None] > 0, rgb(SOLID), np.uint8(255)).astype(np.uint8)
    x_min, x_max, y_min, y_max = box.extent
    width = 9.0
    figure = Figure(
        figsize=(width, min(max(width * (y_max - y_min) / (x_max - x_min), 3.0), 14.0) + 1.0),
        layout="constrained",
    )
    axes = figure.add_subplot()
    show_cells(axes, cells, box, SOLID)
    for robot, (walk, colour) in enumerate(zip(bound.walks, hex_colours(len(bound.walks)), strict=True)):
        axes.plot(walk.points[:, 0], walk.points[:, 1], color=colour, linewidth=2.0, zorder=5)
        turns = np.flatnonzero(np.isfinite(walk.headings))
        axes.quiver(
            walk.points[turns, 0],
            walk.points[turns, 1],
            LOOK_M * np.cos(walk.headings[turns]),
            LOOK_M * np.sin(walk.headings[turns]),
            color=colour,
            angles="xy",
            scale_units="xy",
            scale=1.0,
            width=0.004,
            zorder=6,
        )
        draw_start(axes, robot, float(walk.points[0, 0]), float(walk.points[0, 1]), colour)
    seen = f"{100.0 * bound.share:.1f} % seen"
    time = f"{bound.time_s:.0f} s" if math.isfinite(bound.time_s) else "not in time"
    save_titled_figure(path, figure, name, f"a team that knows the floor: {seen}, {time}, {bound.total_m:.0f} m")
