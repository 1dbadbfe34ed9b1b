"""The evaluation of the decision tree for each robot.

The station's knowledge becomes a case, the tree decides it, and orders to go get their goals.
"""

import math
from collections.abc import Mapping
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.supervisor.assignment import NOBODY, assign_by_cost, assign_by_utility, best_goal
from lidarium.agents.supervisor.log import Decision, StationEvent
from lidarium.agents.supervisor.station import MergeStation
from lidarium.agents.supervisor.survey import Survey
from lidarium.agents.supervisor.tree import (
    HOME,
    LEFT,
    OTHER,
    RESUMED,
    RICH,
    Case,
    Leaf,
    RobotInputs,
    decide,
    decision_tree,
    idle_leaf,
)
from lidarium.envs.onboard.radio.messages import OperatingState, OrderKind, Target
from lidarium.mapping.planning.footprint import Footprint

MIN_WAY_M = 1.0
"""The battery's cost per metre is estimated after a path of this length [m]."""

EXPLAINED_PAUSES = frozenset({"contact", "blocked"})
"""Causes of pauses that a robot has seen or felt, and backs out of."""


@dataclass(slots=True)
class _Judged:
    """A case, the decision of the tree, and the chosen goal.

    Attributes
    ----------
    case : Case
        Knowledge of the robot.
    leaf : Leaf
        Decision of the tree.
    answers : tuple of (str, bool)
        The questions on the way there, with their answers.
    goal : int
        The goal that the robot is to get, `NOBODY` for none.
    target : Target or None
        Its goal, in its map frame.
    """

    case: Case
    leaf: Leaf
    answers: tuple[tuple[str, bool], ...]
    goal: int = NOBODY
    target: Target | None = None


class _Judge:
    """Puts the robots of a station before the tree."""

    def __init__(self, station: MergeStation, standing_by: AbstractSet[str]) -> None:
        self._station, self._standing_by, self._settings = station, standing_by, station.settings
        self._tree = decision_tree(station.settings)
        self._first: dict[str, tuple[float, float]] = {}

    def judge_alone(self, agent: str) -> _Judged:
        """Put a robot before the tree of which nothing but its last report is known."""
        return self._decide(Case(self._inputs(agent, 0.0)))

    def is_held(self, agent: str) -> bool:
        """Whether a robot is paused by an order."""
        report = self._station.reports[agent]
        return agent in self._standing_by and report.pause_cause == "order"

    def judge(
        self,
        agent: str,
        group: list[str],
        workers: list[str],
        survey: Survey,
        taken: Mapping[str, int],
    ) -> _Judged:
        """Put a robot before the tree, and choose its goal if it is to get another."""
        inputs = self._inputs(agent, survey.area_m2)
        if agent not in workers:
            is_explained = self._station.reports[agent].pause_cause in EXPLAINED_PAUSES
            return self._decide(Case(inputs, is_pause_explained=is_explained))
        row, rival = workers.index(agent), self._rival(agent, workers, survey)
        if agent in self._standing_by and rival is not None:
            # It has no path of its own; what counts is its way to the goal of the other.
            goal = survey.going[rival.agent]
            remaining_m = float(survey.goals.costs[row, goal]) if goal != NOBODY else math.inf
            inputs = replace(inputs, remaining_m=remaining_m)
        others = [teammate for teammate in workers if teammate != agent]
        worth = _worth(others, survey, taken)
        if survey.going[agent] != NOBODY and rival is not None:
            worth[survey.going[agent]] = -np.inf
        costs, weight = survey.goals.costs[row], self._settings.cost_weight
        other = best_goal(costs, worth, weight)
        areas = survey.goals.areas
        richer = best_goal(
            costs,
            np.where(np.isfinite(worth), areas / max(float(areas.max(initial=0.0)), 1e-9), -np.inf),
            weight,
        )
        going = survey.going[agent]
        case = Case(
            robot=inputs,
            rival=rival,
            opponent=self._opponent(agent, others, survey)
            if rival is None and self._settings.avoids_rendezvous
            else None,
            has_frontier=survey.has_frontier(),
            has_other_goal=other != NOBODY,
            has_richer_goal=richer not in (NOBODY, going) and (going == NOBODY or areas[richer] > areas[going]),
            is_behind=self._is_behind(agent, group),
            is_enclosed=self._station.is_enclosed(agent),
            is_battery_low=self._settings.battery_margin > 0.0 and self._is_battery_low(agent, survey),
            is_held=self.is_held(agent),
        )
        one = self._decide(case)
        one.goal = {OTHER: other, RICH: richer}.get(one.leaf.aim, NOBODY)
        return one

    def _inputs(self, agent: str, area_m2: float) -> RobotInputs:
        report = self._station.reports[agent]
        share = self._station.known_m2(agent) / area_m2 if area_m2 > 0.0 else 0.0
        return RobotInputs(agent, report.path_left_m, report.state, min(share, 1.0), report.travelled_m)

    def _rival(self, agent: str, workers: list[str], survey: Survey) -> RobotInputs | None:
        """Return the nearest other robot with the same goal.

        The nearest robot with a goal, to one that is paused.
        """
        is_waiting = agent in self._standing_by
        teammates = [
            self._inputs(teammate, survey.area_m2)
            for teammate in workers
            if teammate != agent
            and teammate not in self._standing_by
            and (
                survey.places[teammate] is not None
                if is_waiting
                else survey.is_same_goal(agent, teammate, self._settings.same_goal_m)
            )
        ]
        return min(teammates, key=lambda teammate: (teammate.remaining_m, teammate.agent), default=None)

    def _opponent(self, agent: str, others: list[str], survey: Survey) -> RobotInputs | None:
        """Return the nearest robot that an agent is about to meet."""
        teammates = [
            self._inputs(teammate, survey.area_m2) for teammate in others if survey.are_meeting(agent, teammate)
        ]
        return min(teammates, key=lambda teammate: (teammate.remaining_m, teammate.agent), default=None)

    def _is_behind(self, agent: str, group: list[str]) -> bool:
        known = [self._station.known_m2(teammate) for teammate in group if teammate != agent]
        return bool(known) and self._station.known_m2(agent) < self._settings.unbalanced_share * float(np.mean(known))

    def _is_battery_low(self, agent: str, survey: Survey) -> bool:
        """Whether the battery left would soon not bring a robot home.

        The estimate uses the robot's cost per metre since its first report.
        """
        report = self._station.reports[agent]
        if report.energy_left_j is None:
            return False
        energy_j, travelled_m = self._first.setdefault(agent, (report.energy_left_j, report.travelled_m))
        if report.travelled_m - travelled_m < MIN_WAY_M:
            return False
        metre = (energy_j - report.energy_left_j) / (report.travelled_m - travelled_m)
        way = survey.way_home_m(agent, report.start)
        # Where the merged map knows no path, the one that it came is one.
        return report.energy_left_j < self._settings.battery_margin * metre * min(way, report.travelled_m)

    def _decide(self, case: Case) -> _Judged:
        leaf, answers = decide(self._tree, case)
        return _Judged(case, leaf, tuple(answers))


