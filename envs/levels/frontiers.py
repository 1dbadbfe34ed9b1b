"""Decisions by frontiers: a robot chooses one that it can come near.

The frontiers are offered with the cheapest path first.
"""

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lidarium.envs.agent_actions import check_agents, missing_action, whole_number
from lidarium.envs.exploration import ExplorationEnv, Observation
from lidarium.envs.levels.decisions import DecisionWrapper, boxes_of
from lidarium.envs.levels.frontier_choices import FARTHEST, MOST_GAIN
from lidarium.envs.levels.frontier_offers import REASONS, FrontierOffers
from lidarium.envs.levels.waypoints import WaypointExploration
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.limits import GAINS
from lidarium.mapping.geometry.bounds import shown


class FrontierExploration(DecisionWrapper):
    """Turns the choice of a frontier into driving.

    The observation has, beside that of the environment below, ``frontiers`` float32 (F, 4): position along
    the axes of the map frame from where the robot believes to be [m], cost of the way [m] and size [m] of
    each frontier on offer, cheapest way first, zeros behind the last; and ``action_mask`` int8 (F + 1,). F is
    ``settings.frontiers``. Action k < F drives to frontier k, action F stays and gives way; an action that
    the mask rules out stays as well.

    A frontier to which a robot has driven and turned, and which is still there, is offered no more, and
    ``infos[agent]["given_up"]`` names it with the reason. A decision lasts ``decision_period_s`` or until any
    robot is done. Robots that have no frontier in reach stay idle; when none has, all end with
    ``no_frontier`` or ``frontier_unreachable``.

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
        self._offers = FrontierOffers(env.perception, env.settings, self.waypoints.driver)
        self._observation_spaces = {
            agent: spaces.Dict({**boxes_of(env.observation_space(agent)), **frontier_boxes(env.settings)})
            for agent in self.possible_agents
        }
        self._action_spaces = {
            agent: spaces.Discrete(env.settings.frontiers + 1) for agent in self.possible_agents
        }

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
        self._offers.start()
        self._offers.renew(self._rows(self.agents), self._rows(self.agents))
        return self._with_offers(observations), infos

    def step(
        self, actions: dict[str, Any]
    ) -> tuple[
        dict[str, Observation], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]
    ]:
        """Drive to the chosen frontiers for one decision."""
        env, offers, most = self.env, self._offers, self.settings.frontiers
        check_agents(actions, self.possible_agents)
        numbers, choosing = np.full(env.settings.robots, most), []
        for agent in env.agents:
            if agent not in actions:
                if agent in env.stopping or env.operating.is_addressed(self.possible_agents.index(agent)):
                    continue
                raise missing_action(agent)
            number = whole_number(actions[agent], most)
            if number is None:
                raise ValueError(
                    f"action of {agent} is {shown(actions[agent])}; want a frontier from 0 to "
                    f"{most - 1}, or {most} to stay"
                )
            numbers[self.possible_agents.index(agent)] = number
            choosing.append(agent)
        is_chosen = self._rows(choosing) | self._rows(list(env.stopping))
        is_sent = np.isin(np.arange(env.settings.robots), list(env.operating.sent))
        # Who is sent elsewhere by an order has no choice among frontiers any more, who is paused keeps its
        # own.
        numbers[is_sent] = most
        orders = offers.choose(self._rows(choosing) & ~env.operating.held | is_sent, numbers)
        is_left_alone = bool(is_chosen[self._rows(env.agents)].all()) and not is_sent.any()
        if is_left_alone and not offers.offers.counts[self._rows(env.agents)].any():
            for agent in env.agents:
                if agent not in env.stopping:
                    env.stop(agent, offers.why_without_work(self.possible_agents.index(agent)))
        observations, rewards, terminations, truncations, infos = self.waypoints.carry_out(orders, is_chosen)
        self.agents = env.agents
        reasons = offers.renew(self._rows(self.agents) & ~env.operating.held, self._rows(list(observations)))
        for row in np.flatnonzero(reasons).tolist():
            infos[self.possible_agents[row]]["given_up"] = (offers.target(row), REASONS[reasons[row]])
        return self._with_offers(observations), rewards, terminations, truncations, infos

    def action_masks(self, agent: str) -> NDArray[np.bool_]:
        """Return which actions an agent may choose now, (frontiers + 1,)."""
        return np.asarray(self._offers.offers.masks[self.possible_agents.index(agent)] != 0)

    def _rows(self, agents: list[str]) -> NDArray[np.bool_]:
        """Return which rows are those of agents, (robots,)."""
        return np.array([agent in agents for agent in self.possible_agents])

    def _with_offers(self, observations: dict[str, Observation]) -> dict[str, Observation]:
        """Add the frontiers in reach to the observations."""
        for agent, observation in observations.items():
            row = self.possible_agents.index(agent)
            observation.update({name: array[row].copy() for name, array in self._offers.observed.items()})
        return observations


def frontier_boxes(settings: ExplorationSettings) -> dict[str, spaces.Space[Any]]:
    """Return the spaces of what the choice among frontiers adds to an observation."""
    most = settings.frontiers
    high = np.full((most, 4), FARTHEST, np.float32)
    low = np.tile(np.array([-FARTHEST, -FARTHEST, 0.0, 0.0], np.float32), (most, 1))
    gains = spaces.Box(0.0, MOST_GAIN, (most,), np.float32)
    return {
        **({GAINS: gains} if GAINS in settings.observe else {}),
        "frontiers": spaces.Box(low, high, dtype=np.float32),
        "action_mask": spaces.Box(0, 1, (most + 1,), np.int8),
    }
