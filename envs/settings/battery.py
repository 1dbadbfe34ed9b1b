"""Batteries: the energy that a robot uses for standing, driving and turning.

References
----------
Kobuki: lithium-ion battery of 2400 mAh at 14.8 V nominal, which lasts 4.5 h (user guide of Yujin Robot), so
7.9 W on average. How that divides is an assumption: 4.6 W for electronics and laser (the URG-04LX takes 2.5 W
by its data sheet), the rest for driving at 0.33 m/s.
"""

from dataclasses import dataclass
from typing import Annotated

from lidarium.mapping.geometry.bounds import above, check_settings, within
from lidarium.registry import Registry


@dataclass(frozen=True, slots=True, kw_only=True)
class Battery:
    """Capacity of a battery, and energy costs of the robot.

    Attributes
    ----------
    capacity_j : float or None
        Energy at the start [J]; None for no limit, in which case energy is not counted.
    idle_w : float
        Power of electronics and sensors, driving or not [W].
    per_metre_j : float
        Additional energy per metre of path [J/m].
    per_radian_j : float
        Energy per radian of turning [J/rad]. The default is the energy that moves the wheels of a Kobuki, 0.115 m off
        the middle, along their arcs.
    """

    capacity_j: Annotated[float, above(0.0, 1e12, "a number of joules")] | None = None
    idle_w: Annotated[float, within(0.0, 1e6)] = 4.6
    per_metre_j: Annotated[float, within(0.0, 1e6)] = 10.0
    per_radian_j: Annotated[float, within(0.0, 1e6)] = 1.15

    def __post_init__(self) -> None:
        check_settings(self, "the battery")

    @property
    def is_limited(self) -> bool:
        """Whether a robot can run out of energy."""
        return self.capacity_j is not None


BATTERIES: Registry[Battery] = Registry("battery")
"""Batteries by name."""

BATTERIES.register("none", Battery(), "no limit")
BATTERIES.register("kobuki", Battery(capacity_j=2.4 * 3600.0 * 14.8), "that of a Kobuki, 128 kJ")
