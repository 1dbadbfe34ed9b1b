"""Decisions by waypoints: the onboard driver takes a robot to its waypoint."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lidarium.envs.levels.level import DECIDES, STEPS, Level, Mask, Turn, add_info, check_rows, numbers_of
from lidarium.envs.onboard.driving.drives import DRIVE_STATES
from lidarium.envs.onboard.driving.team_driver import TeamDriver
from lidarium.envs.onboard.perception import Perception
from lidarium.envs.onboard.radio.messages import Orders, Route, Target
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.mapping.geometry.bounds import shown


class Ways(NamedTuple):
    """The targets and routes of robots.

    Attributes
    ----------
    orders : Orders
        The target of each row.
    routes : dict of int to Route
        Routes that are followed unchanged, by row.
    """

    orders: Orders
    routes: dict[int, Route]


def is_way(action: Any) -> bool:  # noqa: ANN401
    """Whether an action is a target, a route, or None to stay."""
    return action is None or isinstance(action, Target | Route)


def read_ways(actions: Mapping[int, Target | Route | None], rows: int) -> Ways:
    """Return the targets and routes of some rows; the others stay."""
    targets: list[Target | None] = [None] * rows
    routes: dict[int, Route] = {}
    for row, action in actions.items():
        if isinstance(action, Route):
            routes[row] = action
            targets[row] = action.target
        else:
            targets[row] = action
    return Ways(Orders.of(targets), routes)


def give_ways(driver: TeamDriver, ways: Ways, turn: Turn) -> None:
    """Give the robots that decide their targets; an order of the station has priority, a paused robot keeps its own."""
    is_assigned = turn.given & ~turn.operating.held
    driver.assign(is_assigned, ways.orders)
    for row, route in ways.routes.items():
        if is_assigned[row]:
            driver.follow(row, route)
    rows = len(is_assigned)
    for row, target in turn.operating.take_sent().items():
        driver.assign(np.arange(rows) == row, Orders.of([target] * rows))


class WaypointLevel(Level):
    """An action is a point within the observed map.

    It is two numbers within [-1, 1]: the position along the axes of the robot's map frame from its believed position,
    as a share of half the map's side. A ``Target`` gives a position in the map frame directly; a ``Route`` is a path
    planned by the policy, which the robot follows unchanged, with the usual safety stop and right of way; with None
    the robot stays and gives way. The onboard driver plans a path on the robot's map. If a point is not known to be
    free, the robot approaches it as far as a path exists; if no path exists, the robot stays.

    A decision lasts for the decision period. It ends earlier if any robot with a target arrives or finds no path,
    pauses by itself, gets an order late, or ends.

    Attributes
    ----------
    driver : TeamDriver
        Drives the robots.
    router : callable or None
        Called in each decision, when all robots have their targets, with the rows that take part: it may let the
        driver follow routes to the targets. None by default: paths are planned on grids.
    """

    takes_none = True
    driver: TeamDriver

    def __init__(
        self,
        perception: Perception,
        settings: ExplorationSettings,
        shares_map: bool = True,
        decision_period_s: float | None = None,
    ) -> None:
        super().__init__(perception, settings, shares_map, decision_period_s)
        self._points = spaces.Box(-1.0, 1.0, (2,), np.float32)
        self.action_space = self._points
        self.period_s = settings.decision_period_s if decision_period_s is None else decision_period_s
        self.steps = max(round(self.period_s / settings.time_step), 1)
        self.driver = TeamDriver(perception, settings, shares_map)
        self.drives = self.driver.drives
        self.following = self.driver.following
        self.router: Callable[[NDArray[np.int64]], None] | None = None
        self._half_side = 0.5 * settings.map_cells * settings.occupancy.resolution

    def start(self, episode: int) -> None:
        """Begin an episode: no robot has a target."""
        self.driver.start(episode)

    def read(self, actions: Mapping[int, Any], names: list[str]) -> Ways:
        """Return targets and routes of rows."""
        if self.action_space is not self._points or not self.reads_rows_as(WaypointLevel):
            # A level of a user's own, which decodes arrays; targets are the same there.
            numbers = {row: action for row, action in actions.items() if not is_way(action)}
            ways: Ways = super().read(numbers, names)
            if len(numbers) == len(actions):
                return ways
            given = read_ways({row: action for row, action in actions.items() if is_way(action)}, self.rows)
            return Ways(given.orders.overlaid(ways.orders, list(numbers)), {**ways.routes, **given.routes})
        return read_ways(
            {
                row: action if is_way(action) else self._target(row, action, names[row % len(names)])
                for row, action in actions.items()
            },
            self.rows,
        )

    def read_rows(self, actions: Any, live: Mask) -> Ways:  # noqa: ANN401
        """Return the targets of all rows; an array of objects may hold ``Target``, ``Route`` and None."""
        if isinstance(actions, np.ndarray) and actions.dtype == object and actions.shape[:1] == (self.rows,):
            rows = np.flatnonzero(live).tolist()
            names = [f"row {row}" for row in range(self.rows)]
            return self.read({row: actions[row] for row in rows}, names)
        wanted = "two finite numbers within [-1, 1]"
        shares = check_rows(actions, (self.rows, 2), live, wanted).astype(np.float64)
        positions = self.perception.beliefs.believed[:, :2] - self.perception.offsets
        return self.ways_to(positions + np.clip(shares, -1.0, 1.0) * self._half_side, live)

    def ways_to(self, targets: NDArray[np.float64], live: Mask) -> Ways:
        """Return the targets or routes of live rows to positions (rows, 2) in their map frames [m]."""
        return Ways(Orders(live.copy(), targets, np.full(self.rows, np.nan)), {})

    def _target(self, row: int, action: Any, name: str) -> Target:  # noqa: ANN401
        share = numbers_of(action)
        if share.shape != (2,) or not np.isfinite(share).all():
            raise ValueError(
                f"waypoint of {name} is {shown(action)}; want two finite numbers within [-1, 1], a Target or None"
            )
        here = self.perception.poses.pose_in_frame(row, row)[:2]
        x, y = here + np.clip(share, -1.0, 1.0) * self._half_side
        return Target(float(x), float(y))

    def carry_out(self, decoded: Ways, turn: Turn) -> None:
        """Give robots their targets and plan; an episode in which a robot should end takes one step only."""
        operating, modes = turn.operating, turn.modes
        give_ways(self.driver, decoded, turn)
        if self.router is not None:
            self.router(np.flatnonzero(turn.acting))
        running = modes == STEPS
        self.driver.prepare(np.flatnonzero(running))
        modes[running] = DECIDES
        for row in operating.stopping:
            if not turn.acting[row]:
                continue
            episode = row // self.settings.robots
            if running[episode]:
                modes[episode] = STEPS
                turn.commands[episode * self.settings.robots : (episode + 1) * self.settings.robots] = 0.0

    def observe(self, acted: Mask, live: Mask, seen: Mask, out: dict[str, NDArray[Any]], infos: dict[str, Any]) -> None:
        """Report the states of the robots' drives."""
        if acted.any():
            states = self.driver.states()[acted].tolist()
            add_info(infos, "drive", acted, [DRIVE_STATES[state] for state in states])
