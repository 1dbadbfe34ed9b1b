"""The target of a robot, and how firmly it is kept."""

import math

import numpy as np
from numpy.typing import NDArray

KEPT = 1.0
"""A robot's goal is left only for a tour that is shorter by this [m]."""

KEPT_NEAR = 0.5
"""Goals this near to a robot's goal are the same [m]."""

MAX_RETURNS = 10
"""More returns than these change nothing: no tour is shorter by a kilometre."""


class Intent:
    """The target of a robot.

    Two targets may each seem the nearer one from where the robot is on its way to the other. It would turn
    between them for ever; with every time that it comes back to one that it had left, what it goes for is
    kept for twice the gain.

    Attributes
    ----------
    latest : (2,) float64 or None
        Its last target [m].
    """

    def __init__(self) -> None:
        self.latest: NDArray[np.float64] | None = None
        self._left: list[NDArray[np.float64]] = []
        self._returns = 0

    @property
    def kept(self) -> float:
        """A tour has to be shorter by this for the robot to go for something else [m]."""
        return KEPT * 2.0 ** min(self._returns, MAX_RETURNS)

    def go_for(self, focus: NDArray[np.float64] | None) -> None:
        """Go for something, or for nothing."""
        if focus is not None and self.latest is not None and not _is_near(focus, self.latest):
            self._returns += any(_is_near(focus, left) for left in self._left)
            self._left.append(self.latest)
        self.latest = focus

    def settle(self) -> None:
        """Forget the targets left before, since the robot has seen its target."""
        self._left.clear()
        self._returns = 0


def _is_near(first: NDArray[np.float64], second: NDArray[np.float64]) -> bool:
    return math.dist(first, second) < KEPT_NEAR
