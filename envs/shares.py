"""Actions as shares of what a robot can do, turned into speeds."""

import math

from lidarium.mapping.kernels.compilation import Array, kernel


@kernel
def scale_shares(commands: Array, limits: Array) -> bool:
    """Turn shares within [-1, 1] into speeds and turn rates.

    Limits are those of each robot of a team, one after the other (robots * 2,); commands are of one team or
    of many. False where one is nan or infinite.
    """
    for robot in range(commands.shape[0]):
        for axis in range(2):
            share = commands[robot, axis]
            if not math.isfinite(share):
                return False
            commands[robot, axis] = min(max(share, -1.0), 1.0) * limits[(2 * robot + axis) % limits.shape[0]]
    return True
