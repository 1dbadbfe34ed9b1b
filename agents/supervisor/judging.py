"""The judgement of robots: what the station knows becomes a case, which the tree decides."""

import math
from collections.abc import Mapping
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.supervisor.assignment import NOBODY, best_goal
from lidarium.agents.supervisor.knowledge.station import MergeStation
from lidarium.agents.supervisor.knowledge.survey import Survey
from lidarium.agents.supervisor.tree import OTHER, RICH, Case, Leaf, RobotInputs, decide, decision_tree
from lidarium.envs.onboard.radio.messages import Target

LEAST_WAY_M = 1.0
"""What a metre costs a battery is estimated after a path of this length [m]."""

EXPLAINED_PAUSES = frozenset({"contact", "blocked"})
"""Causes of pauses that a robot has seen or felt, and backs out of."""


@dataclass(slots=True)
class Judged:
    """A case, what the tree said of it, and the goal that was chosen.

    Attributes
    ----------
    case : Case
        What is known of the robot.
    leaf : Leaf
        Where the tree has led.
    answers : tuple of (str, bool)
        The questions on the way there, with their answers.
    goal : int
        The goal that the robot is to get, `NOBODY` for none.
    target : Target or None
        Where it is sent, in its map frame.
    """

    case: Case
    leaf: Leaf
    answers: tuple[tuple[str, bool], ...]
    goal: int = NOBODY
    target: Target | None = None


class Judge:
    """Puts the robots of a station before the tree.

    Parameters
    ----------
    station : MergeStation
        What is known.
    standing_by : set of str
        Robots that have no goal of their own while others of their group work; the supervisor's own set.
    """

    def __init__(self, station: MergeStation, standing_by: AbstractSet[str]) -> None:
        self._station, self._standing_by, self._settings = station, standing_by, station.settings
        self._tree = decision_tree(station.settings)
        self._full_j: dict[str, float] = {}

    def judge_alone(self, agent: str) -> Judged:
        """Put a robot before the tree of which nothing but its last report is known."""
        return self._decide(Case(self._inputs(agent, 0.0)))

    def is_held(self, agent: str) -> bool:
        """Whether a robot stands by, paused by an order."""
        report = self._station.reports[agent]
        return agent in self._standing_by and report.pause_cause == "order"

    def judge(
        self,
        agent: str,
        group: list[str],
        workers: list[str],
        survey: Survey,
        taken: Mapping[str, int],
    ) -> Judged:
        """Put a robot before the tree, and choose its goal where it is to get another.

        Parameters
        ----------
        agent : str
            The robot.
        group, workers : list of str
            The robots that are joined with it, itself included, and those of them that can get goals.
        survey : Survey
            Their merged map.
        taken : mapping of str to int
            The goals that robots have by now, `NOBODY` for none.
        """
        inputs = self._inputs(agent, survey.known_area_m2)
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
            has_richer_goal=richer not in (NOBODY, going)
            and (going == NOBODY or areas[richer] > areas[going]),
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

        To a robot that stands by, the nearest one that has any goal.
        """
        is_waiting = agent in self._standing_by
        teammates = [
            self._inputs(teammate, survey.known_area_m2)
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
            self._inputs(teammate, survey.known_area_m2)
            for teammate in others
            if survey.are_meeting(agent, teammate)
        ]
        return min(teammates, key=lambda teammate: (teammate.remaining_m, teammate.agent), default=None)

    def _is_behind(self, agent: str, group: list[str]) -> bool:
        known = [self._station.known_m2(teammate) for teammate in group if teammate != agent]
        return bool(known) and self._station.known_m2(agent) < self._settings.unbalanced_share * float(
            np.mean(known)
        )

    def _is_battery_low(self, agent: str, survey: Survey) -> bool:
        """Whether the battery left would soon not bring a robot home.

        The estimate uses what metres have cost the robot until now.
        """
        report = self._station.reports[agent]
        if report.energy_left_j is None:
            return False
        full = self._full_j.setdefault(agent, report.energy_left_j)
        if report.travelled_m < LEAST_WAY_M:
            return False
        metre = (full - report.energy_left_j) / report.travelled_m
        way = survey.way_home_m(agent, report.start)
        # Where the merged map knows no path, the one that it came is one.
        return report.energy_left_j < self._settings.battery_margin * metre * min(way, report.travelled_m)

    def _decide(self, case: Case) -> Judged:
        leaf, answers = decide(self._tree, case)
        return Judged(case, leaf, tuple(answers))


def _worth(others: list[str], survey: Survey, taken: Mapping[str, int]) -> NDArray[np.float64]:
    """Return what each goal is worth to a robot, (K,).

    It is less where others see the goal, and -inf where it is taken or none.
    """
    worth = np.where(survey.is_goal(), 1.0, -np.inf)
    for teammate in others:
        place = survey.places[teammate]
        if place is not None:
            worth = worth - survey.seen_at(place)
        if taken[teammate] != NOBODY:
            worth[taken[teammate]] = -np.inf
    return worth