def _worth(others: list[str], survey: Survey, taken: Mapping[str, int]) -> NDArray[np.float64]:
    """Return the value of each goal to a robot, (K,).

    It is less if others see the goal, and -inf if it is taken or none.
    """
    worth = np.where(survey.is_goal(), 1.0, -np.inf)
    for teammate in others:
        position = survey.places[teammate]
        if position is not None:
            worth = worth - survey.seen_at(position)
        if taken[teammate] != NOBODY:
            worth[taken[teammate]] = -np.inf
    return worth


STICKINESS_M = 1.0
"""Distance by which a robot's present goal counts as nearer [m].

It applies where all robots get goals at once.
"""


@dataclass(frozen=True, slots=True)
class Command:
    """An order to a robot, and its result.

    Attributes
    ----------
    agent : str
        The robot.
    kind : OrderKind
        ``STOP``, ``PAUSE``, ``GO_TO`` or ``RESUME``; with a target it then goes there.
    rule : int
        The rule behind it.
    why : str
        In words.
    target : Target or None
        Its goal, in its map frame.
    observes : (float, float) or None
        The frontier to see from there, in its map frame [m].
    is_home : bool
        Whether it ends on arrival.
    """

    agent: str
    kind: OrderKind
    rule: int
    why: str
    target: Target | None = None
    observes: tuple[float, float] | None = None
    is_home: bool = False


