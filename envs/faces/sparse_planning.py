"""Sparse planning: robots drive along routes that are planned on their sparse maps.

It works with any policy: waypoints, chosen frontiers and orders of a station name the goals as usual.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.engine.engine import Engine
from lidarium.envs.faces.parallel import Observation, Outcome
from lidarium.envs.faces.wrapper import TeamWrapper, exploration_below
from lidarium.envs.levels.waypoint import WaypointLevel
from lidarium.envs.onboard.radio.messages import DriveState, Route, Target
from lidarium.envs.simulation.kernels.arrays import ENDED

NEAR_GOAL_M = 0.6
"""Maximum distance to a goal of a substitute position if the body cannot stand at the goal [m]."""


class SparsePlanning(TeamWrapper):
    """Lets robots drive to their goals along routes on their sparse maps, instead of paths on grids.

    A robot codes the images of its depth camera, and plans on the resulting graph; if the graph has no path to the
    goal, ground that the camera has not seen counts as free. The robot keeps a route until a new obstacle blocks it.
    Observations, actions and infos are those of the environment below; ``infos[agent]["route"]`` gives the reason if
    there is no route to a robot's goal: ``start in collision``, ``goal in collision`` or ``no path``; otherwise it is
    empty.

    Parameters
    ----------
    env : ParallelEnv
        The environment at the level of waypoints or frontiers, with ``camera`` set.
    shares_map : bool, optional
        Whether robots plan on the map of the whole team, if it reaches them at once. True by default.

    Raises
    ------
    ValueError
        If the robots have no depth camera, or one that sees no ground, or actions are speeds.
    """

    def __init__(self, env: Any, shares_map: bool = True) -> None:  # noqa: ANN401
        base = exploration_below(getattr(env, "unwrapped", env), "SparsePlanning")
        super().__init__(env)
        self.metadata = {**env.metadata, "name": str(env.metadata["name"]).replace("_v1", "_sparse_v1")}
        self._router = _Router(base.engine, shares_map)

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """Start an episode; see ``ExplorationEnv.reset``."""
        observations, infos = super().reset(seed, options)
        self._router.start()
        return observations, self._with_reasons(infos)

    def step(self, actions: Any) -> Outcome:  # noqa: ANN401
        """Drive for one decision."""
        observations, rewards, terminations, truncations, infos = super().step(actions)
        return observations, rewards, terminations, truncations, self._with_reasons(infos)

    def drive_state(self, agent: str) -> DriveState:
        """Return the state of an agent's drive to its target."""
        return self.unwrapped.drive_state(agent)

    def _with_reasons(self, infos: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
        for agent, info in infos.items():
            info["route"] = self._router.reasons[self.possible_agents.index(agent)]
        return infos


class _Router:
    """Plans the routes of all robots of an engine on their sparse maps.

    Parameters
    ----------
    engine : Engine
        The episodes, at the level of waypoints or frontiers.
    shares_map : bool
        Whether robots plan on the map of the whole team.

    Attributes
    ----------
    reasons : list of str
        Why there is no route to the goal of each row; empty if there is one.
    """

    def __init__(self, engine: Engine, shares_map: bool) -> None:
        level = engine.level
        if not isinstance(level, WaypointLevel):
            raise ValueError(
                f"SparsePlanning is put around the level {engine.level_name!r}; want waypoints or frontiers"
            )
        self._perception = engine.perception
        self._driver = level.driver
        self._held = engine.operating.held
        self._shares_map = shares_map
        self._rows = engine.rows
        self.reasons = [""] * engine.rows
        self._perception.sparse_maps.check()
        level.router = self.route

    def start(self) -> None:
        """Begin an episode: robots map from the start on."""
        self.reasons = [""] * self._rows
        for row in range(self._rows):
            self._perception.sparse_maps.of(row)

    def route(self, rows: NDArray[np.int64]) -> None:
        """Plan routes for robots that have a goal and no good route to it."""
        driver, world = self._driver, self._perception.world
        for row in rows.tolist():
            target, state = driver.target(row), driver.state(row)
            if target is None or world.flags[row] & ENDED or self._held[row] or state is DriveState.GIVING_WAY:
                continue
            known = self._perception.sparse_maps.belief(row, self._shares_map)
            left = driver.route_left(row)
            if left is not None and (state is DriveState.ARRIVED or known.is_free(left)):
                continue
            driver.follow(row, self._planned(row, target))

    def _planned(self, row: int, target: Target) -> Route | None:
        """Return the route of a robot to its goal, or near it; None if no route exists."""
        perception = self._perception
        known = perception.sparse_maps.belief(row, self._shares_map)
        start, goal = perception.poses.pose_in_frame(row, row)[:2], np.array([target.x, target.y])
        found = known.route(start, goal)
        if found.reason:
            near = known.nearest_standing(goal, NEAR_GOAL_M)
            found = found if near is None else known.route(start, near)
        if found.reason:
            found = known.hopeful(goal).route(start, goal)
        self.reasons[row] = found.reason
        return None if found.reason else Route(found.points, found.room, target.heading)
