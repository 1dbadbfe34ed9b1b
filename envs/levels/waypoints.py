"""Decisions by waypoints: the onboard driver takes a robot to its waypoint.

A decision holds for a period or until a robot is done.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lidarium.envs.agent_actions import check_agents, missing_action, numbers_of
from lidarium.envs.driving.team_driver import TeamDriver
from lidarium.envs.exploration import ExplorationEnv, Observation
from lidarium.envs.levels.decisions import DecisionWrapper
from lidarium.envs.radio.messages import DriveState, Orders, Route, Target
from lidarium.mapping.geometry.bounds import shown

Waypoint = Target | Route | NDArray[np.float32] | None


class WaypointExploration(DecisionWrapper):
    """Turns targets into driving.

    An action is a point within the observed map: two numbers within [-1, 1], the position along the axes of
    the robot's map frame from where it believes to be, as a share of half the map's side. A ``Target`` gives
    a position in the map frame directly, and None lets the robot stay and give way. The onboard driving plans
    a path over what the robot knows, so a point that is not known to be free is approached as near as
    planning can come: where there is no path, the robot stays. A ``Route`` is a path that the policy has
    planned itself: the robot follows it as it is, with the safety stop and right of way of all driving.

    A decision lasts ``decision_period_s``; it ends earlier when any robot with a target has arrived or found
    no path, pauses by itself or gets an order late, or the episode ends. A robot that was given an order may
    be left out of the actions, and then keeps its target.

    Parameters
    ----------
    env : ExplorationEnv
        The environment to drive in.
    shares_map : bool
        Whether robots plan on the team's map, where it reaches them.
    decision_period_s : float or None
        How long a decision lasts [s]; None for that of the settings.

    Attributes
    ----------
    driver : TeamDriver
        Who drives the robots.
    router : callable or None
        Called in each decision, when all robots have their targets: it may let the driver follow routes to
        them. None where paths are planned on grids.
    """

    def __init__(
        self, env: ExplorationEnv, shares_map: bool = True, decision_period_s: float | None = None
    ) -> None:
        super().__init__(env, "lidarium_waypoint_exploration_v0")
        period_s = env.settings.decision_period_s if decision_period_s is None else decision_period_s
        self._decision_steps = max(round(period_s / env.settings.time_step), 1)
        self._half_side = 0.5 * env.settings.map_cells * env.settings.occupancy.resolution
        self._action_spaces = {
            agent: spaces.Box(-1.0, 1.0, (2,), np.float32) for agent in self.possible_agents
        }
        self._shares_map = shares_map
        self.driver = TeamDriver(env.perception, env.settings, shares_map)
        self.router: Callable[[], None] | None = None
        env.operating.attach(self.driver)

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Return the space of an agent's observations."""
        return self.env.observation_space(agent)

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Return the space of an agent's actions."""
        return self._action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """Start an episode; see ``ExplorationEnv.reset``."""
        outcome = self.env.reset(seed, options)
        self.driver.start()
        self.agents = self.env.agents
        return outcome

    def step(
        self, actions: Mapping[str, Waypoint]
    ) -> tuple[
        dict[str, Observation], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]
    ]:
        """Drive to the targets for one decision.

        Rewards are summed over its steps, ``infos[agent]["drive"]`` is a ``DriveState``.
        """
        env = self.env
        check_agents(actions, env.possible_agents)
        targets: list[Target | None] = [None] * env.settings.robots
        routes: dict[int, Route] = {}
        is_chosen = np.zeros(env.settings.robots, np.bool_)
        for agent in env.agents:
            row = env.possible_agents.index(agent)
            is_chosen[row] = agent in actions or agent in env.stopping
            if agent in actions:
                waypoint = actions[agent]
                if isinstance(waypoint, Route):
                    routes[row], targets[row] = waypoint, waypoint.target
                else:
                    targets[row] = self._target(agent, waypoint)
            elif agent not in env.stopping and not env.operating.is_addressed(row):
                raise missing_action(agent)
        return self.carry_out(Orders.of(targets), is_chosen, routes)

    def carry_out(
        self, orders: Orders, is_chosen: NDArray[np.bool_], routes: Mapping[int, Route] | None = None
    ) -> tuple[
        dict[str, Observation], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]
    ]:
        """Drive for one decision by the orders of the chosen robots.

        ``is_chosen`` (robots,) names them; the others keep their orders. Those with ``routes`` follow them.
        Returns as ``step``.
        """
        env, driver = self.env, self.driver
        if not env.agents:
            return env.step({})
        rows = {agent: env.possible_agents.index(agent) for agent in env.agents}
        is_live = np.isin(np.arange(env.settings.robots), list(rows.values()))
        self._assign(orders, is_chosen & is_live, routes or {})
        if self.router is not None:
            self.router()
        driver.prepare()
        if not env.stopping:
            waiting = {row for row in rows.values() if driver.is_done(row)}
            for _ in range(self._decision_steps):
                env.drive_at(driver.commands())
                if env.ends_now() or any(driver.is_done(row) and row not in waiting for row in rows.values()):
                    break
        else:
            env.drive_at(np.zeros((env.settings.robots, 2)))
        outcome = env.outcome()
        self.agents = env.agents
        for agent, info in outcome[4].items():
            info["drive"] = driver.state(rows[agent])
        return outcome

    def _assign(self, orders: Orders, is_chosen: NDArray[np.bool_], routes: Mapping[int, Route]) -> None:
        """Give robots their targets, and routes to them.

        Who is paused keeps what it had, and where an order sends a robot goes before its policy's choice.
        """
        operating, driver = self.env.operating, self.driver
        is_assigned = is_chosen & ~operating.held
        driver.assign(is_assigned, orders)
        for row, route in routes.items():
            if is_assigned[row]:
                driver.follow(row, route)
        for row, target in operating.take_sent().items():
            one = np.arange(self.env.settings.robots) == row
            driver.assign(one, Orders.of([target] * self.env.settings.robots))

    def _target(self, agent: str, waypoint: Target | NDArray[np.float32] | None) -> Target | None:
        if waypoint is None or isinstance(waypoint, Target):
            return waypoint
        share = numbers_of(waypoint)
        if share.shape != (2,) or not np.isfinite(share).all():
            raise ValueError(
                f"waypoint of {agent} is {shown(waypoint)}; want two finite numbers within [-1, 1], a Target "
                "or None"
            )
        row = self.env.possible_agents.index(agent)
        x, y = (
            self.env.perception.poses.pose_in_frame(row, row)[:2]
            + np.clip(share, -1.0, 1.0) * self._half_side
        )
        return Target(float(x), float(y))

    def drive_state(self, agent: str) -> DriveState:
        """Return what an agent's driving is about."""
        return self.driver.state(self.env.possible_agents.index(agent))
