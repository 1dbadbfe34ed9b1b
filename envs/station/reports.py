"""What robots report to their station.

With the ideal radio the station knows at any time what is now. With any other it stands where the first robot
started, and knows what has reached it there (`Exchange`); its orders reach a robot as long as the links do.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import partial
from weakref import WeakMethod

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.onboard.meters import Meters
from lidarium.envs.onboard.perception import Perception
from lidarium.envs.radio.exchange import NEVER, Exchange
from lidarium.envs.radio.messages import DriveState, Status, Target
from lidarium.envs.station.operating import Operating
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import three_levels
from lidarium.mapping.merging.fusion import FusedMap
from lidarium.mapping.merging.growing_maps import GrowingMap


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Report(Status):
    """What a robot reports to the station: of itself (`Status`), and its map.

    It is of the robot's own belief throughout.

    Attributes
    ----------
    time_s : float
        When it was true [s].
    map : GrowingMap
        Its own map, cut to what is known.
    start : Transform
        Where it began, in its map frame.
    frame : Transform or None
        How its map frame lies in the floor's; None where it does not know: with unknown starts that are not
        revealed to the station.
    """

    time_s: float
    map: GrowingMap
    start: Transform
    frame: Transform | None = None


def known_map(perception: Perception, row: int) -> GrowingMap:
    """Return what a robot's own map knows, cut out."""
    return _cut(perception, row, perception.own_map(row).log_odds, perception.known_window(row))


def _cut(
    perception: Perception, row: int, log_odds: NDArray[np.int8], window: tuple[int, int, int, int]
) -> GrowingMap:
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
    """Where the reports of an episode's robots come in, and their orders come from.

    Parameters
    ----------
    perception : Perception
        What the robots know; of one episode.
    meters : Meters
        What they measure of themselves.
    """

    def __init__(self, perception: Perception, meters: Meters) -> None:
        self._perception, self._meters = perception, meters
        # Nothing that these hold leads back here: else the maps of an environment that is dropped stay until
        # the garbage is collected.
        self.operating = Operating(perception, perception.settings, partial(_order_delay, perception))
        if self._exchange is not None:
            self._exchange.report_of = partial(_call, WeakMethod(self._status))
        self.start()

    @property
    def _exchange(self) -> Exchange | None:
        return _exchange_of(self._perception)

    def start(self) -> None:
        """Begin an episode, after its robots were placed: nobody has reported."""
        robots = range(self._perception.settings.robots)
        self.operating.start()
        self._starts = [self._pose(row) for row in robots]
        self._received: dict[int, Report] = {}

    def report(self, row: int) -> Report | None:
        """Return what last reached the station of a robot, None where nothing ever did."""
        exchange = self._exchange
        if exchange is None:
            time_s = int(self._perception.world.steps[0]) * self._perception.settings.time_step
            return self._report(row, time_s, known_map(self._perception, row), self._status(row))
        step, status = int(exchange.copied_at[-1, row]), exchange.statuses[-1][row]
        if step == NEVER or status is None:
            return None
        time_s = step * self._perception.settings.time_step
        before = self._received.get(row)
        if before is None or before.time_s != time_s:
            log_odds = exchange.copies[-1][row]
            self._received[row] = self._report(
                row, time_s, _cut(self._perception, row, log_odds, _window_of(log_odds)), status
            )
        return self._received[row]

    def send_map(self, row: int, others: FusedMap | None) -> bool:
        """Send a robot what others know, if the links to it stand.

        Return whether they do.

        It takes effect at once, however long the radio takes: what a station knows changes slowly.
        """
        if _order_delay(self._perception, row) is None:
            return False
        self._perception.received.receive(row, others)
        return True

    def forget_walls(self, row: int, trail: NDArray[np.float64]) -> bool:
        """Send a robot where another drove; return whether the links to it stand.

        The robot forgets the walls there (`ForgottenTrails.forget_walls`); nothing is sent where the links
        do not stand.
        """
        if _order_delay(self._perception, row) is None:
            return False
        self._perception.trails.forget_walls(row, trail)
        return True

    def _report(self, row: int, time_s: float, known: GrowingMap, status: Status) -> Report:
        of_itself = {field.name: getattr(status, field.name) for field in fields(Status)}
        return Report(**of_itself, time_s=time_s, map=known, start=self._starts[row], frame=self._frame(row))

    def _frame(self, row: int) -> Transform | None:
        """Return how a robot's map frame lies in the floor's, where it knows that."""
        if self._perception.settings.known_starts:
            return Transform(*self._perception.poses.offset(row).tolist())
        return (
            Transform(*self._perception.world.starts[row].tolist())
            if self._perception.settings.reveals_starts
            else None
        )

    def _status(self, row: int) -> Status:
        """Return what a robot reports of itself now."""
        self._meters.advance()
        drive, target, path_left_m = self._drive(row)
        state, meters = self.operating.states[row], self._meters
        return Status(
            self._pose(row),
            state,
            drive,
            target,
            path_left_m,
            meters.travelled_m(row),
            meters.left_j(row),
            self.operating.pause_cause(row),
        )

    def _drive(self, row: int) -> tuple[DriveState, Target | None, float]:
        """Return a robot's drive state, its target and the rest of its path [m]."""
        driver = self.operating.driver
        # At the scan at the start the driver has not begun yet.
        if driver is None or int(self._perception.world.steps[0]) == 0:
            return DriveState.IDLE, None, 0.0
        path = driver.path(row)
        return driver.state(row), driver.target(row), float(np.hypot(*np.diff(path, axis=0).T).sum())

    def _pose(self, row: int) -> Transform:
        return Transform(*self._perception.poses.pose_in_frame(row, row).tolist())


def _exchange_of(perception: Perception) -> Exchange | None:
    return perception.exchanges[0] if perception.exchanges else None


def _order_delay(perception: Perception, row: int) -> int | None:
    """Return after how many steps an order reaches a robot, None where it does not."""
    exchange = _exchange_of(perception)
    return 0 if exchange is None else exchange.order_delay(row)


def _call(method: WeakMethod[Callable[[int], Status]], row: int) -> Status:
    """Call a method of an object that is there as long as what calls it."""
    called = method()
    assert called is not None
    return called(row)
