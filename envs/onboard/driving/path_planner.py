"""The plans of paths on the maps that robots plan on."""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.onboard.driving.drives import Drives
from lidarium.envs.onboard.driving.planning import Destination, Planning, drive_to
from lidarium.envs.onboard.navigation import CLEARANCE_LIMIT
from lidarium.envs.onboard.people_in_sight import NOBODY
from lidarium.envs.onboard.perception import Perception
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.simulation.kernels.arrays import ENDED
from lidarium.mapping.planning.clearance import limit_of
from lidarium.mapping.planning.footprint import Footprint, passage_of
from lidarium.mapping.planning.grid_planning import Cell, cells_of
from lidarium.mapping.planning.search.search_state import Passage

BODY_MARGIN = 0.002
"""Paths keep the body this far from occupied cells [m]."""

PREFERRED_MARGIN = 0.15
"""Preferred distance of paths from walls [m]."""


def footprint_of(radius: float) -> Footprint:
    """Return the footprint by which a robot of this radius plans.

    Its small margin lets it pass narrow gaps; the preferred margin keeps off walls if possible.
    """
    return Footprint(radius + BODY_MARGIN, radius + PREFERRED_MARGIN, 3.0)


class PathPlanner:
    """Plans the paths of the robots of all episodes.

    Positions are in the frames of the believed poses.

    Parameters
    ----------
    perception : Perception
        The beliefs of the robots.
    settings : ExplorationSettings
        The team of every episode.
    drives : Drives
        The drives of all robots; row = episode * robots + robot.
    footprint : Footprint
        Footprint by which the robots plan.
    shares_map : bool
        Whether robots plan on the team's map, if it reaches them.

    Attributes
    ----------
    held : (rows,) bool
        Robots that stand still in any drive state; others drive around them as around robots that have ended.
    """

    def __init__(
        self,
        perception: Perception,
        settings: ExplorationSettings,
        drives: Drives,
        footprint: Footprint,
        shares_map: bool,
    ) -> None:
        self._perception, self._settings, self._drives = perception, settings, drives
        self.footprint, self.shares_map = footprint, shares_map
        self.held: NDArray[np.bool_] = np.zeros(settings.robots * perception.world.episodes, np.bool_)

    @property
    def passage(self) -> Passage:
        """Parameters of the robots' passage over a map.

        Read-only and shared, so not kept here: copies would be other types to kernels.
        """
        resolution = self._settings.occupancy.resolution
        return passage_of(self.footprint, resolution, limit_of(CLEARANCE_LIMIT, resolution))

    def planning(
        self, rows: NDArray[np.int64], *, with_frontiers: bool = False, people: NDArray[np.float64] | None = None
    ) -> Planning:
        """Return the arrays that kernels plan with.

        It has the maps that the given rows plan on, with frontiers if wanted, and people (K, 2) to drive around.
        """
        perception, settings, resolution = (
            self._perception,
            self._settings,
            self._settings.occupancy.resolution,
        )
        records, sharing = perception.provide_records(rows, self.shares_map, with_frontiers=with_frontiers)
        world = perception.world
        return Planning(
            settings.robots,
            perception.poses.knows_teammates,
            perception.beliefs.contact,
            perception.beliefs.heard,
            settings.robot.radius,
            resolution,
            self.footprint.radius + 2 * resolution,
            CLEARANCE_LIMIT,
            *self.passage,
            records,
            sharing,
            perception.memory.table,
            perception.beliefs.believed,
            perception.beliefs.origins,
            perception.offsets,
            (world.flags & ENDED != 0) | self.held,
            NOBODY if people is None else people,
        )

    def fresh_planning(self, row: int, people: NDArray[np.float64] | None = None) -> Planning:
        """Return the planning arrays of one robot, with its map up to date."""
        self._perception.planning_map(row, self.shares_map)
        return self.planning(np.array([row]), people=people)

    def origin(self, row: int) -> tuple[float, float]:
        """Return the lower left corner of a robot's map [m]."""
        origin = self._perception.beliefs.origins[row]
        return float(origin[0]), float(origin[1])

    def cell(self, row: int) -> Cell:
        """Return the cell of a robot's map in which it is."""
        place = cells_of(
            self._perception.beliefs.believed[row, :2], self.origin(row), self._settings.occupancy.resolution
        )
        return int(place[0]), int(place[1])

    def drive_to(
        self,
        row: int,
        goal: Cell,
        avoided: list[int],
        heading: float = math.nan,
        maximum_cost: float = math.inf,
        people: NDArray[np.float64] | None = None,
    ) -> bool:
        """Plan a path round the bodies of ``avoided`` and round people (K, 2) [m], and start on it.

        False if no path exists.
        """
        chosen = np.zeros(self._settings.robots, np.bool_)
        chosen[np.array(avoided, np.int64) % self._settings.robots] = True
        planning = self.fresh_planning(row, people)
        destination = Destination(*goal, math.nan, math.nan, heading, maximum_cost)
        return bool(drive_to(planning, self._drives, row, destination, chosen, 0))

    def remaining(self, row: int) -> NDArray[np.float64]:
        """Return the rest of a robot's path, shape (N, 2) [m].

        It begins at the robot's position.
        """
        place, count = int(self._drives.places[row]), int(self._drives.counts[row])
        here = self._perception.beliefs.believed[row : row + 1, :2]
        return np.concatenate([here, self._drives.paths[row, place:count]]) if count else here.copy()
