"""Frontier explorers: nearest frontier, greatest team utility, least cost.

They share everything but the choice. A robot keeps its target while the frontier there exists; having come
near and turned to it, cells that are still frontier cannot be seen and are given up by name. A robot without a
frontier in reach stays idle and gives way; all stop together when none has work, each with its reason.
"""

import math
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from lidarium.agents.frontier.reach import Choice
from lidarium.agents.policy import Action, Policy, Stop, Team
from lidarium.agents.report import GivenUp
from lidarium.envs.faces.parallel import Observation
from lidarium.envs.onboard.driving.path_planner import footprint_of
from lidarium.envs.onboard.navigation import NavigationMap
from lidarium.envs.onboard.radio.messages import DriveState, Target
from lidarium.mapping.planning.footprint import Footprint
from lidarium.mapping.planning.frontiers.approach import approach, default_reach
from lidarium.mapping.planning.frontiers.frontier_map import FRONTIER, IGNORED
from lidarium.mapping.planning.grid_planning import Cell, cells_of, centres_of, search

PATIENCE_S = 20.0
"""Time without motion after which a robot gives up its frontier [s].

It counts while the robot's target stands.
"""


MOVED = 0.15
"""Minimum motion that counts [m]."""


@dataclass(slots=True)
class _Work:
    """State of a robot."""

    choice: Choice | None = None
    since_s: float = 0.0
    place: tuple[float, float] = (math.inf, math.inf)
    failed_at: Cell | None = None


