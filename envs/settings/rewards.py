"""Weights of the reward."""

import math
from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class RewardSettings:
    """What a robot earns and pays.

    Attributes
    ----------
    area : float
        Per square metre of F that the team had not sensed, shared among the robots that sense it first
        [1/m2].
    time : float
        Price of a second [1/s].
    contact : float
        Price of a step in contact [1].
    energy : float
        Price of a metre driven [1/m].
    more : tuple of (str, float)
        Registered terms (`lidarium show rewards`) with their weights; a mapping is taken as well.
    """

    area: float = 1.0
    time: float = 0.01
    contact: float = 0.1
    energy: float = 0.01
    more: tuple[tuple[str, float], ...] = ()

    def __post_init__(self) -> None:
        for name in ("area", "time", "contact", "energy"):
            if not math.isfinite(getattr(self, name)):
                raise ValueError(
                    f"weight {name} of the reward is {getattr(self, name)}; want a finite number"
                )
        # Settings can be compared and hashed, so a mapping becomes pairs.
        if not isinstance(self.more, Mapping | tuple | list):
            raise ValueError(f"more of the reward is {self.more!r}; want a mapping of names to weights")
        pairs = self.more.items() if isinstance(self.more, Mapping) else self.more
        object.__setattr__(self, "more", tuple((str(name), weight) for name, weight in pairs))
        for name, weight in self.more:
            if isinstance(weight, bool) or not isinstance(weight, int | float) or not math.isfinite(weight):
                raise ValueError(f"weight {name} of the reward is {weight!r}; want a finite number")
