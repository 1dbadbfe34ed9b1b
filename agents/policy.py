"""The interface of policies: they decide by observations and beliefs."""

import math
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from functools import wraps
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.report import GivenUp, PolicyReport, TeamMaps
from lidarium.envs.faces.conventions import MASK, PLAIN, Conventions
from lidarium.envs.faces.parallel import ExplorationEnv, Observation
from lidarium.envs.faces.team import EpisodeTeam
from lidarium.envs.levels import LEVELS
from lidarium.envs.onboard.belief import Belief
from lidarium.envs.onboard.radio.messages import DriveState, OperatingState, Order, Route, Stop, Target
from lidarium.envs.onboard.station.reports import Report
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.mapping.merging.fusion import FusedMap

_DONE = (DriveState.ARRIVED, DriveState.NO_PATH, DriveState.BLOCKED)

_OWN = {"frontier": ("frontiers", MASK), "tour": ("tours", MASK)}
"""Observations that levels show whatever ``settings.observe`` has."""

_HINTS = {"depth": ", with a depth camera: camera='xtion_tilted'", "teammates": ", with two robots or more"}
"""What observations need besides, for messages."""

Action = NDArray[np.float32] | Target | Route | int | Stop | Order | None


class Team(Protocol):
    """Queries of a policy about its team, never about ground truth.

    `ExplorationEnv` satisfies it itself; `EpisodeTeam` is the team of one episode of a vector environment.
    """

    @property
    def agents(self) -> list[str]:
        """Live agents."""
        ...

    @property
    def level(self) -> str:
        """Its action level."""
        ...

    @property
    def settings(self) -> ExplorationSettings:
        """The settings of the team."""
        ...

    @property
    def time_s(self) -> float:
        """Simulated time [s]."""
        ...

    def belief(self, agent: str) -> Belief:
        """Return the state of an agent's onboard software."""
        ...

    def drive_state(self, agent: str) -> DriveState:
        """Return the state of its driving."""
        ...

    def operating_state(self, agent: str) -> OperatingState:
        """Return whether it takes part in the work, as it knows itself."""
        ...

    def last_order(self, agent: str) -> Order | None:
        """Return the last order that an agent took, None if it took none."""
        ...

    def report(self, agent: str) -> Report | None:
        """Return the last report of an agent that reached the station, also of an ended agent.

        None if nothing ever did.
        """
        ...

    def send_map(self, agent: str, others: FusedMap | None) -> bool:
        """Send an agent that does not know its start the map of the others, in its map frame.

        Return whether that reached it.

        It plans and explores on that from now on, if its policy uses the shared map. None takes back
        the map that was sent.
        """
        ...

    def forget_walls(self, agent: str, trail: NDArray[np.float64]) -> bool:
        """Send an agent the trail of another robot, (N, 2) in its map frame [m].

        Return whether that reached it.

        The walls that it has drawn there may be that robot: it forgets them, and sees for itself. What is at
        the trail's end stays.
        """
        ...


class Policy(ABC):
    """Drives a team, or some of its robots: one object for all of them; a policy is a subclass.

    A subclass has `reset` and `act`. Its ``reset(team, seed=0)`` also takes an environment or a wrapper around one, and
    refuses levels that do not carry out its actions; its ``act(observations, agents=None)`` also takes the names of the
    agents that it is to decide for. A policy of waypoints drives robots in environments of all three levels.

    Attributes
    ----------
    level : str
        The level of its decisions: ``velocity`` (shares of the limits, for a step), ``waypoint`` (a ``Target``, a
        ``Route``, None to stay, or two shares, for a decision period) or ``frontier`` (the number of a
        frontier on offer, for a decision period).
    shares_map : bool
        Whether the robots plan on the team's map, if it reaches them, or on their own.
    observes : tuple of str
        The observations that it reads, of ``settings.observe`` or of its level, as ``action_mask``; a run checks it
        before the first step.
    name : str
        Its name in messages; that of its class by default.
    decision_period_s : float or None
        How often it decides at the level of waypoints [s]; None for as often as the settings say.
    predicts : bool
        Whether it predicts maps by the network of the package; frames, the live view and replays then show that.
    """

    level: str
    shares_map: bool = True
    predicts: bool = False
    observes: tuple[str, ...] = ()
    name: str = ""
    decision_period_s: float | None = None

    @abstractmethod
    def reset(self, team: Any, seed: int = 0) -> None:  # noqa: ANN401
        """Start an episode, after the environment has started it.

        Parameters
        ----------
        team : Team
            The environment of ``lidarium.parallel_env``, also in wrappers, or ``vector_env(...).team(episode)``.
        seed : int, optional
            Seed of all draws of the policy. 0 by default.

        Raises
        ------
        ValueError
            If the environment's level cannot carry out the policy's actions, robots lack an observation for it, or
            observations have a form of trainers that it does not read.
        """

    @abstractmethod
    def act(self, *args: Any, **kwargs: Any) -> dict[str, Action]:  # noqa: ANN401 (subclasses take observations alone)
        """Return an action for every agent in ``observations``: ``act(observations, agents=None)``.

        Parameters
        ----------
        observations : dict
            Observations by agent, as ``reset`` and ``step`` of the environment return them.
        agents : collection of str, optional
            The agents to decide for. All live ones by default. A subclass has no such parameter: it gets the
            observations of the chosen ones.

        Returns
        -------
        dict
            Actions by agent, for ``step`` of the environment.
        """

    _driven: Any = None
    _pace: "_Pace | None" = None

    def __init_subclass__(cls, **options: Any) -> None:  # noqa: ANN401
        super().__init_subclass__(**options)
        if "reset" in vars(cls):
            cls.reset = _checked(cls.reset)  # type: ignore[method-assign]
        if "act" in vars(cls):
            cls.act = _for_agents(cls.act)  # type: ignore[method-assign]

    @property
    def given_up(self) -> Sequence[GivenUp]:
        """Areas left unexplored so far; empty unless a policy overrides it."""
        return ()

    @property
    def decided_by(self) -> Mapping[str, int]:
        """How often a robot set out, by the part of the policy that sent it; empty if it has one part."""
        return {}

    def report(self) -> PolicyReport:
        """Return the report of the episode."""
        return PolicyReport(self.given_up, decided_by=self.decided_by)

    def team_maps(self) -> TeamMaps | None:
        """Return how a station has joined the robots' maps; None if there is no station."""
        return None


