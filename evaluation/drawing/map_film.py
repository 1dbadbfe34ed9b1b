"""The film ``maps``: robots that do not know their starts, and how a station joins their maps.

Above are the robots' own maps, each in its own frame. Below is the floor with its known part.
"""

import math
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.agents.policy import Policy
from lidarium.envs.drawing.frame_parts import (
    BACKGROUND,
    BORDER,
    EXPLORED,
    INK,
    SHIFT,
    UNEXPLORED,
    Cell,
    Colour,
    Frame,
    View,
    blocks_of,
    draw_crowd,
    draw_paths,
    draw_robots,
    enlarged,
    line_of_text,
    pale,
    team_colours,
    thinned,
    view_around,
    with_header,
)
from lidarium.envs.drawing.prediction_layer import STRENGTH, tinted
from lidarium.envs.drawing.rendering import view_of
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.simulation.people.crowd import crowd_of
from lidarium.evaluation.drawing.joined_maps import overlaid, shades_of
from lidarium.evaluation.episodes.events import joined_groups
from lidarium.evaluation.truth.beliefs import maps_on_floor
from lidarium.mapping.grids.occupancy import FREE, OCCUPIED, UNKNOWN, three_levels

JOINED: Colour = (13, 148, 136)
"""Colour of joins."""

MOST_IN_A_ROW = 4
GAP, LINE = 8, 24
"""Between tiles; height of the line above a map [pixels]."""

_SHARE = 0.3
"""Height of a tile's map as a share of the picture's width, if tiles leave room for it."""


class OwnMaps:
    """Draws each robot's own map, as the robot has it.

    A tile shows the part of the map that the floor can fill: it does not move as the map grows.
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
        log_odds = env.beliefs.log_odds[robot]
        levels = blocks_of(three_levels(log_odds[view.rows, view.columns]), view)
        picture, layer = palette[levels], env.engine.prediction()
        if layer is not None:
            free = layer.cells(log_odds, _resolution(env), f"of {robot}")[view.rows, view.columns]
            picture = tinted(picture, STRENGTH * (levels == UNKNOWN) * thinned(free, view.block))
        drawn = enlarged(picture, view)
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


CAPTION = 28
"""Height of the line between the maps and the floor [pixels]."""


class MapFrames:
    """The robots' own maps, and how a station joins them.

    On the floor, a map is in the colour of its robot, and joined maps are white.
    """

    def __init__(self, policy: Policy, width: int) -> None:
        self._policy, self._width = policy, width - 2 * BORDER
        self._shown: list[set[int]] = []
        self._own: OwnMaps | None = None

    @staticmethod
    def check(settings: ExplorationSettings) -> None:
        """Check that robots do not know their starts."""
        if settings.known_starts:
            raise ValueError(
                "--film-shows is maps, but the robots know their starts and share one map; want scans, or "
                "--unknown-starts"
            )

    def happens(self, env: ExplorationEnv) -> bool:
        """Whether maps were joined since the frame before."""
        return bool(self._joined(env)[1])

    def draw(self, env: ExplorationEnv) -> Frame:
        """Return the frame of this moment."""
        if self._own is None:
            self._own = OwnMaps(env, self._width)
        self._shown, joined = self._joined(env)
        parts = (
            self._own.draw(env, self._shown),
            self._caption(joined),
            _floor(env, self._width, self._shown, joined),
        )
        name = env.floor.name if env.floor else ""
        return with_header(np.concatenate(parts), name, env.scorer.coverage, env.scorer.time)

    def _caption(self, joined: list[tuple[int, int]]) -> Frame:
        """Return the line below the maps: pairs that were just joined, or the legend."""
        size = self._width, CAPTION
        if joined:
            pairs = ", ".join(f"{a} and {b}" for a, b in joined)
            return line_of_text(f"the station joins the maps of robots {pairs}", size, EXPLORED, JOINED)
        has_station = self._policy.report().supervision is not None
        words = "white: maps that the station has joined" if has_station else "each map in its robot's colour"
        return line_of_text(words, size, INK, BACKGROUND)

    def _joined(self, env: ExplorationEnv) -> tuple[list[set[int]], list[tuple[int, int]]]:
        """Return groups of joined maps, and the pairs joined since the frame before."""
        groups, pairs = joined_groups(self._policy.report(), env.possible_agents)
        return groups, [pair for pair in pairs if not any(set(pair) <= group for group in self._shown)]


def _floor(env: ExplorationEnv, width: int, groups: Sequence[set[int]], joined: list[tuple[int, int]]) -> Frame:
    """Draw the known part of the floor, the robots, and pairs that were just joined."""
    colours, scene = team_colours(env.settings.robots), env.scene()
    tables = env.world.floors[0]
    assert tables is not None
    view = view_of(tables, width)
    frame = _known(env, view, groups, colours)
    draw_paths(frame, view, np.stack([poses[:, :2] for poses in (*scene.track, scene.poses)]), colours)
    for pair in joined:
        first, last = view.pixels(scene.poses[list(pair), :2]).tolist()
        cv2.line(frame, first, last, JOINED, 4, cv2.LINE_AA, SHIFT)
    draw_crowd(frame, view, crowd_of(env.simulation.population))
    radii = [robot.radius for robot in env.settings.team]
    draw_robots(frame, view, scene.poses, radii, scene.has_ended, colours)
    left = (width - view.width) // 2  # of a tall floor
    return np.asarray(
        cv2.copyMakeBorder(frame, 0, 0, left, width - left - view.width, cv2.BORDER_CONSTANT, value=BACKGROUND),
        np.uint8,
    )


def _known(env: ExplorationEnv, view: View, groups: Sequence[set[int]], colours: list[Colour]) -> Frame:
    """Draw the part of the floor that each group knows, mixed if several do."""
    tables = env.world.floors[0]
    assert tables is not None
    raster, maps = tables.laser, maps_on_floor(env)
    multiple = round(env.settings.occupancy.resolution / raster.resolution)
    solid = np.where(raster.solid[view.rows, view.columns] != 0, np.uint8(OCCUPIED), np.uint8(FREE))
    picture = np.array([BACKGROUND, UNEXPLORED], np.uint8)[(blocks_of(solid, view) == FREE).astype(np.uint8)]
    layer = env.engine.prediction()
    if layer is not None:
        free = _enlarged_cells(layer.on_floor(env.simulation, env.settings, 0), multiple)[view.rows, view.columns]
        picture = tinted(picture, STRENGTH * thinned(free, view.block))
    known = []
    for group in groups:
        levels = three_levels(np.sum(maps[sorted(group)], axis=0, dtype=np.int16))
        levels = blocks_of(_enlarged_cells(levels, multiple)[view.rows, view.columns], view)
        known.append((levels == OCCUPIED).astype(np.int8) - (levels == FREE))
    return enlarged(overlaid(picture, known, [shades_of(group, colours) for group in groups]), view)


def _enlarged_cells(cells: NDArray[Cell], multiple: int) -> NDArray[Cell]:
    """Return a map of cells that are that many cells of the floor's raster wide."""
    return cells if multiple == 1 else np.repeat(np.repeat(cells, multiple, axis=0), multiple, axis=1)
