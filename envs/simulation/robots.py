"""The robots of the catalogue: bodies and drives.

Worlds know a robot as a disc with limits of its speeds. What its two wheels are is kept apart, in `WHEELS`: a robot's own software
turns speeds into wheel speeds with it, and odometry is made of what the encoders count.

References
----------
Pioneer P3-DX: data sheet of Adept MobileRobots. Kobuki: user guide of Yujin Robot.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Robot:
    """A differential-drive robot with a round body.

    Attributes
    ----------
    radius : float
        Radius of the body [m].
    height : float
        Height of the body [m]; solids and other robots' lasers below it meet the body.
    cruise_speed, max_speed : float
        Speed that its own driving keeps to, and the limit of the drive [m/s].
    max_turn_rate : float
        Limit of the turn rate [rad/s].
    max_acceleration, max_turn_acceleration : float
        Limits of the drive [m/s2, rad/s2].
    """

    radius: float = 0.18
    height: float = 0.52
    cruise_speed: float = 0.33
    max_speed: float = 0.77
    max_turn_rate: float = 3.14
    max_acceleration: float = 1.0
    max_turn_acceleration: float = 6.0

    def __post_init__(self) -> None:
        for name in ("radius", "height", "cruise_speed", "max_speed", "max_turn_rate", "max_acceleration", "max_turn_acceleration"):
            value = getattr(self, name)
            if not (0.0 < value < float("inf")):
                raise ValueError(f"{name} of the robot is {value}; want a number above 0")
        if self.cruise_speed > self.max_speed:
            raise ValueError(f"cruise_speed is {self.cruise_speed} m/s, above max_speed {self.max_speed} m/s")

    @property
    def numbers(self) -> NDArray[np.float64]:
        """What the kernels know of the body, shape (6,): radius, greatest speed, turn rate and their changes, height."""
        return np.array([self.radius, self.max_speed, self.max_turn_rate, self.max_acceleration, self.max_turn_acceleration, self.height])


@dataclass(frozen=True, slots=True, kw_only=True)
class Wheels:
    """The two driven wheels of a robot and the outline of its body.

    Attributes
    ----------
    radius : float
        Radius of a wheel [m].
    track : float
        Distance between the wheels [m].
    ticks_per_turn : float
        What an encoder counts in a turn of its wheel.
    length, width : float
        Footprint of the body [m].
    """

    radius: float
    track: float
    ticks_per_turn: float
    length: float
    width: float

    def __post_init__(self) -> None:
        for name in ("radius", "track", "ticks_per_turn", "length", "width"):
            value = getattr(self, name)
            if not (0.0 < value < float("inf")):
                raise ValueError(f"{name} of the wheels is {value}; want a number above 0")

    def speeds(self, left: float, right: float) -> tuple[float, float]:
        """Return speed [m/s] and turn rate [rad/s] of the body for turn rates of the wheels [rad/s]."""
        return self.radius * (right + left) / 2.0, self.radius * (right - left) / self.track

    def wheel_rates(self, speed: float, turn_rate: float) -> tuple[float, float]:
        """Return turn rates of the left and the right wheel [rad/s] for speed [m/s] and turn rate [rad/s] of the body."""
        middle, half = speed / self.radius, turn_rate * self.track / (2.0 * self.radius)
        return middle - half, middle + half


ROBOTS: dict[str, Robot] = {
    "kobuki": Robot(),
    "pioneer": Robot(
        radius=0.267, height=0.24, cruise_speed=0.5, max_speed=1.2, max_turn_rate=5.24, max_acceleration=0.8, max_turn_acceleration=3.0
    ),
    "service": Robot(
        radius=0.30, height=1.2, cruise_speed=0.5, max_speed=1.0, max_turn_rate=1.8, max_acceleration=0.6, max_turn_acceleration=2.0
    ),
    "point": Robot(
        radius=0.01, height=0.5, cruise_speed=1.0, max_speed=1.0, max_turn_rate=6.28, max_acceleration=100.0, max_turn_acceleration=600.0
    ),
}

WHEELS: dict[str, Wheels] = {
    "kobuki": Wheels(radius=0.035, track=0.230, ticks_per_turn=2578.33, length=0.352, width=0.352),
    "pioneer": Wheels(radius=0.0975, track=0.331, ticks_per_turn=500.0, length=0.455, width=0.381),
}
"""Wheels of the robots whose makers tell them, by the names of `ROBOTS`."""
