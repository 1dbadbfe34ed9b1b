"""What a robot remembers of its way: whether it gets on, and whether its laser measures."""

import math

import numpy as np

from lidarium.agents.srt.senses import Senses
from lidarium.envs.settings.lidar import Lidar
from lidarium.mapping.geometry.rigid import wrapped

PATIENCE_S = 3.0
"""Time without motion after which a driving robot is blocked [s].

The robot has neither moved nor turned for this long.
"""

MOVED, TURNED = 0.05, 0.1
"""What counts as having moved [m] and turned [rad]."""

BLIND_S = 10.0
"""A robot whose laser measures nothing for this long gives up [s]."""

SAME_PLACE = 0.5
"""Blocks nearer to each other than this are at one place [m]."""


class Progress:
    """What a robot remembers of how it got on."""

    def __init__(self) -> None:
        self._since, self._at = 0.0, np.zeros(3)
        self._blocked_at, self._blocks = np.full(2, math.inf), 0
        self._blind_since = -math.inf

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

    def waits_for_sight(self, senses: Senses, lidar: Lidar) -> bool:
        """Whether the laser measures nothing; until it does, the robot stands."""
        if not senses.is_blind(lidar):
            self._blind_since = -math.inf
            return False
        if self._blind_since < 0.0:
            self._blind_since = senses.time_s
        self.stand(senses)
        return True

    def is_blind(self, senses: Senses) -> bool:
        """Whether a robot that waits for sight has waited too long."""
        return senses.time_s - self._blind_since >= BLIND_S
