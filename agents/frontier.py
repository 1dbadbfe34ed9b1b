"""Frontier explorers: nearest frontier, greatest team utility, least cost.

They share everything but the choice. A robot keeps its target while the frontier there stands; having come
near and turned to it, what still is frontier there cannot be seen and is given up by name. A robot without a
frontier in reach stays idle and gives way; all stop together when none has work, each with its reason.
"""

import math
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.frontier_reach import Choice, Reach, reach_of
from lidarium.agents.policy import Action, Policy, Stop, Team
from lidarium.agents.report import GivenUp
from lidarium.envs.driving.team_driver import footprint_of
from lidarium.envs.exploration import Observation
from lidarium.envs.onboard.navigation import NavigationMap
from lidarium.envs.radio.messages import DriveState, Target
from lidarium.mapping.grids.grid_lines import visible
from lidarium.mapping.planning.frontier_approach import approach, default_reach, nearest_frontier
from lidarium.mapping.planning.frontiers import FRONTIER, IGNORED, Clusters
from lidarium.mapping.planning.grid_planning import Cell, Footprint, cells_of, centres_of, search

PATIENCE_S = 20.0
"""Time without motion after which a robot gives up its frontier [s].

It counts while the robot's target stands.
"""

MOST_UTILITY_LOST = 2.0
"""Largest excess of utility that a path to a frontier may cost.

The excess is over the cheapest frontier; one that costs more is not considered.
"""

FIRST_SLACK = 4.0
"""How far beyond the cheapest frontier others are looked for at first [m].

Further where that does not settle the choice.
"""

MOVED = 0.15
"""What counts as having moved [m]."""


@dataclass(slots=True)
class _Work:
    """What a robot is at."""

    choice: Choice | None = None
    since_s: float = 0.0
    place: tuple[float, float] = (math.inf, math.inf)
    failed_at: Cell | None = None


class FrontierExplorer(Policy):
    """What the frontier explorers share; a subclass chooses.

    Parameters
    ----------
    shares_map : bool
        Whether robots explore on the team's map, where it reaches them, or each on its own.
    """

    level = "waypoint"

    def __init__(self, shares_map: bool = True) -> None:
        self.shares_map = shares_map
        self._given_up: list[tuple[GivenUp, NavigationMap, Cell]] = []
        self._unreached: list[GivenUp] = []

    def reset(self, team: Team, seed: int) -> None:
        """Begin an episode."""
        self.team = team
        self._given_up, self._unreached = [], []
        self._work = {agent: _Work() for agent in team.agents}
        radius = team.belief(team.agents[0]).radius
        self.footprint: Footprint = footprint_of(radius)

    def act(self, observations: Mapping[str, Observation]) -> dict[str, Action]:
        """Send every robot to its frontier, or to rest where it has none."""
        agents = list(observations)
        for agent in agents:
            self._review(agent)
        open_agents = [agent for agent in agents if self._work[agent].choice is None]
        if open_agents or self.replans():
            chosen = self.choose(agents, open_agents)
            for agent, choice in chosen.items():
                if choice != self._work[agent].choice:
                    self._begin(agent, choice)
        if all(self._work[agent].choice is None for agent in agents):
            return {agent: Stop(self._reason(agent)) for agent in agents}
        return {agent: self._target(agent) for agent in agents}

    @property
    def given_up(self) -> list[GivenUp]:
        """What is left unexplored by now, and why.

        What was given up and seen later from elsewhere is not.
        """
        still = [
            entry for entry, navigation, cell in self._given_up if navigation.frontiers.flags[cell] == IGNORED
        ]
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
        """Return the cell in which an agent believes to stand."""
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
        """Drop a choice whose frontier is gone, and give up unusable ones.

        Unusable is what cannot be seen or reached.
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
            # The map may have changed since the choice: choose anew, and give up what is chosen again without
            # a way.
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
        """Ignore the frontier cells near the one looked at, and say so."""
        navigation, belief = self.navigation(agent), self.team.belief(agent)
        count = navigation.frontiers.ignore_near(
            choice.frontier_cell, default_reach(self.footprint, navigation.resolution)
        )
        x, y = centres_of(np.asarray(choice.frontier_cell), belief.map_origin, navigation.resolution)
        entry = GivenUp(agent, float(x), float(y), count * navigation.resolution, reason)
        self._given_up.append((entry, navigation, choice.frontier_cell))

    def _target(self, agent: str) -> Target | None:
        choice = self._work[agent].choice
        if choice is None:
            return None
        belief, resolution = self.team.belief(agent), self.navigation(agent).resolution
        x, y = centres_of(np.asarray(choice.cell), belief.map_origin, resolution)
        return Target(float(x), float(y), self._heading(agent, choice))

    def _heading(self, agent: str, choice: Choice) -> float:
        """Return the heading from a robot's future place to the unknown space.

        The place is where it will stand; the unknown space is that beside the frontier cell.
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

    def _reason(self, agent: str) -> str:
        """Say why an agent has no work, and name what is left."""
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
        left = approach(
            clusters, found, navigation.log_odds, default_reach(self.footprint, navigation.resolution)
        )
        shares = self._unreached and navigation is self.navigation(self._unreached[0].agent)
        if not shares:
            for k, reason in enumerate(left.reasons):
                x, y = (float(value) for value in clusters.centroids[k])
                self._unreached.append(GivenUp(agent, x, y, float(clusters.sizes[k]), reason or "blocked"))
        return "frontier_unreachable"


