"""Draws the maps of robots with unknown starts, each in its own frame."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.drawing.frame_parts import (
    BACKGROUND,
    EXPLORED,
    UNEXPLORED,
    Colour,
    Frame,
    View,
    blocks_of,
    draw_robots,
    enlarged,
    line_of_text,
    pale,
    team_colours,
    view_around,
)
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.mapping.grids.occupancy import FREE, OCCUPIED, UNKNOWN, three_levels

JOINED: Colour = (13, 148, 136)
"""Colour of joins."""

MOST_IN_A_ROW = 4
GAP, LINE = 8, 24
"""Between tiles; height of the line above a map [pixels]."""

_SHARE = 0.3
"""Height of a tile's map as a share of the picture's width, where tiles leave room for it."""


class OwnMaps:
    """Draws each robot's own map, as the robot has it.

    A tile shows the part of the map that the floor can fill: it does not move as the map grows.

    Parameters
    ----------
    env : ExplorationEnv
        After a reset; the robots do not know their starts.
    width : int
        Of all tiles together [pixels].
    """

    def __init__(self, env: ExplorationEnv, width: int) -> None:
        robots = env.settings.robots
        self._width, self._columns = width, min(robots, MOST_IN_A_ROW)
        self._tile = (width - GAP * (self._columns - 1)) // self._columns
        self._height = min(self._tile, round(_SHARE * width))
        self._colours = team_colours(robots)
        self._views = [
            view_around(_within_floor(env, row), _origin(env, row), _resolution(env), self._height)
            for row in range(robots)
        ]

    def draw(self, env: ExplorationEnv, groups: Sequence[set[int]]) -> Frame:
        """Return the tiles; above maps that are joined the line has another colour."""
        rows = -(-len(self._views) // self._columns)
        line = LINE + self._height
        picture = np.full((rows * (line + GAP), self._width, 3), BACKGROUND, np.uint8)
        for robot, view in enumerate(self._views):
            row, column = divmod(robot, self._columns)
            left = column * (self._tile + GAP)
            tile = picture[row * (line + GAP) : row * (line + GAP) + line, left : left + self._tile]
            is_joined = any(robot in group and len(group) > 1 for group in groups)
            words = f"map of robot {robot}{', joined' * is_joined}"
            behind = JOINED if is_joined else self._colours[robot]
            tile[:LINE] = line_of_text(words, (self._tile, LINE), EXPLORED, behind)
            tile[LINE:] = UNEXPLORED
            drawn = self._map_of(env, robot, view)[:, : self._tile]
            up, aside = LINE + (self._height - len(drawn)) // 2, (self._tile - drawn.shape[1]) // 2
            tile[up : up + len(drawn), aside : aside + drawn.shape[1]] = drawn
        return picture

    def _map_of(self, env: ExplorationEnv, robot: int, view: View) -> Frame:
        colour = self._colours[robot]
        palette = np.zeros((256, 3), np.uint8)
        palette[[OCCUPIED, UNKNOWN, FREE]] = colour, UNEXPLORED, pale(colour)
        levels = three_levels(env.beliefs.log_odds[robot][view.rows, view.columns])
        drawn = enlarged(palette[blocks_of(levels, view)], view)
        pose = env.beliefs.believed[robot, None]
        draw_robots(drawn, view, pose, env.settings.team[robot].radius, [False], [colour])
        return drawn


def _resolution(env: ExplorationEnv) -> float:
    return float(env.settings.occupancy.resolution)


def _origin(env: ExplorationEnv, row: int) -> tuple[float, float]:
    x, y = env.beliefs.origins[row]
    return float(x), float(y)


def _within_floor(env: ExplorationEnv, row: int) -> NDArray[np.bool_]:
    """Return which cells of a robot's map the floor can fill, as the robot started.

    They are those in the rectangle around the floor's free cells.
    """
    tables = env.world.floors[0]
    assert tables is not None
    raster = tables.laser
    x, y = ((np.flatnonzero((raster.solid == 0).any(axis=axis)) + 0.5) * raster.resolution for axis in (0, 1))
    corners = np.array([(east, north) for east in (x[0], x[-1]) for north in (y[0], y[-1])])
    start_x, start_y, theta = env.world.starts[row]
    east, north = (corners + np.array(raster.origin) - (start_x, start_y)).T
    own = np.stack(
        [
            math.cos(theta) * north - math.sin(theta) * east,
            math.cos(theta) * east + math.sin(theta) * north,
        ]
    )
    (low_row, low_column), (high_row, high_column) = (
        np.floor((limit - env.beliefs.origins[row, ::-1]) / _resolution(env)).astype(np.int64)
        for limit in (own.min(axis=1), own.max(axis=1))
    )
    within = np.zeros(env.beliefs.log_odds[row].shape, np.bool_)
    within[max(low_row, 0) : high_row + 1, max(low_column, 0) : high_column + 1] = True
    return within
