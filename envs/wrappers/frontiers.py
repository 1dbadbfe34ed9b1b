"""Decisions by frontiers: a robot chooses among the frontiers that it can come near, cheapest way first."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lidarium.envs.exploration import ExplorationEnv, Observation
from lidarium.envs.onboard.navigation import NavigationMap
from lidarium.envs.onboard.state import DriveState, Target
from lidarium.envs.onboard.team_driver import footprint_of
from lidarium.envs.wrappers.decisions import DecisionWrapper
from lidarium.envs.wrappers.waypoints import WaypointExploration
from lidarium.mapping.frontier_approach import approach, default_reach
from lidarium.mapping.grid_planning import Cell, cells_of, centres_of, search

CANDIDATES = 16
"""Most frontiers that a robot chooses among."""

MINIMUM_SIZE = 0.1
"""Shorter frontiers are offered only where there is no longer one [m]."""

FARTHEST = 1000.0

PATIENCE_S = 20.0
"""A frontier is given up where its robot has not moved for this long [s]."""

MOVED = 0.15
"""What counts as having moved [m]."""


@dataclass(frozen=True, slots=True)
class _Effort:
    """Where a robot stood when it last got on with a frontier, and since when [m, s]."""

    cell: Cell
    x: float
    y: float
    since_s: float


class FrontierExploration(DecisionWrapper):
    """Turns the choice of a frontier into driving.

    The observation has, beside that of the environment below, ``frontiers`` float32 (16, 4): position along the axes of the
    map frame from where the robot believes to be [m], cost of the way [m] and size [m] of each frontier in reach, cheapest
    way first, zeros behind the last; and ``action_mask`` int8 (17,). Action k < 16 drives to frontier k, action 16 stays and
    gives way; an action that the mask rules out stays as well. A frontier to which a robot has driven and turned, and which
    is still there, is offered no more, and ``infos[agent]["given_up"]`` names it with the reason. A decision lasts
    ``decision_period_s`` or until any robot is done. Robots that have no frontier in reach stay idle; when none has, all end
    with ``no_frontier`` or ``frontier_unreachable``.

    Parameters
    ----------
    env : ExplorationEnv
        The environment to drive in.
    shares_map : bool
        Whether robots explore on the team's map, where it reaches them.
    """

    def __init__(self, env: ExplorationEnv, shares_map: bool = True) -> None:
        super().__init__(env, "lidarium_frontier_exploration_v0")
        self.waypoints = WaypointExploration(env, shares_map)
        self._shares_map = shares_map
        self._footprint = footprint_of(env.settings.robot.radius)
        high = np.tile(np.array([FARTHEST, FARTHEST, FARTHEST, FARTHEST], np.float32), (CANDIDATES, 1))
        low = np.tile(np.array([-FARTHEST, -FARTHEST, 0.0, 0.0], np.float32), (CANDIDATES, 1))
        self._observation_spaces = {
            agent: spaces.Dict(
                {
                    **_boxes(env.observation_space(agent)),
                    "frontiers": spaces.Box(low, high, dtype=np.float32),
                    "action_mask": spaces.Box(0, 1, (CANDIDATES + 1,), np.int8),
                }
            )
            for agent in self.possible_agents
        }
        self._action_spaces = {agent: spaces.Discrete(CANDIDATES + 1) for agent in self.possible_agents}
        self._targets: dict[str, list[tuple[Target, Cell]]] = {}
        self._chosen: dict[str, tuple[Target, Cell] | None] = {}
        self._efforts: dict[str, _Effort] = {}

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Return the space of an agent's observations."""
        return self._observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Return the space of an agent's actions."""
        return self._action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """Start an episode; see ``ExplorationEnv.reset``."""
        observations, infos = self.waypoints.reset(seed, options)
        self.agents = self.env.agents
        self._chosen = dict.fromkeys(self.possible_agents)
        self._efforts = {}
        return self._with_candidates(observations), infos

    def step(
        self, actions: dict[str, Any]
    ) -> tuple[dict[str, Observation], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Drive to the chosen frontiers for one decision."""
        orders: dict[str, Target | None] = {}
        for agent in self.env.agents:
            if agent not in actions:
                if agent in self.env.stopping:
                    continue
                raise ValueError(f"no action for {agent}; step() needs one for every agent in env.agents")
            number = int(actions[agent])
            if not 0 <= number <= CANDIDATES:
                raise ValueError(f"action of {agent} is {number}; want a frontier from 0 to {CANDIDATES - 1}, or {CANDIDATES} to stay")
            offered = self._targets[agent]
            self._chosen[agent] = offered[number] if number < len(offered) else None
            chosen = self._chosen[agent]
            orders[agent] = None if chosen is None else chosen[0]
        if self.env.agents and not any(self._targets[agent] for agent in self.env.agents):
            for agent in self.env.agents:
                if agent not in self.env.stopping:
                    self.env.stop(agent, self._reason(agent))
        observations, rewards, terminations, truncations, infos = self.waypoints.step(orders)
        self.agents = self.env.agents
        for agent in self.env.agents:
            chosen = self._chosen[agent]
            reason = None if chosen is None else self._why_in_vain(agent, chosen[1], infos[agent]["drive"])
            if chosen is not None and reason is not None:
                reach = default_reach(self._footprint, self.settings.occupancy.resolution)
                self._navigation(agent).frontiers.ignore_near(chosen[1], reach)
                infos[agent]["given_up"] = (chosen[0], reason)
        return self._with_candidates(observations), rewards, terminations, truncations, infos

    def _why_in_vain(self, agent: str, cell: Cell, state: DriveState) -> str | None:
        """Say why a chosen frontier is not worth more driving, or None."""
        if state is DriveState.ARRIVED:
            return "unseen"
        if state is DriveState.NO_PATH:
            return "blocked"
        x, y = (float(value) for value in self.env.perception.belief(agent).pose[:2])
        time = self.env.scorer.time
        old = self._efforts.get(agent)
        if old is None or old.cell != cell or math.dist((old.x, old.y), (x, y)) > MOVED or state is DriveState.GIVING_WAY:
            self._efforts[agent] = _Effort(cell, x, y, time)
        elif time - old.since_s > PATIENCE_S:
            return "no_progress"
        return None

    def _navigation(self, agent: str) -> NavigationMap:
        belief = self.env.perception.belief(agent)
        shared = belief.shared_map if self._shares_map else None
        return belief.map if shared is None else shared

    def _reason(self, agent: str) -> str:
        navigation = self._navigation(agent)
        return "frontier_unreachable" if (navigation.frontiers.flags != 0).any() else "no_frontier"

    def _with_candidates(self, observations: dict[str, Observation]) -> dict[str, Observation]:
        """Add the frontiers in reach to the observations, and remember them for the choice."""
        for agent, observation in observations.items():
            table, mask = np.zeros((CANDIDATES, 4), np.float32), np.zeros(CANDIDATES + 1, np.int8)
            mask[CANDIDATES] = 1
            self._targets[agent] = self._candidates(agent, table)
            mask[: len(self._targets[agent])] = 1
            observation["frontiers"], observation["action_mask"] = table, mask
        return observations

    def _candidates(self, agent: str, table: NDArray[np.float32]) -> list[tuple[Target, Cell]]:
        belief, navigation = self.env.perception.belief(agent), self._navigation(agent)
        clusters = navigation.frontiers.clusters(belief.map_origin)
        if not len(clusters):
            return []
        row, column = cells_of(belief.pose[:2], belief.map_origin, navigation.resolution)
        found = search(navigation.space, navigation.log_odds, navigation.clearance, (int(row), int(column)), self._footprint)
        near = approach(clusters, found, navigation.log_odds, default_reach(self._footprint, navigation.resolution))
        long_enough = near.reachable & (clusters.sizes >= MINIMUM_SIZE)
        wanted = long_enough if long_enough.any() else near.reachable
        ranked = [int(k) for k in np.argsort(near.costs, kind="stable") if wanted[k]][:CANDIDATES]
        targets: list[tuple[Target, Cell]] = []
        for place, k in enumerate(ranked):
            x, y = centres_of(near.cells[k], belief.map_origin, navigation.resolution)
            rise, run = near.frontier_cells[k] - near.cells[k]
            heading = math.atan2(rise, run) if rise or run else None
            seen = (int(near.frontier_cells[k][0]), int(near.frontier_cells[k][1]))
            targets.append((Target(float(x), float(y), heading), seen))
            table[place] = (x - belief.pose[0], y - belief.pose[1], near.costs[k], clusters.sizes[k])
        np.clip(table, -FARTHEST, FARTHEST, out=table)
        return targets


def _boxes(space: spaces.Space[Any]) -> dict[str, spaces.Space[Any]]:
    assert isinstance(space, spaces.Dict)
    return dict(space.spaces)
