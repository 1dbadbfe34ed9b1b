"""Routes of robots to their goals, planned on their sparse maps."""

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.engine.engine import Engine
from lidarium.envs.levels.level import Level
from lidarium.envs.levels.waypoint import WaypointLevel
from lidarium.envs.onboard.radio.messages import MOST_POINTS, DriveState, Route, Target
from lidarium.envs.simulation.kernels.arrays import ENDED

NEAR_GOAL_M = 0.6
"""Maximum distance to a goal of a substitute position if the body cannot stand at the goal [m]."""


def routed(name: str, level: Level) -> WaypointLevel:
    """Return a level whose robots can drive along routes; raise ValueError for others."""
    if not isinstance(level, WaypointLevel):
        raise ValueError(f"SparsePlanning is put around the level {name!r}; want waypoints or frontiers")
    return level


class SparseRouter:
    """Plans the routes of all robots of an engine on their sparse maps.

    Parameters
    ----------
    engine : Engine
        The episodes, at the level of waypoints or frontiers.
    shares_map : bool, optional
        Whether robots plan on the map of the whole team. True by default.

    Attributes
    ----------
    reasons : list of str
        Why there is no route to the goal of each row; empty if there is one.
    """

    def __init__(self, engine: Engine, shares_map: bool = True) -> None:
        level = routed(engine.level_name, engine.level)
        self._perception = engine.perception
        self._driver = level.driver
        self._held = engine.operating.held
        self.shares_map = shares_map
        self._rows = engine.rows
        self.reasons = [""] * engine.rows
        self._perception.sparse_maps.check()
        level.router = self.route

    def start(self, rows: NDArray[np.int64] | None = None) -> None:
        """Begin the episodes of some rows, by default of all: robots map from the start on."""
        for row in range(self._rows) if rows is None else rows.tolist():
            self.reasons[row] = ""
            self._perception.sparse_maps.of(row)

    def route(self, rows: NDArray[np.int64]) -> None:
        """Plan routes for robots that have a goal and no good route to it."""
        driver, world = self._driver, self._perception.world
        for row in rows.tolist():
            target, state = driver.target(row), driver.state(row)
            if target is None or world.flags[row] & ENDED or self._held[row] or state is DriveState.GIVING_WAY:
                continue
            known = self._perception.sparse_maps.belief(row, self.shares_map)
            left = driver.route_left(row)
            if left is not None and (state is DriveState.ARRIVED or known.is_free(left)):
                continue
            driver.follow(row, self._planned(row, target))

    def _planned(self, row: int, target: Target) -> Route | None:
        """Return the route of a robot to its goal, or near it; None if no route exists."""
        perception = self._perception
        known = perception.sparse_maps.belief(row, self.shares_map)
        start, goal = perception.poses.pose_in_frame(row, row)[:2], np.array([target.x, target.y])
        found = known.route(start, goal)
        if found.reason:
            near = known.nearest_standing(goal, NEAR_GOAL_M)
            found = found if near is None else known.route(start, near)
        if found.reason and self._is_on_map(row, goal):
            found = known.hopeful(goal).route(start, goal)
        self.reasons[row] = "no path" if len(found.points) > MOST_POINTS else found.reason
        return None if self.reasons[row] else Route(found.points, found.room, target.heading)

    def _is_on_map(self, row: int, place: NDArray[np.float64]) -> bool:
        """Whether a position in a robot's map frame is on its grid; goals beyond have no path at any level."""
        perception = self._perception
        size = np.array(perception.beliefs.log_odds[row].shape[::-1]) * perception.settings.occupancy.resolution
        place = place - perception.poses.origin_in_frame(row)
        return bool((place >= 0.0).all() and (place < size).all())
