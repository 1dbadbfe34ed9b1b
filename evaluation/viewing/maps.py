"""Maps of a team as a page shows them: one picture of the ground, and the frontiers."""

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.envs.drawing.frame_parts import UNEXPLORED, Colour, Frame, team_colours
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.evaluation.drawing.maps.joined_maps import overlaid, shades_of
from lidarium.evaluation.report.page.map_layers import FREE, OCCUPIED, UNKNOWN, coarse, grid_around
from lidarium.evaluation.truth.beliefs import map_within
from lidarium.evaluation.truth.true_map import truth_of

LEAST_FRONTIER_M = 0.3
"""Frontiers shorter than this are left out [m]."""

Levels = NDArray[np.int8]


class TeamMaps:
    """The maps of a team on a common grid, and how a page shows them.

    Parameters
    ----------
    env : ExplorationEnv
        After a reset.

    Attributes
    ----------
    cell_m : float
        Side of a cell [m].
    corner : (x, y)
        Lower left corner of the grid in the floor's frame [m].
    size : (width, height)
        Of the grid [m].
    """

    def __init__(self, env: ExplorationEnv) -> None:
        resolution, tables = env.settings.occupancy.resolution, env.world.floors[0]
        assert tables is not None
        self._grid = grid = grid_around(truth_of(env).knowable, resolution)
        self._colours: list[Colour] = team_colours(env.settings.robots)
        self.cell_m = grid.block * resolution
        x, y = tables.laser.origin
        self.corner = (x + grid.column * resolution, y + grid.row * resolution)
        self.size = (grid.columns * self.cell_m, grid.rows * self.cell_m)

    def levels(self, env: ExplorationEnv, groups: Sequence[set[int]]) -> list[Levels]:
        """Return the map of each group of robots, (rows, columns): above 0 occupied, below 0 free."""
        maps = [map_within(env, row, *self._grid.window) for row in range(env.settings.robots)]
        together = [
            np.sum([maps[robot] for robot in sorted(group)], axis=0, dtype=np.int16) for group in groups
        ]
        return [self._coarse(np.asarray(log_odds)) for log_odds in together]

    def _coarse(self, log_odds: NDArray[np.signedinteger[Any]]) -> Levels:
        classes = coarse(np.asarray(log_odds > 0), np.asarray(log_odds < 0), self._grid.block)
        signs = np.zeros(3, np.int8)
        signs[[UNKNOWN, FREE, OCCUPIED]] = 0, -1, 1
        return signs[classes]

    def picture(self, groups: Sequence[set[int]], maps: Sequence[Levels]) -> Frame:
        """Return a picture of the ground with the maps of groups over it, upright.

        What a robot alone knows is in its colour, what is joined in white and dark.
        """
        blank = np.full((self._grid.rows, self._grid.columns, 3), UNEXPLORED, np.uint8)
        picture = overlaid(blank, maps, [shades_of(group, self._colours) for group in groups])
        return np.ascontiguousarray(picture[::-1])

    def frontiers(self, maps: Sequence[Levels]) -> NDArray[np.float64]:
        """Return the middles of free cells beside unknown ones, of any of the maps, (N, 2) [m]."""
        found = [self._frontier(levels) for levels in maps]
        if not found:
            return np.zeros((0, 2))
        rows, columns = np.nonzero(np.any(found, axis=0))
        places = np.column_stack([columns, rows]).astype(np.float64) + 0.5
        return np.array(self.corner) + self.cell_m * places

    def _frontier(self, levels: Levels) -> NDArray[np.bool_]:
        cross = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
        beside_unknown = cv2.dilate((levels == 0).view(np.uint8), cross) != 0
        frontier = (beside_unknown & (levels < 0)).view(np.uint8)
        _, labels, measures, _ = cv2.connectedComponentsWithStats(frontier, connectivity=8)
        is_long = measures[:, cv2.CC_STAT_AREA] * self.cell_m >= LEAST_FRONTIER_M
        is_long[0] = False
        return np.asarray(is_long[labels])
