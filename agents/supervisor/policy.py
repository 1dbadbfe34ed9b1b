"""A supervisor over a policy, or over an environment in which anything else decides."""

import math
import time
from collections.abc import Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from gymnasium.vector import VectorEnv
from numpy.typing import NDArray

from lidarium.agents.policy import Action, Policy, Stop, Team
from lidarium.agents.report import GivenOrder, GivenUp, Join, LogEntry, PolicyReport, Supervision, TeamMaps
from lidarium.agents.supervisor.log import Decision, StationEvent
from lidarium.agents.supervisor.settings import SupervisorSettings
from lidarium.agents.supervisor.station import MergeStation
from lidarium.agents.supervisor.supervisor import Command, Supervisor
from lidarium.agents.supervisor.wrappers import Make, SupervisedBatch, SupervisedTeam
from lidarium.envs.faces.parallel import Observation
from lidarium.envs.faces.vector_env import BatchFace, ExplorationVectorEnv
from lidarium.envs.onboard.belief import Belief
from lidarium.envs.onboard.driving.path_planner import footprint_of
from lidarium.envs.onboard.radio.messages import DriveState, OperatingState, Order, OrderKind
from lidarium.envs.onboard.station.reports import Report
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.mapping.geometry.bounds import shown
from lidarium.mapping.merging.fusion import FusedMap
from lidarium.mapping.planning.frontiers.frontier_map import FRONTIER
from lidarium.mapping.planning.grid_planning import cells_of

PATIENCE_S = 20.0
"""Time without motion after which a sent robot explores by itself again [s]."""

MOVED_M = 0.15
"""Minimum motion that counts [m]."""

LOST_S = 2.0
"""An order that a robot has not taken after this long has not reached it [s]."""


DONE_RULE = 5
"""The rule that no frontier is left."""


@dataclass(slots=True)
class _Errand:
    """Goal of a robot by an order, and its position after its last motion."""

    command: Command
    order: Order
    since_s: float
    place: tuple[float, float]
    is_new: bool = True
    is_taken: bool = False


class _Errands:
    """The errands of a team's robots, by name."""

    def __init__(self, team: Team) -> None:
        self._team = team
        self._errands: dict[str, _Errand] = {}

    def has_any(self, agents: Sequence[str]) -> bool:
        """Whether any of some robots has an errand."""
        return any(agent in self._errands for agent in agents)

    def begin(self, command: Command) -> None:
        """Send a robot to the target of a command, unless both that and its errand lead home."""
        if command.target is None:
            return
        agent, under_way = command.agent, self._errands.get(command.agent)
        if under_way is not None and under_way.command.is_home and command.is_home:
            return
        x, y, _ = self._team.belief(agent).pose.tolist()
        order = Order(OrderKind.GO_TO, command.target, f"rule {command.rule}: {command.why}")
        self._errands[agent] = _Errand(command, order, self._team.time_s, (x, y))

    def cancel(self, agent: str) -> None:
        """Forget a robot's errand, if it has one."""
        self._errands.pop(agent, None)

    def review(self, agent: str) -> None:
        """End an errand that is done, or that cannot be."""
        errand = self._errands.get(agent)
        if errand is None or errand.is_new:
            return
        if not errand.is_taken:
            errand.is_taken = self._team.last_order(agent) is errand.order
            if not errand.is_taken:
                if self._team.time_s - errand.since_s > LOST_S:
                    del self._errands[agent]
                return
        belief, state = self._team.belief(agent), self._team.drive_state(agent)
        if errand.command.is_home:
            return
        x, y, _ = belief.pose.tolist()
        if state is DriveState.GIVING_WAY or math.dist((x, y), errand.place) > MOVED_M:
            errand.since_s, errand.place = self._team.time_s, (x, y)
        is_stuck = self._team.time_s - errand.since_s > PATIENCE_S
        if (
            state in (DriveState.ARRIVED, DriveState.NO_PATH)
            or is_stuck
            or not _is_frontier(belief, errand.command.observes)
        ):
            del self._errands[agent]

    def is_away(self, agent: str) -> bool:
        """Whether a robot is on an errand or gets the order now.

        Until it has taken the order the policy drives it.
        """
        errand = self._errands.get(agent)
        return errand is not None and (errand.is_new or errand.is_taken)

    def action(self, agent: str) -> Action:
        """Return the action of a robot on an errand.

        It is its order at first, to end on arrival at home, else nothing.
        """
        errand, state = self._errands[agent], self._team.drive_state(agent)
        if errand.is_new:
            errand.is_new = False
            return errand.order
        if errand.command.is_home and state in (DriveState.ARRIVED, DriveState.NO_PATH):
            return Stop("returned" if state is DriveState.ARRIVED else "unreachable")
        return None


