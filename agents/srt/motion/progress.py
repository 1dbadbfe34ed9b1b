"""What a robot remembers of its way: what it goes for, and whether it gets on."""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.srt.senses import Senses
from lidarium.mapping.geometry.rigid import wrapped

PATIENCE_S = 3.0
"""Time without motion after which a driving robot is blocked [s].

The robot has neither moved nor turned for this long.
"""

MOVED, TURNED = 0.05, 0.1
"""What counts as having moved [m] and turned [rad]."""

SAME_PLACE = 0.5
"""Blocks nearer to each other than this are at one place [m]."""


class Progress:
    """What a robot remembers of how it got on."""

    def __init__(self) -> None:
        self._since, self._at = 0.0, np.zeros(3)
        self._blocked_at, self._blocks = np.full(2, math.inf), 0

    def stand(self, senses: Senses) -> None:
        """Count from now on: the robot is not expected to have moved before."""
        self._since, self._at = senses.time_s, senses.pose

    def is_stuck(self, senses: Senses) -> bool:
        """Whether the robot has not got on for a while."""
        gap = senses.pose - self._at
        if math.hypot(gap[0], gap[1]) > MOVED or abs(wrapped(float(gap[2]))) > TURNED:
            self.stand(senses)
        return senses.time_s - self._since > PATIENCE_S

    def note_block(self, senses: Senses) -> int:
        """Note that the robot is blocked where it is.

        Returns how often in a row it was blocked there, 1 the first time.
        """
        self._blocks = self._blocks + 1 if senses.distance_to(self._blocked_at) < SAME_PLACE else 1
        self._blocked_at = senses.pose[:2]
        return self._blocks


KEPT = 1.0
"""What a robot goes for is left only for a tour that is shorter by this [m]."""

KEPT_NEAR = 0.5
"""What lies this near to what a robot goes for is still the same [m]."""


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
        return KEPT * 2.0**self._returns

    def go_for(self, focus: NDArray[np.float64] | None) -> None:
        """Go for something, or for nothing."""
        if focus is not None and self.latest is not None and not _is_near(focus, self.latest):
            self._returns += any(_is_near(focus, left) for left in self._left)
            self._left.append(self.latest)
        self.latest = focus

    def settle(self) -> None:
        """Have come to it, or have seen it through: what was left before counts no more."""
        self._left.clear()
        self._returns = 0


def _is_near(first: NDArray[np.float64], second: NDArray[np.float64]) -> bool:
    return math.dist(first, second) < KEPT_NEAR