def _checked(reset: Callable[..., None]) -> Callable[..., None]:
    """Return a method ``reset`` that finds the team of an environment and checks that the policy can drive it."""

    @wraps(reset)
    def checked(policy: Policy, team: Any, seed: int = 0) -> None:  # noqa: ANN401
        team = getattr(team, "unwrapped", team)
        if isinstance(team, ExplorationEnv):
            team = EpisodeTeam(team.engine, conventions=team.conventions)
        level = getattr(team, "level", policy.level)
        if level != policy.level and policy.level not in LEVELS[level].carries:
            raise ValueError(
                f"{type(policy).__name__} decides at the level {policy.level!r}, which an environment of level "
                f"{level!r} does not carry out; want level={policy.level!r}"
            )
        if (settings := getattr(team, "settings", None)) is not None:
            check_observed(policy, _name_of(policy), settings.observe, getattr(team, "conventions", PLAIN))
        if policy.predicts and isinstance(team, EpisodeTeam):
            team.show_predictions()
        policy._driven = team
        policy._pace = _Pace(policy, team) if (policy.level, level) == ("waypoint", "velocity") else None
        reset(policy, team, seed)

    return checked


def _for_agents(act: Callable[..., dict[str, Action]]) -> Callable[..., dict[str, Action]]:
    """Return a method ``act`` that can decide for some agents."""

    @wraps(act)
    def for_agents(
        policy: Policy, observations: Mapping[str, Observation], agents: Collection[str] | None = None
    ) -> dict[str, Action]:
        if agents is not None:
            missing = [agent for agent in agents if agent not in observations]
            if missing:
                raise ValueError(f"there is no observation of {missing[0]!r}; want agents among {list(observations)}")
            observations = {agent: observations[agent] for agent in agents}
        if policy._driven is not None:  # a step also returns observations of agents that ended in it
            live = policy._driven.agents
            observations = {agent: seen for agent, seen in observations.items() if agent in live}
        if not observations:
            return {}
        pace = policy._pace
        return act(policy, observations) if pace is None else pace.act(act, policy, observations)

    return for_agents


class _Pace:
    """Lets a policy of waypoints decide as often in an environment of velocities as in one of waypoints.

    It decides when the period is over, a robot with a target arrives or finds no path, or other robots take part; in
    between, robots are given their last targets again.
    """

    def __init__(self, policy: Policy, team: Any) -> None:  # noqa: ANN401
        settings = getattr(team, "settings", None)
        period_s = 0.0 if settings is None else settings.decision_period_s
        self._period_s = policy.decision_period_s or period_s
        self._team = team
        self._due_s = -math.inf
        self._actions: dict[str, Action] = {}
        self._agents: list[str] = []
        self._waiting: set[str] = set()
        self._is_deciding = False
        self._drives = False

    def act(
        self,
        act: Callable[..., dict[str, Action]],
        policy: Policy,
        observations: Mapping[str, Observation],
    ) -> dict[str, Action]:
        """Return the actions of a method ``act``, new ones or the last."""
        if self._is_deciding:  # a method that calls that of its base class
            return act(policy, observations)
        waiting = {agent for agent in observations if self._team.drive_state(agent) in _DONE}
        agents, now = list(observations), self._team.time_s
        if agents == self._agents and waiting <= self._waiting and now < self._due_s - 1e-9:
            return dict(self._actions)
        self._is_deciding = True
        try:
            actions = act(policy, observations)
        finally:
            self._is_deciding = False
        self._drives |= any(isinstance(action, Target | Route) for action in actions.values())
        if not self._drives:  # no driver is there yet: robots stay by standing still
            actions = {agent: np.zeros(2, np.float32) if act is None else act for agent, act in actions.items()}
        self._due_s = now + self._period_s
        self._agents = agents
        self._waiting = waiting
        self._actions = {agent: action for agent, action in actions.items() if not isinstance(action, Stop | Order)}
        return actions