def _is_frontier(belief: Belief, place: tuple[float, float] | None) -> bool:
    """Whether there still is a frontier at a place of a robot's map frame [m].

    The tolerance is that by which frames may differ.
    """
    if place is None:
        return True
    navigation = belief.map if belief.shared_map is None else belief.shared_map
    row, column = cells_of(np.asarray(place), belief.map_origin, navigation.resolution).tolist()
    reach = round(0.3 / navigation.resolution)
    around = navigation.frontiers.flags[
        max(row - reach, 0) : max(row + reach + 1, 0), max(column - reach, 0) : max(column + reach + 1, 0)
    ]
    return bool((around == FRONTIER).any())


class _LedTeam:
    """A team as the policy under a supervisor sees it.

    Drives for the supervisor are hidden from the policy.
    """

    def __init__(self, team: Team, exploring: AbstractSet[str]) -> None:
        self._team, self._exploring = team, exploring

    @property
    def agents(self) -> list[str]:
        """Live agents."""
        return self._team.agents

    @property
    def level(self) -> str:
        """The action level."""
        return self._team.level

    @property
    def settings(self) -> ExplorationSettings:
        """The settings of the team."""
        return self._team.settings

    @property
    def time_s(self) -> float:
        """Simulated time [s]."""
        return self._team.time_s

    def belief(self, agent: str) -> Belief:
        """Return the state of an agent's onboard software."""
        return self._team.belief(agent)

    def drive_state(self, agent: str) -> DriveState:
        """Return the state of its driving; idle while it drives for the supervisor."""
        return self._team.drive_state(agent) if agent in self._exploring else DriveState.IDLE

    def operating_state(self, agent: str) -> OperatingState:
        """Return whether it takes part in the work."""
        return self._team.operating_state(agent)

    def report(self, agent: str) -> Report | None:
        """Return the last report that reached the station."""
        return self._team.report(agent)

    def last_order(self, agent: str) -> Order | None:
        """Return the last order that it took."""
        return self._team.last_order(agent)

    def send_map(self, agent: str, others: FusedMap | None) -> bool:
        """Send it the map of the others."""
        return self._team.send_map(agent, others)

    def forget_walls(self, agent: str, trail: NDArray[np.float64]) -> bool:
        """Let it forget walls on another robot's trail."""
        return self._team.forget_walls(agent, trail)


