"""Orders that a robot takes and states that it reports."""

import math
from dataclasses import dataclass
from enum import Enum


class DriveState(Enum):
    """What a robot's driving is about."""

    IDLE = "idle"
    DRIVING = "driving"
    ARRIVED = "arrived"
    BLOCKED = "blocked"
    NO_PATH = "no_path"
    GIVING_WAY = "giving_way"


@dataclass(frozen=True, slots=True)
class Target:
    """Where a robot should drive to, in its map frame.

    Attributes
    ----------
    x, y : float
        Position [m].
    heading : float or None
        Heading to turn to at the end [rad]; None for any.
    """

    x: float
    y: float
    heading: float | None = None

    def __post_init__(self) -> None:
        if not (math.isfinite(self.x) and math.isfinite(self.y)):
            raise ValueError(f"target is ({self.x}, {self.y}); want finite metres")
        if self.heading is not None and not math.isfinite(self.heading):
            raise ValueError(f"heading of the target is {self.heading}; want a finite angle or None")
