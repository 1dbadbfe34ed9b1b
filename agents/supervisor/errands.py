"""Where robots are sent by orders, until they are done or cannot be."""

import math
from dataclasses import dataclass

import numpy as np

from lidarium.agents.policy import Action, Stop, Team
from lidarium.agents.supervisor.supervisor import Command
from lidarium.envs.onboard.belief import Belief
from lidarium.envs.onboard.radio.messages import DriveState, Order, OrderKind
from lidarium.mapping.planning.frontiers.frontier_map import FRONTIER
from lidarium.mapping.planning.grid_planning import cells_of

PATIENCE_S = 20.0
"""Time without motion after which a sent robot explores by itself again [s]."""

MOVED_M = 0.15
"""What counts as having moved [m]."""

LOST_S = 2.0
"""An order that a robot has not taken after this long has not reached it [s]."""


@dataclass(slots=True)
class _Errand:
    """Where a robot is sent by an order, and where it was when it last had moved."""

    command: Command
    order: Order
    since_s: float
    place: tuple[float, float]
    is_new: bool = True
    is_taken: bool = False


class Errands:
    """The errands of a team's robots, by name.

    Parameters
    ----------
    team : Team
        The robots.
    """

    def __init__(self, team: Team) -> None:
        self._team = team
        self._errands: dict[str, _Errand] = {}

    def __len__(self) -> int:
        return len(self._errands)

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

        It is its order at first, to end where it came home, else nothing.
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
