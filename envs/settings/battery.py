"""Batteries: what a robot uses of its energy by standing, driving and turning.

References
----------
Kobuki: lithium-ion battery of 2400 mAh at 14.8 V nominal, which lasts 4.5 h (user guide of Yujin Robot), so
7.9 W on average. How that divides is an assumption: 4.6 W for electronics and laser (the URG-04LX takes 2.5 W
by its data sheet), the rest for driving at 0.33 m/s.
"""

import math
from dataclasses import dataclass

from lidarium.registry import Registry


@dataclass(frozen=True, slots=True, kw_only=True)
class Battery:
    """What a robot can use, and what its work costs.

    Attributes
    ----------
    capacity_j : float or None
        What it holds at the beginning [J]; None for no limit, where nothing is reckoned.
    idle_w : float
        What electronics and sensors take, whatever the robot does [W].
    per_metre_j : float
        What a metre of way costs beside it [J/m].
    per_radian_j : float
        What a radian of turning costs [J/rad]. By default what it costs to move the wheels of a Kobuki, 0.115
        m off the middle, so far.
    """

    capacity_j: float | None = None
    idle_w: float = 4.6
    per_metre_j: float = 10.0
    per_radian_j: float = 1.15

    def __post_init__(self) -> None:
        if self.capacity_j is not None and not 0.0 < self.capacity_j < math.inf:
            raise ValueError(
                f"capacity_j of the battery is {self.capacity_j}; want a number of joules above 0, or None "
                "for no limit"
            )
        for name in ("idle_w", "per_metre_j", "per_radian_j"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise ValueError(
                    f"{name} of the battery is {getattr(self, name)}; want a number of 0 or more"
                )

    @property
    def is_limited(self) -> bool:
        """Whether a robot can run out of energy."""
        return self.capacity_j is not None


BATTERIES: Registry[Battery] = Registry("battery")
"""Batteries by name."""

BATTERIES.register("none", Battery(), "no limit")
BATTERIES.register("kobuki", Battery(capacity_j=2.4 * 3600.0 * 14.8), "that of a Kobuki, 128 kJ")
