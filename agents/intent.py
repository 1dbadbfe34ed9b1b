"""What a robot goes for, and how firmly."""

import math

import numpy as np
from numpy.typing import NDArray

KEPT = 1.0
"""What a robot goes for is left only for a tour that is shorter by this [m]."""

KEPT_NEAR = 0.5
"""What lies this near to what a robot goes for is still the same [m]."""

MOST_RETURNS = 10
"""More returns than these change nothing: no tour is shorter by a kilometre."""


class Intent:
    """What a robot goes for.

    Two targets may each seem the nearer one from where the robot is on its way to the other. It would turn
    between them for ever; with every time that it comes back to one that it had left, what it goes for is
    kept for twice the gain.

    Attributes
    ----------
    latest : (2,) float64 or None
        What it went for last [m].
    """

    def __init__(self) -> None:
        self.latest: NDArray[np.float64] | None = None
        self._left: list[NDArray[np.float64]] = []
        self._returns = 0

    @property
    def kept(self) -> float:
        """A tour has to be shorter by this for the robot to go for something else [m]."""
        return KEPT * 2.0 ** min(self._returns, MOST_RETURNS)

    def go_for(self, focus: NDArray[np.float64] | None) -> None:
        """Go for something, or for nothing."""
        if focus is not None and self.latest is not None and not _is_near(focus, self.latest):
            self._returns += any(_is_near(focus, left) for left in self._left)
            self._left.append(self.latest)
        self.latest = focus

    def settle(self) -> None:
        """Forget what was left before, as the robot has seen what it went for."""
        self._left.clear()
        self._returns = 0


def _is_near(first: NDArray[np.float64], second: NDArray[np.float64]) -> bool:
    return math.dist(first, second) < KEPT_NEAR
