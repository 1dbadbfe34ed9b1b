"""What a robot's onboard software knows: its pose and map, and what reached it of the others.

With known starts and the ideal radio all robots share one map, the sum of their log-odds. Both kinds of map come with
what planning needs (clearance and frontiers), brought up to date only where the map has changed.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.settings import ExplorationSettings
from lidarium.envs.simulation.kinematic import ENDED, KinematicWorld
from lidarium.mapping.clearance import ClearanceField
from lidarium.mapping.frontiers import FrontierMap
from lidarium.mapping.grid_planning import SearchSpace
from lidarium.mapping.kernels import Array, int8_grid_at, kernel

CLEARANCE_LIMIT = 0.6
"""Clearance is told exactly up to this [m]."""


class NavigationMap:
    """A map of log-odds with its clearance and frontiers.

    Parameters
    ----------
    log_odds : (rows, columns) int8
        The map; it may be written by its owner, who says so by ``changed``.
    resolution : float
        Side of a cell [m].
    """

    def __init__(self, log_odds: NDArray[np.int8], resolution: float) -> None:
        self._log_odds, self.resolution = log_odds, resolution
        rows, columns = log_odds.shape
        self.clearance = ClearanceField((rows, columns), resolution, CLEARANCE_LIMIT)
        self.frontiers = FrontierMap((rows, columns), resolution)
        self.space = SearchSpace((rows, columns), resolution)
        self._long: FrontierMap | None = None
        self._long_cells: NDArray[np.int64] = np.zeros((0, 2), np.int64)

    @property
    def log_odds(self) -> NDArray[np.int8]:
        """The map, read-only: only its owner, who holds the array itself, writes it."""
        view = self._log_odds.view()
        view.flags.writeable = False
        return view

    def changed(self, window: tuple[int, int, int, int]) -> None:
        """Bring clearance and frontiers up to date in a window (row_low, row_high, column_low, column_high)."""
        self.clearance.update(self.log_odds, window)
        self.frontiers.update(self.log_odds, window)

    def long_frontiers(self, minimum_size: float) -> FrontierMap:
        """Return the frontiers without those shorter than ``minimum_size`` [m]; valid until the next call."""
        if self._long is None:
            self._long = FrontierMap(self.log_odds.shape, self.resolution)
        self._long.remove(self._long_cells)
        self._long_cells = self.frontiers.clusters(minimum_cells=max(math.ceil(minimum_size / self.resolution - 1e-9), 1)).cells
        self._long.add(self._long_cells)
        return self._long


@dataclass(frozen=True, slots=True)
class Teammate:
    """What a robot knows of another.

    Attributes
    ----------
    pose : (3,) float64
        x, y, theta in the knowing robot's map frame [m, rad].
    age_s : float
        Age of the news [s].
    radius : float
        Radius of the body [m].
    has_ended : bool
        Whether it has ended and stands where it is.
    """

    pose: NDArray[np.float64]
    age_s: float
    radius: float
    has_ended: bool


@kernel
def _sum_maps(addresses: Array, rows: int, columns: int, window: Array, total: Array) -> None:
    """Write the sum of maps of one shape into ``total`` within a window."""
    for row in range(window[0], window[1]):
        target = total[row]
        for column in range(window[2], window[3]):
            target[column] = 0
        for k in range(addresses.shape[0]):
            source = int8_grid_at(addresses[k], rows, columns)[row]
            for column in range(window[2], window[3]):
                value = np.int16(target[column]) + np.int16(source[column])
                target[column] = np.int8(min(max(value, np.int16(-127)), np.int16(127)))


class Belief:
    """Read-only handle on what one robot knows; what it shows is valid until the next step.

    All positions are in the robot's map frame: with known starts the floor's axes from the corner of its start cell.

    Parameters
    ----------
    perception : Perception
        The team's onboard software.
    row : int
        Which robot.
    """

    def __init__(self, perception: "Perception", row: int) -> None:
        self._perception, self._row = perception, row

    @property
    def pose(self) -> NDArray[np.float64]:
        """x, y, theta as the localizer believes [m, rad], shape (3,)."""
        return self._perception.pose_in_frame(self._row, self._row)

    @property
    def velocity(self) -> NDArray[np.float64]:
        """Speed and turn rate as odometry tells [m/s, rad/s], shape (2,)."""
        return np.array(self._perception.world.velocities[self._row])

    @property
    def spread(self) -> NDArray[np.float64]:
        """Standard deviation of the pose [m, m, rad], shape (3,); zero for the true localizer."""
        return np.zeros(3)

    @property
    def radius(self) -> float:
        """Radius of the own body [m]."""
        return self._perception.settings.robot.radius

    @property
    def map(self) -> NavigationMap:
        """The own map."""
        return self._perception.own_map(self._row)

    @property
    def map_origin(self) -> tuple[float, float]:
        """Lower left corner of cell (0, 0) of the own map, and of the shared map, in the map frame [m]."""
        return self._perception.origin_in_frame(self._row)

    @property
    def shared_map(self) -> NavigationMap | None:
        """The team's map, where it reached this robot; None with unknown starts."""
        return self._perception.shared_map()

    @property
    def teammates(self) -> dict[str, Teammate]:
        """What is known of the others, by name."""
        return self._perception.teammates(self._row)

    @property
    def goal(self) -> NDArray[np.float64] | None:
        """The goal in the map frame [m], shape (2,), or None."""
        return self._perception.goal_of(self._row)


