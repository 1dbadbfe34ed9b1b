"""Frames of robots that do not know their starts, whose maps become one.

Above are the robots' own maps. Below is the floor with what is known of it.
"""

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
    Colour,
    Frame,
    View,
    blocks_of,
    draw_paths,
    draw_robots,
    enlarged,
    line_of_text,
    team_colours,
    with_header,
)
from lidarium.envs.drawing.rendering import view_of
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.evaluation.drawing.films.own_maps import JOINED, OwnMaps
from lidarium.evaluation.drawing.maps.joined_maps import overlaid, shades_of
from lidarium.evaluation.episodes.supervision import joined_groups
from lidarium.evaluation.truth.beliefs import maps_on_floor
from lidarium.mapping.grids.occupancy import FREE, OCCUPIED, three_levels

CAPTION = 28
"""Height of the line between the maps and the floor [pixels]."""


class MapFrames:
    """The robots' own maps, and how a station joins them.

    On the floor, what a map shows is in the colour of its robot, and what joined maps show is white.

    Parameters
    ----------
    policy : Policy
        What drives the robots; one with a station joins maps.
    width : int
        Of a frame [pixels].
    """

    def __init__(self, policy: Policy, width: int) -> None:
        self._policy, self._width = policy, width - 2 * BORDER
        self._shown: list[set[int]] = []
        self._own: OwnMaps | None = None

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
        """Return the line below the maps: which are joined just now, or what white is."""
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


def _floor(
    env: ExplorationEnv, width: int, groups: Sequence[set[int]], joined: list[tuple[int, int]]
) -> Frame:
    """Draw what is known of the floor, the robots, and who is joined just now."""
    colours, scene = team_colours(env.settings.robots), env.scene()
    tables = env.world.floors[0]
    assert tables is not None
    view = view_of(tables, width)
    frame = _known(env, view, groups, colours)
    draw_paths(frame, view, np.stack([poses[:, :2] for poses in (*scene.track, scene.poses)]), colours)
    for pair in joined:
        first, last = view.pixels(scene.poses[list(pair), :2]).tolist()
        cv2.line(frame, first, last, JOINED, 4, cv2.LINE_AA, SHIFT)
    radii = [robot.radius for robot in env.settings.team]
    draw_robots(frame, view, scene.poses, radii, scene.has_ended, colours)
    left = (width - view.width) // 2  # of a tall floor
    return np.asarray(
        cv2.copyMakeBorder(
            frame, 0, 0, left, width - left - view.width, cv2.BORDER_CONSTANT, value=BACKGROUND
        ),
        np.uint8,
    )


def _known(env: ExplorationEnv, view: View, groups: Sequence[set[int]], colours: list[Colour]) -> Frame:
    """Draw what each group of robots knows of the floor, mixed where several do."""
    tables = env.world.floors[0]
    assert tables is not None
    raster, maps = tables.laser, maps_on_floor(env)
    multiple = round(env.settings.occupancy.resolution / raster.resolution)
    solid = np.where(raster.solid[view.rows, view.columns] != 0, np.uint8(OCCUPIED), np.uint8(FREE))
    picture = np.array([BACKGROUND, UNEXPLORED], np.uint8)[(blocks_of(solid, view) == FREE).astype(np.uint8)]
    known = []
    for group in groups:
        levels = three_levels(np.sum(maps[sorted(group)], axis=0, dtype=np.int16))
        levels = blocks_of(_enlarged_cells(levels, multiple)[view.rows, view.columns], view)
        known.append((levels == OCCUPIED).astype(np.int8) - (levels == FREE))
    return enlarged(overlaid(picture, known, [shades_of(group, colours) for group in groups]), view)


def _enlarged_cells(levels: NDArray[np.uint8], multiple: int) -> NDArray[np.uint8]:
    """Return a map of cells that are so many cells of the floor's raster wide."""
    return levels if multiple == 1 else np.repeat(np.repeat(levels, multiple, axis=0), multiple, axis=1)
