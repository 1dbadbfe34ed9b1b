"""Reports of the robots to their station.

With the ideal radio the station always has the current state. With any other radio it is at the start of the first
robot and has only received data (`Exchange`); its orders reach a robot as long as the links work.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from functools import partial
from typing import Any
from weakref import WeakMethod

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.onboard.meters import Meters
from lidarium.envs.onboard.perception import Perception
from lidarium.envs.onboard.radio.exchange import NEVER, Exchange
from lidarium.envs.onboard.radio.messages import DriveState, Status, Target
from lidarium.envs.onboard.station.operating import Operating, order_delay
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import three_levels
from lidarium.mapping.merging.fusion import FusedMap
from lidarium.mapping.merging.incremental import GrowingMap


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Report(Status):
    """A report of a robot to the station: its `Status` and its map.

    It is of the robot's own belief throughout.

    Attributes
    ----------
    time_s : float
        When it was true [s].
    map : GrowingMap
        Its own map, cut to the known area.
    start : Transform
        Start pose, in its map frame.
    frame : Transform or None
        Transform of its map frame to the floor's; None if it does not know: with unknown starts that are not
        revealed to the station.
    """

    time_s: float
    map: GrowingMap
    start: Transform
    frame: Transform | None = None


def known_map(perception: Perception, row: int) -> GrowingMap:
    """Return the known area of a robot's own map, cut out."""
    return _cut(perception, row, perception.own_map(row).log_odds, perception.known_window(row))


def _cut(perception: Perception, row: int, log_odds: NDArray[np.int8], window: tuple[int, int, int, int]) -> GrowingMap:
    """Return a window of a map with the place and the size of a robot's own.

    The window is rows and columns, low and high.
    """
    row_low, row_high, column_low, column_high = window
    resolution = perception.settings.occupancy.resolution
    x, y = perception.poses.origin_in_frame(row)
    levels = three_levels(np.asarray(log_odds[row_low:row_high, column_low:column_high]))
    return GrowingMap(levels, (x + column_low * resolution, y + row_low * resolution))


def _window_of(log_odds: NDArray[np.int8]) -> tuple[int, int, int, int]:
    """Return the rows and columns that hold all that a map knows.

    They are the first and the last, the last exclusive.
    """
    rows, columns = np.flatnonzero(log_odds.any(axis=1)), np.flatnonzero(log_odds.any(axis=0))
    if not len(rows):
        return 0, 0, 0, 0
    return int(rows[0]), int(rows[-1]) + 1, int(columns[0]), int(columns[-1]) + 1