class Perception:
    """The onboard software of a team: keeps maps for navigation up to date, on demand.

    Parameters
    ----------
    world : KinematicWorld
        Whose maps and believed poses they are.
    settings : ExplorationSettings
        The team.
    offsets : (robots, 2) float64
        Origin of each robot's map frame in the frame of its believed pose [m]; the environment's own array.
    """

    def __init__(self, world: KinematicWorld, settings: ExplorationSettings, offsets: NDArray[np.float64]) -> None:
        self.world, self.settings, self._offsets = world, settings, offsets
        self._own: dict[int, NavigationMap] = {}
        self._shared: NavigationMap | None = None
        self._sum: NDArray[np.int8] = np.zeros((0, 0), np.int8)
        self._goal: tuple[float, float] | None = None
        self._fresh_at = -2

    def start(self, goal: tuple[float, float] | None = None) -> None:
        """Begin an episode."""
        self._own, self._shared, self._goal = {}, None, goal
        self._fresh_at = -2

    def belief(self, agent: str) -> Belief:
        """Return the handle on what an agent knows."""
        return Belief(self, self.settings.agents.index(agent))

    def own_map(self, row: int) -> NavigationMap:
        """Return a robot's own map, up to date."""
        self._refresh()
        if row not in self._own:
            log_odds = self.world.log_odds[row]
            self._own[row] = NavigationMap(log_odds, self.settings.occupancy.resolution)
            self._own[row].changed((0, log_odds.shape[0], 0, log_odds.shape[1]))
        return self._own[row]

    def shared_map(self) -> NavigationMap | None:
        """Return the team's map, up to date; a lone robot's is its own."""
        if not self.settings.known_starts:
            return None
        if self.settings.robots == 1:
            return self.own_map(0)
        self._refresh()
        if self._shared is None:
            shape = self.world.log_odds[0].shape
            self._sum = np.zeros(shape, np.int8)
            self._shared = NavigationMap(self._sum, self.settings.occupancy.resolution)
            self._share((0, shape[0], 0, shape[1]))
        return self._shared

    def _refresh(self) -> None:
        """Take in what the maps have changed since the last look."""
        step = int(self.world.steps[0])
        if step == self._fresh_at:
            return
        self._fresh_at = step
        for row in range(self.settings.robots):
            low_row, high_row, low_column, high_column = (int(value) for value in self.world.windows[row])
            window = (low_row, high_row, low_column, high_column)
            if window[0] >= window[1] or window[2] >= window[3]:
                continue
            if row in self._own:
                self._own[row].changed(window)
            if self._shared is not None:
                self._share(window)
        self.world.forget_changes(0, self.settings.robots)

    def _share(self, window: tuple[int, int, int, int]) -> None:
        assert self._shared is not None
        rows, columns = self._shared.log_odds.shape
        addresses = np.array([log_odds.ctypes.data for log_odds in self.world.log_odds], np.int64)
        _sum_maps(addresses, rows, columns, np.array(window, np.int64), self._sum)
        self._shared.changed(window)

    def offset(self, row: int) -> NDArray[np.float64]:
        """Return the origin of a robot's map frame in the frame of its believed pose [m], shape (2,)."""
        return np.asarray(self._offsets[row])

    def pose_in_frame(self, of: int, to: int) -> NDArray[np.float64]:
        """Return the believed pose of a robot in the map frame of another (or its own), shape (3,)."""
        x, y, theta = self.world.believed[of]
        return np.array([x - self._offsets[to, 0], y - self._offsets[to, 1], theta])

    def origin_in_frame(self, row: int) -> tuple[float, float]:
        """Return the lower left corner of a robot's map in its map frame [m]."""
        x, y = self.world.origins[row] - self._offsets[row]
        return float(x), float(y)

    def teammates(self, row: int) -> dict[str, Teammate]:
        """Return what a robot knows of the others: with known starts and the ideal radio, where they are now."""
        if not self.settings.known_starts:
            return {}
        return {
            agent: Teammate(self.pose_in_frame(other, row), 0.0, self.settings.robot.radius, bool(self.world.flags[other] & ENDED))
            for other, agent in enumerate(self.settings.agents)
            if other != row
        }

    def goal_of(self, row: int) -> NDArray[np.float64] | None:
        """Return the goal in a robot's map frame; None without a goal, and where the robot does not know its start."""
        if self._goal is None or not self.settings.known_starts:
            return None
        return np.asarray(self._goal - self._offsets[row])

    def goal_in_frame(self, row: int) -> NDArray[np.float32]:
        """Return the goal for the observation: as ``goal_of``, zeros where it is not known."""
        goal = self.goal_of(row)
        return np.zeros(2, np.float32) if goal is None else goal.astype(np.float32)