class Supervisor:
    """Leads the robots of a station.

    Attributes
    ----------
    decisions : list of Decision
        All that it decided.
    standing_by : set of str
        Robots that have no goal of their own while others of their group work.
    """

    def __init__(self, station: MergeStation, footprint: Footprint) -> None:
        self.station, self.footprint, self._settings = station, footprint, station.settings
        self.decisions: list[Decision] = []
        self.standing_by: set[str] = set()
        self._silent: set[str] = set()
        self._judge = _Judge(station, self.standing_by)

    def decide(self, time_s: float, given_up: Mapping[str, NDArray[np.float64]]) -> list[Command]:
        """Decide about all robots.

        Parameters
        ----------
        time_s : float
            Now [s].
        given_up : mapping of str to (N, 2) float64
            Reported positions of frontiers given up, in the robots' map frames [m].
        """
        commands: list[Command] = []
        grouped = self.station.groups()
        for group in grouped:
            commands += self._decide_group(group, time_s, given_up)
        for agent in self.station.agents:
            if not any(agent in group for group in grouped):
                self._pass_over(agent, time_s)
        return commands

    def _pass_over(self, agent: str, time_s: float) -> None:
        """Log a robot that has failed, or of which nothing is known."""
        if agent in self.station.reports:
            self._log(time_s, (agent,), self._judge.judge_alone(agent))
        elif agent not in self._silent:
            self._silent.add(agent)
            self.station.events.append(
                StationEvent(time_s, "silent", (agent,), "it has not reported yet, and gets no orders")
            )

    def _decide_group(
        self, group: list[str], time_s: float, given_up: Mapping[str, NDArray[np.float64]]
    ) -> list[Command]:
        """Decide about the robots of a group."""
        station = self.station
        held = {agent for agent in group if self._judge.is_held(agent)}
        workers = [
            agent for agent in group if agent in held or station.reports[agent].state is OperatingState.OPERATING
        ]
        fused = station.fused(group, group[0])
        frames = {agent: frame for agent in group if (frame := station.lookup(group[0], agent)) is not None}
        if fused is None:
            return []
        positions = [
            frames[agent].apply(given_up[agent]) for agent in group if agent in given_up and len(given_up[agent])
        ]
        all_given_up = np.concatenate(positions) if positions else np.zeros((0, 2))
        # Who is paused keeps its target, but goes nowhere.
        reports = {
            agent: replace(report, target=None) if agent in held else report
            for agent, report in station.reports.items()
        }
        survey = Survey(fused, frames, reports, workers, all_given_up, self.footprint, self._settings)
        judged: dict[str, _Judged] = {}
        taken: dict[str, int] = dict(survey.going)
        for agent in group:
            one = self._judge.judge(agent, group, workers, survey, taken)
            judged[agent] = one
            if one.goal != NOBODY:
                taken[agent] = one.goal
        if self._settings.assignment != "pairs":
            self._assign_all(judged, workers, survey)
        return [
            command
            for one in judged.values()
            if (command := self._command(one, survey, time_s, tuple(group))) is not None
        ]

    def _assign_all(self, judged: Mapping[str, _Judged], workers: list[str], survey: Survey) -> None:
        """Give goals to all robots of a group at once that are to explore."""
        exploring = [agent for agent in workers if judged[agent].leaf.rule in (0, 3, 4, 7, RESUMED.rule)]
        rows = [workers.index(agent) for agent in exploring]
        is_goal = survey.is_goal()
        ways = survey.goals.costs[rows]
        costs = np.where(is_goal, ways, math.inf)
        for row, agent in enumerate(exploring):
            going = survey.going[agent]
            if going != NOBODY:
                # What has become short while a robot drives to it is still its goal: else it is left for
                # later, which costs another way.
                costs[row, going], is_goal[going] = max(ways[row, going] - STICKINESS_M, 0.0), True
        if self._settings.assignment == "hungarian":
            goals = assign_by_cost(costs)
        else:
            goals = assign_by_utility(costs, survey.seen(), is_goal.astype(np.float64), self._settings.cost_weight)
        for agent, goal in zip(exploring, goals.tolist(), strict=True):
            one = judged[agent]
            if one.case.is_held:
                one.leaf, one.goal = (LEFT, NOBODY) if goal == NOBODY else (RESUMED, goal)
            elif goal == NOBODY:
                # More robots than goals; whom the rules stop or let go on, they do.
                if one.leaf.order is OrderKind.GO_TO:
                    one.leaf, one.goal = idle_leaf(6, "the others have all goals", self._settings), NOBODY
            elif goal == survey.going[agent]:
                one.leaf, one.goal = Leaf(6, None, "it has the goal that it should have"), NOBODY
            else:
                one.leaf, one.goal = Leaf(6, OrderKind.GO_TO, "all robots got goals at once", OTHER), goal

    def _command(self, one: _Judged, survey: Survey, time_s: float, group: tuple[str, ...]) -> Command | None:
        """Return the order to a robot, and log the decision."""
        agent, leaf = one.case.robot.agent, one.leaf
        observes = None
        if leaf.aim == HOME:
            start = self.station.reports[agent].start
            one.target = Target(start.x, start.y)
        elif leaf.aim:
            one.target, observes = (
                Target(*survey.stand(agent, one.goal)),
                survey.observed_cell(agent, one.goal),
            )
        self._log(time_s, group, one)
        if leaf.order is None:
            if leaf.rule != 2:
                self.standing_by.discard(agent)
            return None
        if leaf.order in (OrderKind.STOP, OrderKind.PAUSE) and leaf.rule in (3, 6):
            self.standing_by.add(agent)
        else:
            self.standing_by.discard(agent)
        return Command(agent, leaf.order, leaf.rule, leaf.why, one.target, observes, leaf.aim == HOME)

    def _log(self, time_s: float, group: tuple[str, ...], one: _Judged) -> None:
        case, leaf, target = one.case, one.leaf, one.target
        pose = self.station.reports[case.robot.agent].pose
        self.decisions.append(
            Decision(
                time_s,
                case.robot.agent,
                group,
                case.robot,
                case.rival or case.opponent,
                one.answers,
                leaf.rule,
                None if leaf.order is None else leaf.order.value,
                leaf.why,
                (pose.x, pose.y),
                None if target is None else (target.x, target.y),
            )
        )