class Station:
    """The station of an episode's robots: receives their reports and sends their orders.

    Robots are given by number within their team.

    Parameters
    ----------
    perception : Perception
        The beliefs of the robots.
    meters : Meters
        Measurements of the robots' own state.
    operating : Operating
        Their operating states.
    episode : int, optional
        Which episode. The first by default.
    """

    def __init__(self, perception: Perception, meters: Meters, operating: Operating, episode: int = 0) -> None:
        self._perception = perception
        self._meters = meters
        self._operating = operating
        self._episode = episode
        self._first = episode * perception.settings.robots
        self._received: dict[int, Report] = {}
        self._answer()
        self.start()

    def _answer(self) -> None:
        """Let the robots' radios ask for the status of their robots here."""
        if self._exchange is not None:
            # A weak reference: otherwise the maps of a discarded environment stay until garbage is collected.
            self._exchange.report_of = partial(_call, WeakMethod(self._status))

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._answer()

    @property
    def _exchange(self) -> Exchange | None:
        exchanges = self._perception.exchanges
        return exchanges[self._episode] if exchanges else None

    @property
    def _step(self) -> int:
        return int(self._perception.world.steps[self._episode])

    def start(self) -> None:
        """Begin an episode, after its robots were placed; there are no reports yet."""
        self._starts = [self._pose(self._first + robot) for robot in range(self._perception.settings.robots)]
        self._received = {}

    def report(self, robot: int) -> Report | None:
        """Return the last report of a robot that reached the station, None if no report has."""
        perception, exchange = self._perception, self._exchange
        row = self._first + robot
        time_step = perception.settings.time_step
        if exchange is None:
            return self._report(robot, self._step * time_step, known_map(perception, row), self._status(robot))
        step, status = int(exchange.copied_at[-1, robot]), exchange.statuses[-1][robot]
        if step == NEVER or status is None:
            return None
        time_s = step * time_step
        before = self._received.get(robot)
        if before is None or before.time_s != time_s:
            log_odds = exchange.copies[-1][robot]
            cut = _cut(perception, row, log_odds, _window_of(log_odds))
            self._received[robot] = self._report(robot, time_s, cut, status)
        return self._received[robot]

    def send_map(self, robot: int, others: FusedMap | None) -> bool:
        """Send a robot the map of the others, and return whether the links to it work.

        It takes effect at once even if the radio is slow: the knowledge of a station changes slowly.
        """
        row = self._first + robot
        if order_delay(self._perception, row) is None:
            return False
        self._perception.received.receive(row, others)
        self._send_sparse(robot, {} if others is None else others.frames)
        return True

    def _send_sparse(self, robot: int, frames: Mapping[str, Transform]) -> None:
        """Send a robot the sparse maps of others, as the station has them; their frames are in the robot's."""
        sparse_maps, exchange = self._perception.sparse_maps, self._exchange
        sparse_maps.forget_others(self._first + robot)
        for other, agent in enumerate(self._perception.settings.agents):
            if agent in frames:
                share = sparse_maps.share(self._first + other) if exchange is None else exchange.sparse[-1][other]
                sparse_maps.receive(self._first + robot, self._first + other, share, frames[agent])

    def forget_walls(self, robot: int, trail: NDArray[np.float64]) -> bool:
        """Let a robot forget the walls along a trail (`ForgottenTrails`); return whether the links to it work."""
        row = self._first + robot
        if order_delay(self._perception, row) is None:
            return False
        self._perception.trails.forget_walls(row, trail)
        return True

    def _report(self, robot: int, time_s: float, known: GrowingMap, status: Status) -> Report:
        of_itself = {field.name: getattr(status, field.name) for field in fields(Status)}
        return Report(**of_itself, time_s=time_s, map=known, start=self._starts[robot], frame=self._frame(robot))

    def _frame(self, robot: int) -> Transform | None:
        """Return how a robot's map frame lies in the floor's, if it knows that."""
        perception, row = self._perception, self._first + robot
        if perception.settings.known_starts:
            return Transform(*perception.poses.offset(row).tolist())
        is_revealed = perception.settings.reveals_starts
        return Transform(*perception.world.starts[row].tolist()) if is_revealed else None

    def _status(self, robot: int) -> Status:
        """Return the current status of a robot."""
        row, meters = self._first + robot, self._meters
        meters.advance()
        drive, target, path_left_m = self._drive(row)
        return Status(
            self._pose(row),
            self._operating.states[row],
            drive,
            target,
            path_left_m,
            meters.travelled_m(row),
            meters.left_j(row),
            self._operating.pause_cause(row),
        )

    def _drive(self, row: int) -> tuple[DriveState, Target | None, float]:
        """Return a robot's drive state, its target and the rest of its path [m]."""
        driver = self._operating.driver
        # At the scan at the start the driver has not begun yet.
        if driver is None or self._step == 0:
            return DriveState.IDLE, None, 0.0
        path = driver.path(row)
        return driver.state(row), driver.target(row), float(np.hypot(*np.diff(path, axis=0).T).sum())

    def _pose(self, row: int) -> Transform:
        return Transform(*self._perception.poses.pose_in_frame(row, row).tolist())


def _call(method: WeakMethod[Callable[[int], Status]], robot: int) -> Status:
    """Call a method of an object that lives as long as its caller."""
    called = method()
    assert called is not None
    return called(robot)
