"""Actions for all rows of a batch.

They are speeds, waypoints, or the choice of a frontier.
"""

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lidarium.envs.batch.running import DECIDES, STEPS
from lidarium.envs.driving.drives import DRIVE_STATES, Drives, Following, no_drives
from lidarium.envs.driving.safety_stop import FORESIGHT_TIMES
from lidarium.envs.driving.team_driver import TeamDriver
from lidarium.envs.levels.frontier_offers import REASONS, FrontierOffers
from lidarium.envs.levels.frontiers import frontier_boxes
from lidarium.envs.observation_spaces import action_space
from lidarium.envs.onboard.perception import Perception
from lidarium.envs.outcome.endings import FRONTIER_UNREACHABLE, NO_FRONTIER
from lidarium.envs.radio.messages import Orders
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.limits import check_level
from lidarium.envs.shares import scale_shares

Rows = NDArray[np.bool_]
"""Which rows are meant, (rows,)."""


class Level(Protocol):
    """How actions become motion.

    Attributes
    ----------
    action_space : Space
        Of one robot.
    boxes : dict
        Spaces of what the level adds to an observation.
    drives, following : Drives, Following
        What the kernel follows in a decision.
    """

    action_space: spaces.Space[Any]
    boxes: dict[str, spaces.Space[Any]]
    drives: Drives
    following: Following

    def start(self, episode: int) -> None:
        """Begin an episode."""
        ...

    def take(
        self, actions: NDArray[Any], live: Rows, commands: NDArray[np.float64], modes: NDArray[np.int8]
    ) -> NDArray[np.int8] | None:
        """Take the actions of live rows.

        Write ``commands`` or orders, and in ``modes`` how the episodes run.

        Returns
        -------
        (rows,) int8 or None
            Why robots end of themselves, by number in ``endings.REASONS``; None where nobody does.
        """
        ...

    def observe(
        self, acted: Rows, live: Rows, seen: Rows, out: dict[str, NDArray[Any]], infos: dict[str, Any]
    ) -> None:
        """Write what the level adds to observations and infos.

        It is called after the episodes have run.

        Parameters
        ----------
        acted, live, seen : (rows,) bool
            Who took part in a step, who of those that are seen has not ended, and whose observations are
            written: of all that acted or began again.
        out : dict of arrays
            Where observations are written.
        infos : dict
            Added to.
        """
        ...


def check_actions(actions: NDArray[Any], shape: tuple[int, ...], live: Rows, wanted: str) -> NDArray[Any]:
    """Return actions as an array of a shape, finite for live rows.

    Raises
    ------
    ValueError
        Where these are not numbers, the shape is another, or a live row's action is not finite.
    """
    try:
        array = np.asarray(actions)
    except ValueError as error:  # rows of different lengths
        raise ValueError(f"actions are {actions!r}; want an array {shape}: {wanted} for each row") from error
    if array.shape != shape:
        raise ValueError(
            f"actions have shape {array.shape}; want {shape}: {wanted} for each row, row = episode * robots "
            "+ robot"
        )
    if array.dtype.kind not in "biuf":
        raise ValueError(f"actions are of type {array.dtype}; want {wanted} for each row")
    is_finite = np.isfinite(array)
    if is_finite.all():
        return array
    bad = np.flatnonzero(live & ~is_finite.reshape(len(array), -1).all(axis=1))
    if len(bad):
        raise ValueError(f"the action of row {bad[0]} is {array[bad[0]]}, nan or infinite; want {wanted}")
    return array


class VelocityLevel:
    """An action is speed and turn rate, as shares of the robot's limits."""

    boxes: dict[str, spaces.Space[Any]] = {}  # noqa: RUF012

    def __init__(self, settings: ExplorationSettings) -> None:
        self.action_space: spaces.Space[Any] = action_space()
        self._limits = settings.speed_limits.ravel()
        self.drives = no_drives(1)
        self.following = Following(
            settings.lidar.unit_vectors,
            np.zeros(1),
            np.zeros(4),
            False,
            np.zeros((1, 1), np.uint8),
            np.zeros((1, 3)),
            np.zeros(1, np.uint8),
            FORESIGHT_TIMES,
        )

    def start(self, episode: int) -> None:
        """Begin an episode."""

    def take(
        self, actions: NDArray[Any], live: Rows, commands: NDArray[np.float64], modes: NDArray[np.int8]
    ) -> None:
        """Scale the shares; no robot ends of itself."""
        shares = check_actions(actions, commands.shape, live, "two finite numbers within [-1, 1]")
        np.copyto(commands, shares)
        if not live.all():
            commands[~live] = 0.0
        scale_shares(commands, self._limits)

    def observe(
        self, acted: Rows, live: Rows, seen: Rows, out: dict[str, NDArray[Any]], infos: dict[str, Any]
    ) -> None:
        """Add nothing."""