class NearestFrontier(FrontierExplorer):
    """Explorers that each drive to their cheapest frontier (Yamauchi 1997).

    With a shared map this is Yamauchi 1998.

    Parameters
    ----------
    minimum_size : float
        Frontiers shorter than this are taken only when no longer one is in reach [m].
    shares_map : bool
        Whether robots explore on the team's map.
    """

    def __init__(self, minimum_size: float = 0.5, shares_map: bool = True) -> None:
        super().__init__(shares_map)
        self._minimum_size = minimum_size

    def choose(self, agents: list[str], open_agents: list[str]) -> dict[str, Choice | None]:
        """Choose the nearest frontier for each open agent."""
        return {agent: self._nearest(agent) for agent in open_agents}

    def _nearest(self, agent: str) -> Choice | None:
        navigation, start = self.navigation(agent), self.start_cell(agent)
        for frontiers in (navigation.long_frontiers(self._minimum_size), navigation.frontiers):
            if not len(frontiers):
                continue
            found = nearest_frontier(
                frontiers, navigation.space, navigation.log_odds, navigation.clearance, start, self.footprint
            )
            if found is not None:
                return Choice(found.cell, found.frontier_cell)
        return None


class ExploreLite(FrontierExplorer):
    """Explorers that drive to the frontier of least cost, as in explore_lite.

    The cost is distance less size, as explore_lite weighs them, both in metres.

    Parameters
    ----------
    potential_scale, gain_scale : float
        Weights of the distance to the frontier and of its size [1/m].
    minimum_size : float
        Frontiers shorter than this are taken only when no longer one is in reach [m].
    period_s : float
        Time between reconsiderations [s].
    shares_map : bool
        Whether robots explore on the team's map.
    """

    def __init__(
        self,
        potential_scale: float = 3.0,
        gain_scale: float = 1.0,
        minimum_size: float = 0.75,
        period_s: float = 3.0,
        shares_map: bool = True,
    ) -> None:
        super().__init__(shares_map)
        self._potential_scale, self._gain_scale = potential_scale, gain_scale
        self._minimum_size, self._period_s = minimum_size, period_s
        self._last_s = -math.inf

    def reset(self, team: Team, seed: int) -> None:
        """Begin an episode."""
        super().reset(team, seed)
        self._last_s = -math.inf

    def replans(self) -> bool:
        """Whether the period is over."""
        return self.team.time_s - self._last_s >= self._period_s

    def choose(self, agents: list[str], open_agents: list[str]) -> dict[str, Choice | None]:
        """Choose the frontier of least cost."""
        if self.replans():
            self._last_s = self.team.time_s
            open_agents = agents
        return {agent: self._cheapest(agent) for agent in open_agents}

    def _cheapest(self, agent: str) -> Choice | None:
        navigation = self.navigation(agent)
        clusters = navigation.frontiers.clusters(self.team.belief(agent).map_origin)
        if not len(clusters):
            return None
        # Beyond this no frontier can make up for the way by its size.
        slack = self._gain_scale * float(clusters.sizes.max()) / self._potential_scale + 0.1
        reach = reach_of(
            clusters, navigation, self.start_cell(agent), self.footprint, self._minimum_size, slack
        )
        costs = self._potential_scale * reach.costs - self._gain_scale * clusters.sizes
        long_enough = np.where(clusters.sizes >= self._minimum_size, costs, math.inf)
        ranked = long_enough if np.isfinite(long_enough).any() else costs
        best = int(np.argmin(ranked))
        return reach.choices[best] if math.isfinite(ranked[best]) else None


