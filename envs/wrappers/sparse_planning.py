"""Sparse planning: robots drive along routes that are planned on their sparse maps.

It is for any policy: waypoints, chosen frontiers and orders of a station name the goals as ever.
"""

from typing import Any

import numpy as np
from gymnasium import spaces

from lidarium.envs.exploration import Observation, Outcome
from lidarium.envs.levels.decisions import DecisionWrapper
from lidarium.envs.levels.frontiers import FrontierExploration
from lidarium.envs.levels.waypoints import WaypointExploration
from lidarium.envs.radio.messages import DriveState, Route, Target
from lidarium.envs.simulation.kernels.arrays import ENDED

NEAR_GOAL_M = 0.6
"""Instead of a goal where the body cannot stand, a place so near to it will do [m]."""


class SparsePlanning(DecisionWrapper):
    """Lets robots drive to their goals along routes on their sparse maps, in place of paths on grids.

    A robot codes what its depth camera sees, and plans on the graph of that; where it leads to no goal,
    ground that the camera has not seen counts as free. It keeps a route as long as nothing new stands in its
    way, and plans again where something does. Observations, actions and infos are those of the environment
    below; ``infos[agent]["route"]`` says why there is no route to a robot's goal: ``start in collision``,
    ``goal in collision`` or ``no path``, and nothing where there is one.

    Parameters
    ----------
    env : WaypointExploration or FrontierExploration
        The environment at the level of waypoints or frontiers, with ``camera`` set.
    shares_map : bool
        Whether robots plan on what the whole team knows, where it reaches them at once.

    Raises
    ------
    ValueError
        Where the robots have no depth camera, or one that sees no ground.
    """

    def __init__(self, env: WaypointExploration | FrontierExploration, shares_map: bool = True) -> None:
        name = f"{str(env.metadata['name']).removesuffix('_v0')}_sparse_v0"
        super().__init__(env.unwrapped, name)
        self.below, self._shares_map = env, shares_map
        self.waypoints = env.waypoints if isinstance(env, FrontierExploration) else env
        self._reasons = [""] * env.settings.robots
        self.env.perception.sparse_maps.check()
        self.waypoints.router = self._route

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Return the space of an agent's observations, that of the environment below."""
        return self.below.observation_space(agent)

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Return the space of an agent's actions, that of the environment below."""
        return self.below.action_space(agent)

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """Start an episode; see ``ExplorationEnv.reset``."""
        observations, infos = self.below.reset(seed, options)
        self.agents, self._reasons = self.env.agents, [""] * self.settings.robots
        for row in range(self.settings.robots):
            # Robots map from the start on.
            self.env.perception.sparse_maps.of(row)
        return observations, self._with_reasons(infos)

    def step(self, actions: Any) -> Outcome:  # noqa: ANN401
        """Drive for one decision."""
        observations, rewards, terminations, truncations, infos = self.below.step(actions)
        self.agents = self.env.agents
        return observations, rewards, terminations, truncations, self._with_reasons(infos)

    def drive_state(self, agent: str) -> DriveState:
        """Return what an agent's driving is about."""
        return self.waypoints.drive_state(agent)

    def _route(self) -> None:
        """Plan routes for the robots that have a goal and no good route to it."""
        driver, held = self.waypoints.driver, self.env.operating.held
        for row in range(self.settings.robots):
            target, state = driver.target(row), driver.state(row)
            has_ended = self.env.world.flags[row] & ENDED or held[row]
            if target is None or has_ended or state is DriveState.GIVING_WAY:
                continue
            known = self.env.perception.sparse_maps.belief(row, self._shares_map)
            left = driver.route_left(row)
            if left is not None and (state is DriveState.ARRIVED or known.is_free(left)):
                continue
            driver.follow(row, self._planned(row, target))

    def _planned(self, row: int, target: Target) -> Route | None:
        """Return the route of a robot to its goal, or near it; None where there is none."""
        perception = self.env.perception
        known = perception.sparse_maps.belief(row, self._shares_map)
        start, goal = perception.poses.pose_in_frame(row, row)[:2], np.array([target.x, target.y])
        found = known.route(start, goal)
        if found.reason:
            near = known.nearest_standing(goal, NEAR_GOAL_M)
            found = found if near is None else known.route(start, near)
        if found.reason:
            found = known.hopeful(goal).route(start, goal)
        self._reasons[row] = found.reason
        return None if found.reason else Route(found.points, found.room, target.heading)

    def _with_reasons(self, infos: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
        for agent, info in infos.items():
            info["route"] = self._reasons[self.possible_agents.index(agent)]
        return infos
