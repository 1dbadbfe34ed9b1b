"""What a backend of the simulation is: it moves bodies and senses, for arrays over (episodes, robots).

Perception is not its business: it hands out what the sensors say, and the truth for the scorer.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Sensed:
    """What one step brings, for ``rows`` = episodes x robots, row = episode * robots + robot.

    Attributes
    ----------
    ranges : (rows, beams) float32
        Ranges [m]; inf for no return, nan for an invalid beam.
    odometry : (rows, 2) float64
        Speed and turn rate as the wheels tell [m/s, rad/s].
    bumper : (rows, 3) int8
        Left, centre, right; 1 where pressed.
    contacts : (rows,) uint8
        Whether the body touched anything.
    true_pose : (rows, 3) float64
        x, y, theta in the floor's frame [m, rad].
    """

    ranges: NDArray[np.float32]
    odometry: NDArray[np.float64]
    bumper: NDArray[np.int8]
    contacts: NDArray[np.uint8]
    true_pose: NDArray[np.float64]


class Backend(Protocol):
    """A world that moves robots and senses for them."""

    def move_and_sense(self, commands: NDArray[np.float64], step: int) -> Sensed:
        """Drive all robots for one time step by ``commands`` (rows, 2) [m/s, rad/s] and take their scans."""
        ...