def nearest_frontier_own_map() -> NearestFrontier:
    """Return explorers that each drive to the nearest frontier of their own map."""
    return NearestFrontier(shares_map=False)


class UtilityFrontier(FrontierExplorer):
    """Explorers that share out the team's frontiers by utility less cost.

    The method is that of Burgard, Moors, Stachniss and Schneider (2005).

    Every frontier has utility 1; when a robot takes one, the utility of the others falls with the chance that
    they are seen from there: 1 less their distance over the laser's range, where there is a line of sight.

    Parameters
    ----------
    cost_weight : float
        Utility that a metre of way costs [1/m].
    sensor_range : float
        Range within which a target sees other frontiers [m].
    minimum_size : float
        Frontiers shorter than this are taken only when no longer one is left for a robot [m].
    shares_map : bool
        Whether robots explore on the team's map.
    """

    def __init__(
        self,
        cost_weight: float = 0.05,
        sensor_range: float = 5.6,
        minimum_size: float = 0.5,
        shares_map: bool = True,
    ) -> None:
        super().__init__(shares_map)
        self._cost_weight, self._range, self._minimum_size = cost_weight, sensor_range, minimum_size

    def choose(self, agents: list[str], open_agents: list[str]) -> dict[str, Choice | None]:
        """Assign frontiers to all robots anew, best pair first."""
        if not self._are_together(agents):
            return {agent: self._assign([agent])[agent] for agent in open_agents}
        return self._assign(agents)

    def _are_together(self, agents: list[str]) -> bool:
        first = self.navigation(agents[0])
        return all(self.navigation(agent) is first for agent in agents)

    def _assign(self, agents: list[str]) -> dict[str, Choice | None]:
        navigation = self.navigation(agents[0])
        origin = self.team.belief(agents[0]).map_origin
        clusters = navigation.frontiers.clusters(origin)
        chosen: dict[str, Choice | None] = dict.fromkeys(agents)
        if not len(clusters):
            return chosen
        most = MOST_UTILITY_LOST / self._cost_weight
        slacks = dict.fromkeys(agents, min(FIRST_SLACK, most))
        reaches: dict[str, Reach] = {}
        unsure = list(agents)
        while unsure:
            for agent in unsure:
                start = self.start_cell(agent)
                reach = reach_of(
                    clusters, navigation, start, self.footprint, self._minimum_size, slacks[agent]
                )
                reaches[agent] = replace(reach, beyond=math.inf) if slacks[agent] >= most else reach
                slacks[agent] = min(2.0 * slacks[agent], most)
            chosen, unsure = self._share_out(agents, reaches, clusters, navigation)
        return chosen

    def _share_out(
        self, agents: list[str], reaches: Mapping[str, Reach], clusters: Clusters, navigation: NavigationMap
    ) -> tuple[dict[str, Choice | None], list[str]]:
        """Share out the frontiers, and name the agents that are unsure.

        These are agents that might do better with a frontier beyond their reach.
        """
        utility = np.where(clusters.sizes >= self._minimum_size, 1.0, 0.25)
        chosen: dict[str, Choice | None] = dict.fromkeys(agents)
        waiting = list(agents)
        while waiting:
            values = {agent: utility - self._cost_weight * reaches[agent].costs for agent in waiting}
            agent = max(waiting, key=lambda name: (float(values[name].max()), -waiting.index(name)))
            best = int(np.argmax(values[agent]))
            value = float(values[agent][best])
            unsure = [name for name in waiting if reaches[name].may_hold(utility, self._cost_weight, value)]
            if unsure:
                return chosen, unsure
            waiting.remove(agent)
            if not math.isfinite(value):
                continue
            choice = reaches[agent].choices[best]
            chosen[agent] = choice
            if choice is not None:
                utility = utility - self._seen_share(clusters, clusters.representatives[best], navigation)
                utility[best] = min(utility[best], -1.0)
        return chosen, []

    def _seen_share(
        self, clusters: Clusters, target: NDArray[np.int64], navigation: NavigationMap
    ) -> NDArray[np.float64]:
        """Return by how much each cluster's utility falls when a robot goes to a target."""
        cells = clusters.representatives
        place = (int(target[0]), int(target[1]))
        seen = visible(navigation.log_odds, place, cells, self._range / navigation.resolution)
        distances = np.hypot(*(cells - target).T) * navigation.resolution
        return np.where(seen, np.clip(1.0 - distances / self._range, 0.0, 1.0), 0.0)