class FrontierExplorer(Policy):
    """Base class of the frontier explorers; a subclass chooses the frontier."""

    level = "waypoint"

    def __init__(self, shares_map: bool = True) -> None:
        self.shares_map = shares_map
        self._given_up: list[tuple[GivenUp, NavigationMap, Cell]] = []
        self._unreached: list[GivenUp] = []

    def reset(self, team: Team, seed: int = 0) -> None:
        """Begin an episode."""
        self.team = team
        self._given_up, self._unreached = [], []
        self._work = {agent: _Work() for agent in team.agents}
        radius = team.belief(team.agents[0]).radius
        self.footprint: Footprint = footprint_of(radius)

    def act(self, observations: Mapping[str, Observation]) -> dict[str, Action]:
        """Send every robot to its frontier, or to rest if it has none."""
        agents = list(observations)
        open_agents = self.review(agents)
        if open_agents or self.replans():
            self.take(self.choose(agents, open_agents))
        if all(self._work[agent].choice is None for agent in agents):
            return {agent: Stop(self.reason(agent)) for agent in agents}
        return {agent: self.target(agent) for agent in agents}

    def review(self, agents: list[str]) -> list[str]:
        """Drop the choices that stand no more; return the agents that have none."""
        for agent in agents:
            self._review(agent)
        return [agent for agent in agents if self._work[agent].choice is None]

    def take(self, chosen: Mapping[str, Choice | None]) -> None:
        """Start the new choice of each agent; an agent that keeps its choice goes on undisturbed."""
        for agent, choice in chosen.items():
            if choice != self._work[agent].choice:
                self._begin(agent, choice)

    @property
    def given_up(self) -> list[GivenUp]:
        """The areas left unexplored so far, with reasons.

        Areas that were given up but seen later from elsewhere are not included.
        """
        still = [entry for entry, navigation, cell in self._given_up if navigation.frontiers.flags[cell] == IGNORED]
        return still + self._unreached

    @abstractmethod
    def choose(self, agents: list[str], open_agents: list[str]) -> dict[str, Choice | None]:
        """Choose for the agents that need a target, or for all; the others keep theirs."""

    def replans(self) -> bool:
        """Whether all choices are reconsidered now, although every robot has one."""
        return False

    def navigation(self, agent: str) -> NavigationMap:
        """Return the map that an agent explores on."""
        belief = self.team.belief(agent)
        shared = belief.shared_map if self.shares_map else None
        return shared if shared is not None else belief.map

    def start_cell(self, agent: str) -> Cell:
        """Return the cell at which an agent believes itself to be."""
        belief = self.team.belief(agent)
        row, column = cells_of(belief.pose[:2], belief.map_origin, self.navigation(agent).resolution)
        return int(row), int(column)

    def current(self, agent: str) -> Choice | None:
        """Return an agent's choice."""
        return self._work[agent].choice

    def _begin(self, agent: str, choice: Choice | None) -> None:
        pose = self.team.belief(agent).pose
        failed_at = self._work[agent].failed_at
        self._work[agent] = _Work(choice, self.team.time_s, (float(pose[0]), float(pose[1])), failed_at)

    def _review(self, agent: str) -> None:
        """Drop choices of frontiers that are gone, and give up unusable ones.

        Frontiers that cannot be seen or reached are unusable.
        """
        work = self._work[agent]
        if work.choice is None:
            return
        navigation = self.navigation(agent)
        if not self.still_stands(navigation, work.choice):
            work.choice = None
            return
        state = self.team.drive_state(agent)
        if state is DriveState.ARRIVED:
            self._give_up_around(agent, work.choice, "unseen")
            work.choice = None
            return
        if state is DriveState.NO_PATH:
            # The map may have changed since the choice: choose again, and give up what is chosen again
            # without a way.
            if work.failed_at == work.choice.frontier_cell:
                self._give_up_around(agent, work.choice, "blocked")
            self._work[agent] = _Work(failed_at=work.choice.frontier_cell)
            return
        pose = self.team.belief(agent).pose
        if state is DriveState.GIVING_WAY or math.dist(pose[:2], work.place) > MOVED:
            work.since_s, work.place = self.team.time_s, (float(pose[0]), float(pose[1]))
        elif self.team.time_s - work.since_s > PATIENCE_S:
            self._give_up_around(agent, work.choice, "no_progress")
            work.choice = None

    def still_stands(self, navigation: NavigationMap, choice: Choice) -> bool:
        """Whether the frontier of a choice is still one."""
        return bool(navigation.frontiers.flags[choice.frontier_cell] == FRONTIER)

    def _give_up_around(self, agent: str, choice: Choice, reason: str) -> None:
        """Ignore the frontier cells near the one observed, and report it."""
        navigation, belief = self.navigation(agent), self.team.belief(agent)
        count = navigation.frontiers.ignore_near(
            choice.frontier_cell, default_reach(self.footprint, navigation.resolution)
        )
        x, y = centres_of(np.asarray(choice.frontier_cell), belief.map_origin, navigation.resolution)
        entry = GivenUp(agent, float(x), float(y), count * navigation.resolution, reason)
        self._given_up.append((entry, navigation, choice.frontier_cell))

    def target(self, agent: str) -> Target | None:
        """Return where an agent drives to, None if it has no choice."""
        choice = self._work[agent].choice
        if choice is None:
            return None
        belief, resolution = self.team.belief(agent), self.navigation(agent).resolution
        x, y = centres_of(np.asarray(choice.cell), belief.map_origin, resolution)
        return Target(float(x), float(y), self._heading(agent, choice))

    def _heading(self, agent: str, choice: Choice) -> float:
        """Return the heading from a robot's future place to the unknown space.

        The position is the goal of the drive; the unknown space is next to the frontier cell.
        """
        row, column = choice.frontier_cell
        log_odds = self.navigation(agent).log_odds
        beside = [
            (row + i, column + j)
            for i, j in ((0, 1), (1, 0), (0, -1), (-1, 0))
            if 0 <= row + i < log_odds.shape[0]
            and 0 <= column + j < log_odds.shape[1]
            and log_odds[row + i, column + j] == 0
        ]
        towards = np.mean(beside, axis=0) if beside else np.asarray(choice.frontier_cell)
        return math.atan2(towards[0] - choice.cell[0], towards[1] - choice.cell[1])

    def reason(self, agent: str) -> str:
        """Report why an agent has no work, and the frontiers that are left."""
        navigation, belief = self.navigation(agent), self.team.belief(agent)
        clusters = navigation.frontiers.clusters(belief.map_origin)
        if not len(clusters):
            return "no_frontier"
        found = search(
            navigation.space,
            navigation.log_odds,
            navigation.clearance,
            self.start_cell(agent),
            self.footprint,
        )
        left = approach(clusters, found, navigation.log_odds, default_reach(self.footprint, navigation.resolution))
        shares = self._unreached and navigation is self.navigation(self._unreached[0].agent)
        if not shares:
            for k, reason in enumerate(left.reasons):
                x, y = (float(value) for value in clusters.centroids[k])
                self._unreached.append(GivenUp(agent, x, y, float(clusters.sizes[k]), reason or "blocked"))
        return "frontier_unreachable"