def _name_of(policy: Policy) -> str:
    return policy.name or type(policy).__name__


def check_observed(policy: Policy, name: str, observe: Sequence[str], conventions: Conventions = PLAIN) -> None:
    """Check that robots observe everything that a policy reads, in the form in which it does."""
    missing = _missing(policy, observe)
    if missing:
        hints = "".join(_HINTS.get(each, "") for each in missing)
        raise ValueError(
            f"{name} needs {', '.join(missing)}, which the robots do not observe; add to settings.observe{hints}"
        )
    if policy.observes and conventions.observation != PLAIN.observation:
        raise ValueError(
            f"{name} reads {', '.join(policy.observes)} by name, and observation is {conventions.observation!r}; "
            f"want observation={PLAIN.observation!r}"
        )
    place = conventions.action_mask
    if (place == "beside" and policy.observes) or (place == "infos" and MASK in policy.observes):
        raise ValueError(
            f"{name} reads {', '.join(policy.observes)} of an observation, and action_mask is {place!r}; "
            f"want action_mask={PLAIN.action_mask!r}"
        )


def _missing(policy: Policy, observe: Sequence[str]) -> tuple[str, ...]:
    """Return the observables that a policy reads and robots lack; its level always shows its own."""
    return tuple(each for each in policy.observes if each not in (*observe, *_OWN.get(policy.level, ())))


def settings_for(policy: Policy, settings: ExplorationSettings) -> ExplorationSettings:
    """Return settings with the observations that a policy reads added.

    Raises
    ------
    ValueError
        If they lack a sensor for it, or teammates; the message tells how to add it.
    """
    missing = _missing(policy, settings.observe)
    if "teammates" in missing and settings.robots == 1:
        raise ValueError(f"policy {_name_of(policy)} wants two robots or more; robots is 1")
    return replace(settings, observe=(*settings.observe, *missing)) if missing else settings


class PerRobot(Policy):
    """A decentralised policy: one instance for each robot.

    Each instance sees its own robot only.

    Parameters
    ----------
    factory : callable
        Returns a new policy for one robot.
    """

    def __init__(self, factory: Callable[[], Policy]) -> None:
        self._factory = factory
        probe = factory()
        self.level, self.shares_map, self.observes = probe.level, probe.shares_map, probe.observes
        self.decision_period_s, self.predicts = probe.decision_period_s, probe.predicts
        self._policies: dict[str, Policy] = {}

    @property
    def given_up(self) -> list[GivenUp]:
        """Areas left unexplored by the robots' instances, robot by robot."""
        return [entry for policy in self._policies.values() for entry in policy.given_up]

    @property
    def decided_by(self) -> Mapping[str, int]:
        """How often the robots set out, by the part of their instances that sent them."""
        return sum((Counter(policy.decided_by) for policy in self._policies.values()), Counter())

    def reset(self, team: Team, seed: int = 0) -> None:
        """Begin an episode with a new instance for each robot.

        Each instance has a seed of its own.
        """
        seeds = np.random.SeedSequence(seed).generate_state(len(team.agents), np.uint64)
        self._policies = {}
        for agent, own_seed in zip(team.agents, seeds, strict=True):
            self._policies[agent] = self._factory()
            self._policies[agent].reset(_Alone(team, agent), int(own_seed))

    def act(self, observations: Mapping[str, Observation]) -> dict[str, Action]:
        """Let each robot's instance decide on its own observation."""
        actions: dict[str, Action] = {}
        for agent, observation in observations.items():
            actions |= self._policies[agent].act({agent: observation})
        return actions


class _Alone:
    """A team as one robot sees it: itself."""

    def __init__(self, team: Team, agent: str) -> None:
        self._team, self._agent = team, agent

    @property
    def agents(self) -> list[str]:
        return [agent for agent in self._team.agents if agent == self._agent]

    @property
    def time_s(self) -> float:
        return self._team.time_s

    @property
    def level(self) -> str:
        return self._team.level

    @property
    def settings(self) -> ExplorationSettings:
        return self._team.settings

    def belief(self, agent: str) -> Belief:
        if agent != self._agent:
            raise ValueError(
                f"{self._agent} asked for the belief of {agent}; a decentralised policy sees its own robot only"
            )
        return self._team.belief(agent)

    def drive_state(self, agent: str) -> DriveState:
        return self._team.drive_state(agent)

    def operating_state(self, agent: str) -> OperatingState:
        return self._team.operating_state(agent)

    def last_order(self, agent: str) -> Order | None:
        return self._team.last_order(agent)

    def report(self, agent: str) -> Report | None:
        raise ValueError(f"{self._agent} asked for the report of {agent}; a decentralised policy has no station")

    def send_map(self, agent: str, others: FusedMap | None) -> bool:
        raise ValueError(f"{self._agent} would send {agent} what others know; a decentralised policy has no station")

    def forget_walls(self, agent: str, trail: NDArray[np.float64]) -> bool:
        raise ValueError(f"{self._agent} would send {agent} where others drove; a decentralised policy has no station")