class Supervised(Policy):
    """A supervisor over a policy, or over an environment in which anything else decides.

    Robots explore by that policy, the station merges their maps, and the tree redirects and stops them. Joined robots
    are sent the maps of the others, so the policy explores on the merged map if it uses the shared one. Around an
    environment or a batch it is a wrapper: see `SupervisedTeam`, `SupervisedBatch` and `SupervisedVecEnv`.

    Parameters
    ----------
    policy : Policy, ParallelEnv, VectorEnv or VecEnv
        Who decides for robots that have no order.
    settings : SupervisorSettings, optional
        Settings of the supervisor. Those of `SupervisorSettings` by default.
    **options
        Any of these settings by name, instead; of a wrapper also ``masks_orders``.

    Attributes
    ----------
    has_begun : bool
        Whether there was an episode; before it none of the following exists.
    decisions, events, joins : list
        The decisions, the events at the station, and the robots' frames as it found them.
    tick_seconds, merge_seconds : list of float
        Wall time of each decision by the tree, including its merge and the messages to the robots, and of each
        merge between decisions [s].
    """

    def __new__(cls, policy: Any, settings: SupervisorSettings | None = None, **options: Any) -> Any:  # noqa: ANN401
        """Return the policy, or the wrapper of an environment."""
        if isinstance(policy, Policy):
            return super().__new__(cls)
        masks_orders = options.pop("masks_orders", False)
        return _wrapped(policy, lambda level: cls(_Outside(level), settings, **options), masks_orders)

    def __getnewargs__(self) -> tuple[Policy]:
        """Return what ``__new__`` takes when a copy is made."""
        return (self.policy,)

    def __init__(self, policy: Policy, settings: SupervisorSettings | None = None, **options: Any) -> None:  # noqa: ANN401
        if settings is not None and options:
            raise ValueError(
                f"settings of the supervisor are given twice, also as {', '.join(options)}; want one or the other"
            )
        self.policy, self.settings = policy, settings or SupervisorSettings(**options)
        if not isinstance(self.settings, SupervisorSettings):
            raise ValueError(
                f"settings of the supervisor are {shown(settings)}; want SupervisorSettings, or settings by name"
            )
        self.level, self.observes = policy.level, policy.observes
        self.decision_period_s, self.predicts = policy.decision_period_s, policy.predicts
        self.has_begun = False
        self.tick_seconds: list[float] = []
        self.merge_seconds: list[float] = []
        self._stops: dict[str, Action] = {}
        self._free: list[str] = []

    @property
    def decisions(self) -> list[Decision]:
        """All decisions of the episode."""
        return self._supervisor.decisions

    @property
    def events(self) -> list[StationEvent]:
        """The events at the station."""
        return self._supervisor.station.events

    @property
    def joins(self) -> list[Join]:
        """How the frames of robots lie, as was found."""
        return self._supervisor.station.joins if self.has_begun else []

    @property
    def given_up(self) -> Sequence[GivenUp]:
        """Areas left unexplored by the robots."""
        return self.policy.given_up

    @property
    def decided_by(self) -> Mapping[str, int]:
        """How often the robots set out, by the part of their policy that sent them."""
        return self.policy.decided_by

    def report(self) -> PolicyReport:
        """Return the areas left unexplored, and the record of the station."""
        if not self.has_begun:
            return PolicyReport()
        log: list[LogEntry] = sorted([*self.events, *self.decisions], key=lambda entry: entry.time_s)
        orders = [
            GivenOrder(each.time_s, each.agent, OrderKind(each.order), each.place, each.goal)
            for each in self.decisions
            if each.order is not None
        ]
        return PolicyReport(
            self.given_up,
            Supervision(self.joins, orders, log, self._figures(), self.tick_seconds, self.merge_seconds),
            self.decided_by,
        )

    def team_maps(self) -> TeamMaps | None:
        """Return how the station has joined the robots' maps; None before an episode."""
        return self._supervisor.station.team_maps() if self.has_begun else None

    def _figures(self) -> dict[str, Any]:
        """Return the number of decisions of each type."""
        orders = [decision.order for decision in self.decisions]
        rules = sorted({decision.rule for decision in self.decisions})
        return {
            "decisions": len(orders),
            "redirections": orders.count(OrderKind.GO_TO.value),
            "stops": orders.count(OrderKind.STOP.value),
            "pauses": orders.count(OrderKind.PAUSE.value),
            "resumes": orders.count(OrderKind.RESUME.value),
            "by_rule": {str(rule): sum(each.rule == rule for each in self.decisions) for rule in rules},
            "joined": sum(event.event == "joined" for event in self.events),
            "dropped": sum(event.event == "dropped" for event in self.events),
        }

    def reset(self, team: Team, seed: int = 0) -> None:
        """Begin an episode."""
        self._team, self.has_begun = team, True
        belief = team.belief(team.agents[0])
        knows_starts = belief.shared_map is not None
        settings = self.settings if not knows_starts else _trusting(self.settings)
        station = MergeStation(team.agents, belief.map.resolution, belief.radius, settings)
        reports = [report for agent in team.agents if (report := team.report(agent)) is not None]
        if settings.trusts_starts and any(report.frame is None for report in reports):
            raise ValueError(
                "robots with unknown starts do not know how they stand to each other; want reveals_starts, "
                "which tells the station"
            )
        self._supervisor = Supervisor(station, footprint_of(belief.radius))
        self._informs = not knows_starts
        self._errands = _Errands(team)
        self._given_up: dict[str, NDArray[np.float64]] = {}
        self._informed: set[str] = set()
        self._decision_due, self._merge_due = settings.period_s, 0.0
        self._exploring: set[str] = set()
        self.tick_seconds, self.merge_seconds = [], []
        self.policy.reset(_LedTeam(team, self._exploring), seed)

    def act(self, observations: Mapping[str, Observation]) -> dict[str, Action]:
        """Let the policy decide for all robots that the supervisor has not sent anywhere."""
        free = self.direct(list(observations))
        actions: dict[str, Action] = self.policy.act({agent: observations[agent] for agent in free}) if free else {}
        return self.complete(list(observations), actions)

    def direct(self, agents: Sequence[str]) -> list[str]:
        """Merge and decide by the tree if it is time; return which of some robots its policy decides for now."""
        self._stops = self._supervise()
        for agent in agents:
            self._errands.review(agent)
        standing = self._supervisor.standing_by
        self._free = [
            agent
            for agent in agents
            if agent not in self._stops and agent not in standing and not self._errands.is_away(agent)
        ]
        return self._free

    def complete(self, agents: Sequence[str], actions: dict[str, Action]) -> dict[str, Action]:
        """Add the orders of the other robots to the actions of those that `direct` has returned."""
        stops, standing = self._stops, self._supervisor.standing_by
        self._exploring.clear()
        self._exploring.update(self._free)
        # Errands of robots that others drive, or that have ended, are no work of these.
        is_work_left = any(not isinstance(action, Stop) for action in actions.values()) or self._errands.has_any(agents)
        for agent in agents:
            if agent in stops:
                actions[agent] = stops[agent]
            elif self._errands.is_away(agent):
                # A robot that is driving needs no action: it goes on with its last order.
                if (action := self._errands.action(agent)) is not None:
                    actions[agent] = action
            elif agent in standing:
                actions[agent] = self._rest() if is_work_left else Stop("no_frontier")
            elif is_work_left and isinstance(actions.get(agent), Stop):
                # It may have to move aside, or get work when the others find more.
                actions[agent] = self._rest()
        return actions

    def _supervise(self) -> dict[str, Action]:
        """Take in reports, merge and decide by the tree if it is time.

        Return the robots that stop.
        """
        now = self._team.time_s
        is_decision, is_merge = now >= self._decision_due, now >= self._merge_due
        if not (is_decision or is_merge):
            return {}
        began = time.perf_counter()
        stops = self._tick(now, is_decision)
        (self.tick_seconds if is_decision else self.merge_seconds).append(time.perf_counter() - began)
        return stops

    def _tick(self, now: float, is_decision: bool) -> dict[str, Action]:
        """Do the work of `_supervise` when it is time."""
        settings, station = self.settings, self._supervisor.station
        self._collect(now)
        self._merge_due = _next(now, settings.merge_period_s)
        # A station that decides as often as it merges has no other time to search.
        station.merge(now, may_search=not is_decision or settings.period_s <= settings.merge_period_s)
        if self._informs:
            self._inform()
        if not is_decision:
            return {}
        self._decision_due = _next(now, settings.period_s)
        stops: dict[str, Action] = {}
        for command in self._supervisor.decide(now, self._given_up):
            self._obey(command, stops)
        return stops

    def _collect(self, now: float) -> None:
        """Take in the reports that have reached the station."""
        station = self._supervisor.station
        for agent in station.agents:
            report = self._team.report(agent)
            station.receive(agent, report, now)
            if (
                report is not None
                and report is station.reports.get(agent)
                and math.isclose(report.time_s, now, abs_tol=1e-6)
            ):
                positions = [(entry.x, entry.y) for entry in self.given_up if entry.agent == agent]
                self._given_up[agent] = np.array(positions, np.float64).reshape(-1, 2)

    def _inform(self) -> None:
        """Send each robot the map of the others of its group.

        Take it back from one that is joined no more.

        Of one that has failed they learn the trail: its images in their maps bar ways that are free, and
        hide frontiers.
        """
        station = self._supervisor.station
        station.left_behind = [
            (agent, trail) for agent, trail in station.left_behind if not self._team.forget_walls(agent, trail)
        ]
        for group in station.groups():
            for agent in group:
                others = [teammate for teammate in group if teammate != agent]
                if not others and agent not in self._informed:
                    continue
                if self._team.send_map(agent, station.fused(others, agent) if others else None):
                    (self._informed.add if others else self._informed.discard)(agent)

    def _obey(self, command: Command, stops: dict[str, Action]) -> None:
        """Begin a robot's order."""
        agent = command.agent
        if command.rule == DONE_RULE and "depth" in self.observes:
            return  # no frontier is left for lasers, but cameras may have ground to see: the policy stops its robots
        if command.kind is OrderKind.STOP:
            self._errands.cancel(agent)
            if agent not in self._supervisor.standing_by or self.settings.is_stop_final:
                stops[agent] = Order(OrderKind.STOP, reason="no_frontier" if command.rule == DONE_RULE else "stopped")
        elif command.kind in (OrderKind.PAUSE, OrderKind.RESUME):
            stops[agent] = Order(command.kind, reason=f"rule {command.rule}: {command.why}")
            if command.kind is OrderKind.PAUSE:
                self._errands.cancel(agent)
            else:
                self._errands.begin(command)
        else:
            self._errands.begin(command)

    def _rest(self) -> Action:
        """Return the action of a robot that stays."""
        if self.level == "velocity":
            return np.zeros(2, np.float32)
        return self._team.settings.frontiers if self.level == "frontier" else None


