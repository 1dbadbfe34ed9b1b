"""Operating states and orders of the robots of an episode.

They hold whether each robot operates, its last order, and the outcome.

A robot that operates takes any order. A paused robot stands still and takes only the orders to resume and to stop; a
robot that was stopped or has failed takes none. A robot pauses if it is ordered to and, if ``pauses_when_blocked`` is
set, by itself if its bumper touches anything or its way is blocked. A robot cannot see the obstacle that it touched,
otherwise it would not have driven there: when it resumes, it first backs out a little the way it came, and then
continues to its target.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.onboard.driving.path_following import BACKING_SPEED, BLOCKED, DRIVING
from lidarium.envs.onboard.driving.team_driver import TeamDriver
from lidarium.envs.onboard.perception import Perception
from lidarium.envs.onboard.radio.messages import OperatingState, Order, OrderKind, Target
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


def _state_after(reason: str) -> OperatingState:
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
        the order; of a refused one the robot's state, ``no_driver`` (no driver serves its action level),
        ``outside`` or ``occupied`` (the target on its map).
    target : Target or None
        Target of an order to drive, in the robot's map frame.
    """

    time_s: float
    agent: str
    kind: str
    what: str
    reason: str = ""
    target: Target | None = None


class Operating:
    """The operating states and orders of all robots; row = episode * robots + robot.

    Parameters
    ----------
    perception : Perception
        The beliefs of the robots.
    settings : ExplorationSettings
        The team of every episode.

    Attributes
    ----------
    driver : TeamDriver or None
        Drives the robots to targets; None at the velocity level before the first target.
    states : list of OperatingState
        State of each row.
    orders : list of Order or None
        The last order that each robot took.
    events : list of list of OperatingEvent
        The events of each episode, in their order.
    stopping : dict of int to str
        Rows that end at the next outcome, with their reasons.
    held : (rows,) bool
        Robots that are paused.
    sent : dict of int to Target
        Targets that robots were ordered to since `take_sent` was last called, by row.
    interrupting : (episodes,) bool
        Episodes in which a robot has paused by itself or got a late order since the last outcome, so that the basis
        of its decision has changed.
    is_active : bool
        Whether a step changes anything.
    state_names, order_names : (rows,) object
        Names of states and last orders for infos; replaced, never changed.
    """

    def __init__(self, perception: Perception, settings: ExplorationSettings) -> None:
        self._perception = perception
        self._settings = settings
        self._robots = settings.robots
        episodes = perception.world.episodes
        rows = settings.robots * episodes
        self.driver: TeamDriver | None = None
        self._make_driver: Callable[[], TeamDriver] | None = None
        self.states = [OperatingState.OPERATING] * rows
        self.orders: list[Order | None] = [None] * rows
        self.events: list[list[OperatingEvent]] = [[] for _ in range(episodes)]
        self.stopping: dict[int, str] = {}
        self.sent: dict[int, Target] = {}
        self.held = np.zeros(rows, np.bool_)
        self.interrupting = np.zeros(episodes, np.bool_)
        self.state_names = frozen(np.full(rows, OperatingState.OPERATING.value, object))
        self.order_names = frozen(np.full(rows, "", object))
        self._retreat_steps = max(round(RETREAT_S / settings.time_step), 1)
        self._retreating = np.zeros(rows, np.int64)
        self._pressed = np.zeros(rows, np.bool_)
        self._why_paused = [""] * rows
        self._addressed: set[int] = set()
        self._under_way: list[tuple[int, int, Order]] = []
        self._note_activity()

    def start(self, episode: int = 0) -> None:
        """Begin an episode: all robots operate, and no robot has an order."""
        rows = range(episode * self._robots, (episode + 1) * self._robots)
        for row in rows:
            self.states[row] = OperatingState.OPERATING
            self.orders[row] = None
            self._why_paused[row] = ""
            self.stopping.pop(row, None)
            self.sent.pop(row, None)
        self.events[episode] = []
        whole = slice(rows.start, rows.stop)
        self.held[whole] = False
        self.interrupting[episode] = False
        self._retreating[whole] = 0
        self._pressed[whole] = False
        self._addressed.difference_update(rows)
        self._under_way = [entry for entry in self._under_way if entry[1] not in rows]
        self._rename("state_names", whole, OperatingState.OPERATING.value)
        self._rename("order_names", whole, "")
        self._note_activity()

    def attach(self, driver: TeamDriver | None, make_driver: Callable[[], TeamDriver] | None = None) -> None:
        """Let a driver drive the robots to the targets of their orders, except paused robots.

        Without one, ``make_driver`` makes it when a robot is first ordered to a target.
        """
        self._make_driver = make_driver
        self.driver = driver
        if driver is not None:
            driver.planner.held = self.held

    def is_addressed(self, row: int) -> bool:
        """Whether a robot was ever given an order: it then drives without actions of its policy."""
        return row in self._addressed

    def pause_cause(self, row: int) -> str:
        """Return the reason of a robot's pause, empty if it is not paused."""
        return self._why_paused[row] if self.states[row] is OperatingState.PAUSED else ""

    def take_sent(self) -> dict[int, Target]:
        """Return the targets ordered since the last call, by row."""
        sent, self.sent = self.sent, {}
        return sent

    def order(self, row: int, order: Order) -> None:
        """Send a robot an order, which it takes, refuses or never receives.

        It takes the order now, or when the radio brings it.
        """
        self._addressed.add(row)
        delay = order_delay(self._perception, row)
        if delay is None:
            self._note(row, "lost", order.kind.value, order.reason, order.target)
        elif delay == 0:
            self._receive(row, order)
        else:
            self._under_way.append((self._step_of(row) + delay, row, order))
            self._note_activity()

    def before_step(self, commands: NDArray[np.float64], runs: NDArray[np.bool_] | None = None) -> None:
        """Deliver orders that arrive now; hold or back out robots in ``commands`` (rows, 2) [m/s, rad/s].

        ``runs`` (episodes,) are the episodes that take the step, all by default.
        """
        is_running = self._rows_of(runs)
        due = [entry for entry in self._under_way if entry[0] <= self._step_of(entry[1])]
        due = [entry for entry in due if is_running[entry[1]]]
        self._under_way = [entry for entry in self._under_way if entry not in due]
        for _, row, order in due:
            self._receive(row, order)
            self.interrupting[row // self._robots] = True
        commands[self.held] = 0.0
        is_retreating = (self._retreating > 0) & is_running
        commands[is_retreating] = (-BACKING_SPEED, 0.0)
        self._retreating[is_retreating] -= 1
        self._note_activity()

    def after_step(self, runs: NDArray[np.bool_] | None = None) -> None:
        """Pause the robots that have touched something or are blocked, if they do so by themselves."""
        if not self._settings.pauses_when_blocked:
            return
        is_running = self._rows_of(runs)
        pressed = np.asarray(self._perception.simulation.bumpers.any(axis=1))
        is_touching = pressed & ~self._pressed & (self._retreating == 0) & is_running
        self._pressed = pressed
        is_blocked = np.zeros_like(pressed)
        if self.driver is not None:
            is_blocked = (self.driver.drives.states == BLOCKED) & is_running
        for row in np.flatnonzero(is_touching | is_blocked).tolist():
            if self.states[row] is OperatingState.OPERATING:
                self._pause(row, "contact" if is_touching[row] else "blocked")
                self.interrupting[row // self._robots] = True

    def _rows_of(self, episodes: NDArray[np.bool_] | None) -> NDArray[np.bool_]:
        if episodes is None:
            return np.ones(len(self.held), np.bool_)
        return np.repeat(episodes, self._robots)

    def end(self, reasons: Mapping[int, str]) -> None:
        """Note that robots have ended, by row: they have failed, or were stopped."""
        rows = list(reasons)
        self.held[rows] = False
        self._retreating[rows] = 0
        names = self.state_names.copy()
        for row, reason in reasons.items():
            state = _state_after(reason)
            self.states[row] = state
            names[row] = state.value
            self._note(row, "state", state.value, reason)
        self.state_names = frozen(names)
        self._note_activity()

    def _receive(self, row: int, order: Order) -> None:
        """Let a robot take an order that has reached it, or refuse it."""
        why = self._why_refused(row, order)
        if why:
            self._note(row, "refused", order.kind.value, why, order.target)
            return
        self.orders[row] = order
        self._rename("order_names", row, order.kind.value)
        self._note(row, "order", order.kind.value, order.reason, order.target)
        if order.kind is OrderKind.STOP:
            self.stopping[row] = order.reason or "stopped"
        elif order.kind is OrderKind.PAUSE and self.states[row] is OperatingState.OPERATING:
            self._pause(row, "order")
        elif order.kind is OrderKind.RESUME and self.states[row] is OperatingState.PAUSED:
            self._resume(row)
        elif order.target is not None:
            self.sent[row] = order.target

    def _why_refused(self, row: int, order: Order) -> str:
        """Return why a robot does not take an order, nothing if it does."""
        if order.kind not in TAKES[self.states[row]]:
            return self.states[row].value
        if order.target is None:
            return ""
        if self.driver is None and self._make_driver is not None:
            self.attach(self._make_driver())
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
        """Resume a paused robot, away from an obstacle that it touched or that blocked it."""
        self.held[row] = False
        self._retreating[row] = self._retreat_steps if self._why_paused[row] in ("contact", "blocked") else 0
        if self.driver is not None and self.driver.drives.states[row] == BLOCKED:
            self.driver.drives.states[row], self.driver.drives.stood[row] = DRIVING, 0
        self._enter(row, OperatingState.OPERATING, "order")
        self._note_activity()

    def _enter(self, row: int, state: OperatingState, reason: str) -> None:
        self.states[row] = state
        self._rename("state_names", row, state.value)
        self._note(row, "state", state.value, reason)

    def _note(self, row: int, kind: str, what: str, reason: str = "", target: Target | None = None) -> None:
        """Add an event; an order that comes to the same again and again is listed once."""
        agent = self._settings.agents[row % self._robots]
        time_s = self._step_of(row) * self._settings.time_step
        event = OperatingEvent(time_s, agent, kind, what, reason, target)
        events = self.events[row // self._robots]
        last = next((one for one in reversed(events) if one.agent == event.agent), None)
        if last is None or (last.kind, last.what, last.reason, last.target) != (kind, what, reason, target):
            events.append(event)

    def _note_activity(self) -> None:
        is_busy = bool(self._under_way) or bool(self.held.any()) or bool(self._retreating.any())
        self.is_active = self._settings.pauses_when_blocked or is_busy

    def _rename(self, names: str, rows: slice | int, value: str) -> None:
        """Replace names for infos: arrays that were handed out do not change."""
        changed = getattr(self, names).copy()
        changed[rows] = value
        setattr(self, names, frozen(changed))

    def _step_of(self, row: int) -> int:
        return int(self._perception.world.steps[row // self._robots])


def order_delay(perception: Perception, row: int) -> int | None:
    """Return the number of steps until an order reaches a robot, None if it does not."""
    if not perception.exchanges:
        return 0
    episode, robot = divmod(row, perception.settings.robots)
    return perception.exchanges[episode].order_delay(robot)


def frozen(array: NDArray[Any]) -> NDArray[Any]:
    """Return an array that cannot be written to any more."""
    array.flags.writeable = False
    return array
