"""The turns of a robot on the spot, to scan all around or a frontier."""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.srt.senses import Senses
from lidarium.envs.settings.lidar import Lidar
from lidarium.mapping.geometry.rigid import wrapped

MOST_TURNS = 8
"""A laser that would need more turns than this does not turn around."""

TURN_GAIN = 2.0
"""Turn rate by the error of the heading [1/s]."""


class TurnPlan:
    """The headings to which a robot still has to turn.

    Attributes
    ----------
    focus : (2,) float64 or None
        The frontier that the robot turns to, or turned to last [m].
    """

    def __init__(self) -> None:
        self._headings: list[float] = []
        self.focus: NDArray[np.float64] | None = None

    @property
    def is_over(self) -> bool:
        """Whether no turn is left."""
        return not self._headings

    def plan_circle(self, senses: Senses, lidar: Lidar) -> None:
        """Plan the turns after which the robot has seen the whole circle."""
        field = lidar.field_of_view
        turns = math.ceil(2.0 * math.pi / field - 1e-9) - 1
        if lidar.beams == 1 or turns > MOST_TURNS:
            return
        heading = float(senses.pose[2])
        self._headings = [
            wrapped(heading + (2.0 * math.pi - field) * (turn + 1) / turns) for turn in range(turns)
        ]

    def plan_frontier(self, focus: NDArray[np.float64], senses: Senses) -> None:
        """Plan the turn to a frontier that is not seen through from where the robot came for it."""
        gap = focus - senses.pose[:2]
        self._headings, self.focus = [math.atan2(gap[1], gap[0])], focus

    def error(self, senses: Senses) -> float:
        """Return by how much the robot has to turn to its next heading [rad]."""
        return wrapped(self._headings[0] - float(senses.pose[2]))

    def end_turn(self) -> None:
        """Note that the robot has turned to the next heading."""
        self._headings.pop(0)
