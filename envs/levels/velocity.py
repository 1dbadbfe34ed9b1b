"""Decisions by speed and turn rate, for one step."""

import math
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lidarium.envs.levels.level import Level, Mask, Turn, check_rows, numbers_of
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


class VelocityLevel(Level):
    """An action is speed and turn rate as shares of the robot's limits."""

    observes: ClassVar[bool] = False

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

    def read(self, actions: Mapping[int, Any], names: list[str]) -> NDArray[np.float64]:
        """Return speeds and turn rates (rows, 2) [m/s, rad/s], zero for rows without an action."""
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

    def carry_out(self, decoded: NDArray[np.float64], turn: Turn) -> None:
        """Drive at the speeds."""
        turn.commands[:] = decoded