def _trusting(settings: SupervisorSettings) -> SupervisorSettings:
    return replace(settings, trusts_starts=True)


def _next(now: float, period_s: float) -> float:
    return (math.floor(now / period_s + 1e-9) + 1.0) * period_s


class _Outside(Policy):
    """Takes the place of the policy whose decisions come from outside."""

    def __init__(self, level: str) -> None:
        self.level = level

    def reset(self, team: Any, seed: int = 0) -> None:  # noqa: ANN401
        """Begin an episode."""

    def act(self, observations: Mapping[str, Observation]) -> dict[str, Action]:
        """Decide nothing."""
        del observations
        return {}


def _wrapped(env: Any, make: Make, masks_orders: bool) -> Any:  # noqa: ANN401
    """Return the wrapper of an environment of one team, or of a batch of them."""
    if isinstance(env, ExplorationVectorEnv):
        return SupervisedBatch(env, make, masks_orders)
    if isinstance(env, VectorEnv):
        raise ValueError(f"Supervised is put around {type(env).__name__}; want a batch of lidarium.vector_env")
    if isinstance(env, BatchFace):
        from lidarium.agents.supervisor.vec_env import SupervisedVecEnv  # needs stable-baselines3

        return SupervisedVecEnv(env, make, masks_orders)
    return SupervisedTeam(env, make, masks_orders)
