"""Weights of the reward."""

import math
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
    """

    area: float = 1.0
    time: float = 0.01
    contact: float = 0.1
    energy: float = 0.01

    def __post_init__(self) -> None:
        for name in ("area", "time", "contact", "energy"):
            if not math.isfinite(getattr(self, name)):
                raise ValueError(
                    f"weight {name} of the reward is {getattr(self, name)}; want a finite number"
                )
