"""Operating states and orders of the robots of an episode.

They hold whether each robot takes part in the work, its last order, and what came of it.

A robot that operates takes any order. One that is paused stands still and takes only the orders to resume and
to stop; one that was stopped or has failed takes none. A robot pauses when it is ordered to, and, where
``pauses_when_blocked`` is set, by itself when its bumper touches anything or its way is blocked. What it
touched it cannot see, else it had not driven there: ordered to resume after that, it first backs out a little
the way it came, and then goes on with the target that it had.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.driving.path_following import BACKING_SPEED, BLOCKED, DRIVING
from lidarium.envs.driving.team_driver import TeamDriver
from lidarium.envs.onboard.perception import Perception
from lidarium.envs.radio.messages import OperatingState, Order, OrderKind, Target
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.mapping.planning.grid_planning import cells_of

RETREAT_S = 1.0
"""Time that a robot backs out when it resumes after a contact [s].

It drives at ``BACKING_SPEED``.
"""

TAKES: dict[OperatingState, frozenset[OrderKind]] = {
    OperatingState.OPERATING: frozenset(OrderKind),
    OperatingState.PAUSED: frozenset({OrderKind.PAUSE, OrderKind.RESUME, OrderKind.STOP}),
    OperatingState.STOPPED: frozenset(),
    OperatingState.FAILED: frozenset(),
}
"""Which orders a robot takes in each state."""

FAULTS = frozenset({"failed"})
"""Endings that are faults; a robot that ends for any other reason was stopped."""


def state_after(reason: str) -> OperatingState:
    """Return the state of a robot that has ended for a reason."""
    return OperatingState.FAILED if reason in FAULTS else OperatingState.STOPPED


@dataclass(frozen=True, slots=True)
class OperatingEvent:
    """Something that happened to a robot's state or orders.

    Attributes
    ----------
    time_s : float
        When [s].
    agent : str
        To whom.
    kind : str
        ``state`` (it came into a state), ``order`` (it took an order), ``refused`` (it did not take it) or
        ``lost`` (the order did not reach it).
    what : str
        The state's or the order's name.
    reason : str
        Why: of a state ``order``, ``contact``, ``blocked`` or the reason of its ending; of an order that of
        the order; of a refused one the robot's state, ``no_driver`` (its level of decision knows no targets),
        ``outside`` or ``occupied`` (the target on its map).
    target : Target or None
        Of an order to go somewhere, in the robot's map frame.
    """

    time_s: float
    agent: str
    kind: str
    what: str
    reason: str = ""
    target: Target | None = None


class Operating:
    """The operating states and orders of the robots of one episode.

    Parameters
    ----------
    perception : Perception
        What the robots know; of one episode.
    settings : ExplorationSettings
        The team.
    carry : callable
        Takes a robot's number; returns after how many steps an order of the station reaches it, None where it
        does not.

    Attributes
    ----------
    driver : TeamDriver or None
        Who drives the robots to targets; None at the level of velocities.
    states : list of OperatingState
        Of each robot.
    orders : list of Order or None
        The last order that each robot took.
    events : list of OperatingEvent
        All of this episode, in their order.
    stopping : dict of str to str
        Agents that end at the next outcome, with their reasons.
    held : (robots,) bool
        Who is paused.
    is_active : bool
        Whether anything has to be done in a step.
    is_interrupting : bool
        Whether a robot has paused by itself or got a late order since the last outcome: what it decides by
        has changed.
    """

    def __init__(
        self, perception: Perception, settings: ExplorationSettings, carry: Callable[[int], int | None]
    ) -> None:
        self._perception, self._settings, self._carry = perception, settings, carry
        self.driver: TeamDriver | None = None
        self.stopping: dict[str, str] = {}
        self.held = np.zeros(settings.robots, np.bool_)
        self._retreat_steps = max(round(RETREAT_S / settings.time_step), 1)
        self.start()

    def start(self) -> None:
        """Begin an episode: all operate, and nobody has got an order."""
        robots = self._settings.robots
        self.states = [OperatingState.OPERATING] * robots
        self.orders: list[Order | None] = [None] * robots
        self.events: list[OperatingEvent] = []
        self.stopping.clear()
        self.held[:] = False
        self.is_interrupting = False
        self._retreating = np.zeros(robots, np.int64)
        self._pressed = np.zeros(robots, np.bool_)
        self._why_paused = [""] * robots
        self._addressed: set[int] = set()
        self._sent: dict[int, Target] = {}
        self._under_way: list[tuple[int, int, Order]] = []
        self._note_activity()

    def attach(self, driver: TeamDriver) -> None:
        """Let a driver drive the robots to the targets of their orders.

        It leaves alone who is paused.
        """
        self.driver, driver.planner.held = driver, self.held

    def is_addressed(self, row: int) -> bool:
        """Whether a robot was ever given an order.

        Then it goes on by itself where its policy says nothing.
        """
        return row in self._addressed

    def pause_cause(self, row: int) -> str:
        """Return why a robot is paused, empty where it is not."""
        return self._why_paused[row] if self.states[row] is OperatingState.PAUSED else ""

    @property
    def sent(self) -> dict[int, Target]:
        """Targets that robots were ordered to since ``take_sent`` was last called.

        They are given by robot number.
        """
        return self._sent

    def take_sent(self) -> dict[int, Target]:
        """Return where robots have been ordered to go since the last call, by number."""
        sent, self._sent = self._sent, {}
        return sent

    def order(self, row: int, order: Order) -> None:
        """Send a robot an order, which it takes, refuses or never receives.

        It takes the order now, or when the radio brings it.
        """
        self._addressed.add(row)
        delay = self._carry(row)
        if delay is None:
            self._note(row, "lost", order.kind.value, order.reason, order.target)
        elif delay == 0:
            self._receive(row, order)
        else:
            self._under_way.append((self._step + delay, row, order))
            self._note_activity()

    def before_step(self, commands: NDArray[np.float64]) -> None:
        """Deliver orders that arrive now, and hold or back out robots that have to.

        This is done in ``commands`` (robots, 2) [m/s, rad/s].
        """
        due = [entry for entry in self._under_way if entry[0] <= self._step]
        self._under_way = [entry for entry in self._under_way if entry[0] > self._step]
        for _, row, order in due:
            self._receive(row, order)
            self.is_interrupting = True
        commands[self.held] = 0.0
        is_retreating = self._retreating > 0
        commands[is_retreating] = (-BACKING_SPEED, 0.0)
        self._retreating[is_retreating] -= 1
        self._note_activity()

    def after_step(self) -> None:
        """Pause the robots that have touched something or are blocked.

        This holds where they do so by themselves.
        """
        if not self._settings.pauses_when_blocked:
            return
        pressed = np.asarray(self._perception.simulation.bumpers.any(axis=1))
        is_touching, self._pressed = pressed & ~self._pressed & (self._retreating == 0), pressed
        is_blocked = np.zeros_like(pressed) if self.driver is None else self.driver.drives.states == BLOCKED
        for row in np.flatnonzero(is_touching | is_blocked).tolist():
            if self.states[row] is OperatingState.OPERATING:
                self._pause(row, "contact" if is_touching[row] else "blocked")
                self.is_interrupting = True

    def end(self, row: int, reason: str) -> None:
        """Note that a robot has ended: it has failed, or was stopped."""
        self.held[row] = False
        self._retreating[row] = 0
        self._enter(row, state_after(reason), reason)
        self._note_activity()

    def _receive(self, row: int, order: Order) -> None:
        """Let a robot take an order that has reached it, or refuse it."""
        why = self._why_refused(row, order)
        if why:
            self._note(row, "refused", order.kind.value, why, order.target)
            return
        self.orders[row] = order
        self._note(row, "order", order.kind.value, order.reason, order.target)
        if order.kind is OrderKind.STOP:
            self.stopping[self._settings.agents[row]] = order.reason or "stopped"
        elif order.kind is OrderKind.PAUSE and self.states[row] is OperatingState.OPERATING:
            self._pause(row, "order")
        elif order.kind is OrderKind.RESUME and self.states[row] is OperatingState.PAUSED:
            self._resume(row)
        elif order.target is not None:
            self._sent[row] = order.target

    def _why_refused(self, row: int, order: Order) -> str:
        """Return why a robot does not take an order, nothing where it does."""
        if order.kind not in TAKES[self.states[row]]:
            return self.states[row].value
        if order.target is None:
            return ""
        if self.driver is None:
            return "no_driver"
        navigation = self._perception.planning_map(row, self.driver.shares_map)
        place = np.array([order.target.x, order.target.y])
        cell_row, cell_column = np.asarray(
            cells_of(place, self._perception.poses.origin_in_frame(row), navigation.resolution)
        ).tolist()
        rows, columns = navigation.log_odds.shape
        if not (0 <= cell_row < rows and 0 <= cell_column < columns):
            return "outside"
        return "occupied" if navigation.log_odds[cell_row, cell_column] > 0 else ""

    def _pause(self, row: int, why: str) -> None:
        self.held[row] = True
        self._retreating[row] = 0
        self._why_paused[row] = why
        self._enter(row, OperatingState.PAUSED, why)
        self._note_activity()

    def _resume(self, row: int) -> None:
        """Let a paused robot go on, off what it touched or what was in its way."""
        self.held[row] = False
        self._retreating[row] = self._retreat_steps if self._why_paused[row] in ("contact", "blocked") else 0
        if self.driver is not None and self.driver.drives.states[row] == BLOCKED:
            self.driver.drives.states[row], self.driver.drives.stood[row] = DRIVING, 0
        self._enter(row, OperatingState.OPERATING, "order")
        self._note_activity()

    def _enter(self, row: int, state: OperatingState, reason: str) -> None:
        self.states[row] = state
        self._note(row, "state", state.value, reason)

    def _note(self, row: int, kind: str, what: str, reason: str = "", target: Target | None = None) -> None:
        """Add an event; an order that comes to the same again and again is listed once."""
        event = OperatingEvent(
            self._step * self._settings.time_step, self._settings.agents[row], kind, what, reason, target
        )
        last = next((one for one in reversed(self.events) if one.agent == event.agent), None)
        if last is None or (last.kind, last.what, last.reason, last.target) != (kind, what, reason, target):
            self.events.append(event)

    def _note_activity(self) -> None:
        is_busy = bool(self._under_way) or bool(self.held.any()) or bool(self._retreating.any())
        self.is_active = self._settings.pauses_when_blocked or is_busy

    @property
    def _step(self) -> int:
        return int(self._perception.world.steps[0])
