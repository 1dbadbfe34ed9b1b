"""Decisions by speed and turn rate, for one step; robots with targets are driven there."""

import math
from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lidarium.envs.levels.level import STEPS, Level, Mask, Turn, check_rows, numbers_of
from lidarium.envs.levels.waypoint import Ways, give_ways, is_way, read_ways
from lidarium.envs.onboard.driving.path_following import IDLE
from lidarium.envs.onboard.driving.team_driver import TeamDriver
from lidarium.envs.onboard.perception import Perception
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.mapping.geometry.bounds import shown
from lidarium.mapping.kernels.compilation import Array, kernel


@kernel
def _scale_shares(commands: Array, limits: Array) -> bool:
    """Turn shares within [-1, 1] into speeds and turn rates.

    Limits are those of each robot of a team, (robots * 2,); commands are of one team or of many. False if one is nan
    or infinite.
    """
    for robot in range(commands.shape[0]):
        for axis in range(2):
            share = commands[robot, axis]
            if not math.isfinite(share):
                return False
            commands[robot, axis] = min(max(share, -1.0), 1.0) * limits[(2 * robot + axis) % limits.shape[0]]
    return True


class _Mixed(NamedTuple):
    """Speeds of some robots, and targets of the others.

    Attributes
    ----------
    commands : (rows, 2) float64
        Speeds and turn rates [m/s, rad/s].
    has_speeds : (rows,) bool
        Robots that are given speeds.
    ways : Ways
        Targets and routes of the others.
    """

    commands: NDArray[np.float64]
    has_speeds: Mask
    ways: Ways


class VelocityLevel(Level):
    """An action is speed and turn rate as shares of the robot's limits.

    A ``Target`` or ``Route`` is an action as well, so that policies of waypoints drive robots among those that are
    driven by speeds: the onboard driver then takes the robot there, step by step, until it is given another action.
    From the first target on, None lets a robot stay and give way, and orders of a station to drive are taken.

    Attributes
    ----------
    driver : TeamDriver or None
        Drives robots to targets; None before the first target.
    """

    observes: ClassVar[bool] = False
    carries = frozenset({"waypoint"})

    def __init__(
        self,
        perception: Perception,
        settings: ExplorationSettings,
        shares_map: bool = True,
        decision_period_s: float | None = None,
    ) -> None:
        super().__init__(perception, settings, shares_map, decision_period_s)
        self.action_space = spaces.Box(-1.0, 1.0, (2,), np.float32)
        self._limits = settings.speed_limits.ravel()
        self._shares_map = shares_map
        self._plan_steps = max(round(settings.decision_period_s / settings.time_step), 1)
        self._steps_left = np.zeros(self.rows // settings.robots, np.int64)
        self._has_targets = np.zeros(self.rows // settings.robots, np.bool_)

    def start(self, episode: int) -> None:
        """Begin an episode: no robot has a target."""
        self._steps_left[episode], self._has_targets[episode] = 0, False
        if self.driver is not None:
            self.driver.start(episode)

    def may_rest(self, episode: int) -> bool:
        """Whether None is an action: since the first target of the episode."""
        return bool(self._has_targets[episode])

    def read(self, actions: Mapping[int, Any], names: list[str]) -> NDArray[np.float64] | _Mixed:
        """Return speeds and turn rates (rows, 2) [m/s, rad/s], zero for rows without an action, and targets."""
        for action in actions.values():
            if not isinstance(action, np.ndarray) and is_way(action):
                break
        else:
            return self._speeds(actions, names)
        ways = {row: action for row, action in actions.items() if is_way(action)}
        speeds = {row: action for row, action in actions.items() if row not in ways}
        has_speeds = np.zeros(self.rows, np.bool_)
        has_speeds[list(speeds)] = True
        return _Mixed(self._speeds(speeds, names), has_speeds, read_ways(ways, self.rows))

    def _speeds(self, actions: Mapping[int, Any], names: list[str]) -> NDArray[np.float64]:
        if not self.reads_rows_as(VelocityLevel):
            speeds: NDArray[np.float64] = super().read(actions, names)
            return speeds
        commands = np.zeros((self.rows, 2))
        for row, action in actions.items():
            shares = action if isinstance(action, np.ndarray) else numbers_of(action)
            if shares.shape != (2,) or shares.dtype.kind not in "iuf":
                raise ValueError(
                    f"action of {names[row % len(names)]} is {shown(action)}; want two numbers within "
                    "[-1, 1]: shares of speed and turn rate"
                )
            commands[row] = shares
        if not _scale_shares(commands, self._limits):
            given = {names[row % len(names)]: action for row, action in actions.items()}
            raise ValueError(
                f"an action is nan or infinite ({given}); want two finite numbers within [-1, 1] for each agent"
            )
        return commands

    def read_rows(self, actions: Any, live: Mask) -> NDArray[np.float64]:  # noqa: ANN401
        """Return speeds and turn rates (rows, 2) [m/s, rad/s], zero for rows that are not live."""
        shares = check_rows(actions, (self.rows, 2), live, "two finite numbers within [-1, 1]")
        commands = np.array(shares, np.float64)
        if not live.all():
            commands[~live] = 0.0
        _scale_shares(commands, self._limits)
        return commands

    def carry_out(self, decoded: NDArray[np.float64] | _Mixed, turn: Turn) -> None:
        """Drive at the speeds, or along paths to the targets."""
        if not isinstance(decoded, _Mixed):
            if self.driver is None:
                turn.commands[:] = decoded
                return
            decoded = _Mixed(decoded, turn.given, read_ways({}, self.rows))
        driver = self.driver
        if driver is None:
            driver = self.make_driver()
            turn.operating.attach(driver)
        give_ways(driver, decoded.ways, turn)
        # Paths are planned as often as at the level of waypoints: at new targets, and once in a decision period.
        drives, left = driver.drives, self._steps_left
        self._has_targets |= drives.is_ordered.reshape(len(left), -1).any(axis=1)
        is_new = drives.is_ordered & ~drives.has_path & (drives.states == IDLE)
        left[is_new.reshape(len(left), -1).any(axis=1)] = 0
        is_due = (turn.modes == STEPS) & (left <= 0)
        left -= 1
        left[is_due] = self._plan_steps - 1
        driver.prepare(np.flatnonzero(is_due))
        turn.commands[:] = np.where((turn.given & decoded.has_speeds)[:, None], decoded.commands, driver.commands())
        robots = self.settings.robots
        turn.commands[[row for row in turn.operating.stopping if self._has_targets[row // robots]]] = 0.0

    def make_driver(self) -> TeamDriver:
        """Return a driver for robots with targets, from now on the driver of the level."""
        self.driver = driver = TeamDriver(self.perception, self.settings, self._shares_map)
        for episode in range(self.perception.world.episodes):
            driver.start(episode)
        return driver