class WaypointLevel:
    """An action is a point within the observed map, as for ``WaypointExploration``."""

    boxes: dict[str, spaces.Space[Any]] = {}  # noqa: RUF012

    def __init__(self, perception: Perception, settings: ExplorationSettings) -> None:
        self.action_space: spaces.Space[Any] = action_space()
        self._perception = perception
        self._half_side = 0.5 * settings.map_cells * settings.occupancy.resolution
        self.driver = TeamDriver(perception, settings)
        self.drives, self.following = self.driver.drives, self.driver.following

    def start(self, episode: int) -> None:
        """Begin an episode: no robot has a target."""
        self.driver.start(episode)

    def take(
        self, actions: NDArray[Any], live: Rows, commands: NDArray[np.float64], modes: NDArray[np.int8]
    ) -> None:
        """Give the robots their targets and plan."""
        shares = check_actions(actions, commands.shape, live, "two finite numbers within [-1, 1]").astype(
            np.float64
        )
        places = self._perception.beliefs.believed[:, :2] - self._perception.offsets
        targets = places + np.clip(shares, -1.0, 1.0) * self._half_side
        self.carry_out(Orders(live, targets, np.full(len(live), np.nan)), live, modes)

    def carry_out(self, orders: Orders, live: Rows, modes: NDArray[np.int8]) -> None:
        """Let the episodes that step drive by orders for a decision."""
        self.driver.assign(live, orders)
        self.driver.prepare(np.flatnonzero(modes == STEPS))
        modes[modes == STEPS] = DECIDES

    def observe(
        self, acted: Rows, live: Rows, seen: Rows, out: dict[str, NDArray[Any]], infos: dict[str, Any]
    ) -> None:
        """Tell what the robots' driving is about."""
        _add_info(infos, "drive", acted, self.driver.states(), lambda number: DRIVE_STATES[number])


class FrontierLevel:
    """An action is the number of a frontier, as for ``FrontierExploration``."""

    def __init__(self, perception: Perception, settings: ExplorationSettings) -> None:
        self._most = settings.frontiers
        self.action_space: spaces.Space[Any] = spaces.Discrete(self._most + 1)
        self.boxes = frontier_boxes(settings)
        self._waypoints = WaypointLevel(perception, settings)
        self._offers = FrontierOffers(perception, settings, self._waypoints.driver)
        self._robots = settings.robots
        self.drives, self.following = self._waypoints.drives, self._waypoints.following

    def start(self, episode: int) -> None:
        """Begin an episode: nothing is offered."""
        self._waypoints.start(episode)
        self._offers.start(episode)

    def take(
        self, actions: NDArray[Any], live: Rows, commands: NDArray[np.float64], modes: NDArray[np.int8]
    ) -> NDArray[np.int8]:
        """Take the choices; where no robot of an episode is offered any frontier, all end."""
        most = self._most
        wanted = f"a whole number from 0 to {most}"
        numbers = check_actions(actions, (len(live),), live, wanted)
        is_bad = live & ((numbers < 0) | (numbers > most) | (numbers != np.floor(numbers)))
        if is_bad.any():
            bad = int(np.flatnonzero(is_bad)[0])
            raise ValueError(f"the action of row {bad} is {numbers[bad]}; want {wanted}, {most} to stay")
        orders = self._offers.choose(live, np.where(live, numbers, most).astype(np.int64))
        has_work = (live & (self._offers.offers.counts > 0)).reshape(-1, self._robots).any(axis=1)
        is_idle = (modes == STEPS) & ~has_work
        stopping = np.zeros(len(live), np.int8)
        for row in np.flatnonzero(live & np.repeat(is_idle, self._robots)):
            is_known = self._offers.why_without_work(int(row)) == "no_frontier"
            stopping[row] = NO_FRONTIER if is_known else FRONTIER_UNREACHABLE
        self._waypoints.carry_out(orders, live, modes)
        # A team without work stands for one last step.
        modes[is_idle] = STEPS
        commands[np.repeat(is_idle, self._robots)] = 0.0
        return stopping

    def observe(
        self, acted: Rows, live: Rows, seen: Rows, out: dict[str, NDArray[Any]], infos: dict[str, Any]
    ) -> None:
        """Give up what was chosen in vain, offer again, and report both."""
        reasons = self._offers.renew(live, seen)
        for name, array in self._offers.observed.items():
            out[name][seen] = array[seen]
        self._waypoints.observe(acted, live, seen, out, infos)
        _add_info(
            infos,
            "given_up",
            reasons != 0,
            np.arange(len(reasons)),
            lambda row: (self._offers.target(row), REASONS[reasons[row]]),
        )


def _add_info(
    infos: dict[str, Any], name: str, rows: Rows, values: NDArray[Any], describe: Callable[[int], Any]
) -> None:
    """Add an info for some rows, with its mask.

    The mask is the one that Gymnasium's vector environments put beside it.
    """
    if rows.any():
        described = np.full(len(rows), None, object)
        for row in np.flatnonzero(rows):
            described[row] = describe(int(values[row]))
        infos[name], infos[f"_{name}"] = described, rows.copy()


def make_level(name: str, perception: Perception, settings: ExplorationSettings) -> Level:
    """Return a level by its name.

    Raises
    ------
    ValueError
        Where the level is unknown.
    """
    check_level(settings.observe, name)
    if name == "velocity":
        return VelocityLevel(settings)
    if name == "waypoint":
        return WaypointLevel(perception, settings)
    if name == "frontier":
        return FrontierLevel(perception, settings)
    raise ValueError(f"level is {name!r}; want velocity, waypoint or frontier")
