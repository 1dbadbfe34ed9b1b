"""The robots of the catalogue: bodies and drives.

References
----------
Pioneer P3-DX: data sheet of Adept MobileRobots. Kobuki: user guide of Yujin Robot.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.bounds import above, check_settings, shown, within
from lidarium.registry import Registry, unknown

Mass = Annotated[float, above(0.0, 1e4)]
"""A mass [kg]."""
Size = Annotated[float, above(0.0, 10.0)]
"""A length of a part [m]."""
Friction = Annotated[float, within(0.0, 10.0)]
"""A coefficient of friction."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Build:
    """Masses, wheels, casters and friction of a differential-drive robot.

    The body is a cylinder from ``clearance`` up to the robot's height, on two driven wheels and on casters in
    front and behind. Coefficients of friction are those against a ground of 1.

    Attributes
    ----------
    base_mass : float
        Mass of the robot without its wheels [kg].
    wheel_mass : float
        Mass of a driven wheel [kg].
    mass_height : float
        Height of the base's centre of mass above the ground [m].
    clearance : float
        Gap between the body and the ground [m].
    wheel_radius : float
        Radius of a driven wheel [m].
    wheel_width : float
        Width of a driven wheel [m].
    caster_radius : float
        Radius of a caster [m].
    caster_offset : float
        Distance of the casters from the middle of the robot [m].
    wheel_friction : float
        Friction of the driven wheels on the ground [1].
    caster_friction : float
        Friction of the casters on the ground [1].
    body_friction : float
        Friction between the body and objects that it touches [1].
    motor_torque : float
        Maximum torque of a wheel's motor [N m].
    """

    base_mass: Mass = 2.3
    wheel_mass: Mass = 0.1
    mass_height: Size = 0.06
    clearance: Size = 0.015
    wheel_radius: Size = 0.035
    wheel_width: Size = 0.021
    caster_radius: Size = 0.016
    caster_offset: Size = 0.115
    wheel_friction: Friction = 2.0
    caster_friction: Friction = 0.0
    body_friction: Friction = 0.1
    motor_torque: Annotated[float, above(0.0, 1e4)] = 0.4

    def __post_init__(self) -> None:
        check_settings(self, "the build")


@dataclass(frozen=True, slots=True, kw_only=True)
class Robot:
    """A differential-drive robot with a round body.

    Attributes
    ----------
    radius : float, default 0.18
        Radius of the body [m].
    height : float, default 0.52
        Height of the body [m]; solids and other robots' lasers below it meet the body.
    cruise_speed : float, default 0.33
        Speed that the onboard driver keeps to [m/s].
    max_speed : float, default 0.77
        Limit of the speed of the drive [m/s].
    max_turn_rate : float, default 3.14
        Limit of the turn rate [rad/s].
    max_acceleration : float, default 1.0
        Limit of the acceleration [m/s2].
    max_turn_acceleration : float, default 6.0
        Limit of the turn acceleration [rad/s2].
    wheel_base : float, default 0.23
        Distance between the driven wheels [m].
    ticks_per_metre : float, default 11724.0
        Ticks that the encoder of a wheel counts per metre [1/m].
    length : float, default 0.352
        Length of the body's outline [m].
    width : float, default 0.352
        Width of the body's outline [m].
    build : Build
        Masses, wheels, casters and friction; only worlds with forces know them.
    """

    radius: Annotated[float, above(0.0, 10.0)] = 0.18
    height: Annotated[float, above(0.0, 100.0)] = 0.52
    cruise_speed: Annotated[float, above(0.0, 50.0)] = 0.33
    max_speed: Annotated[float, above(0.0, 50.0)] = 0.77
    max_turn_rate: Annotated[float, above(0.0, 1000.0)] = 3.14
    max_acceleration: Annotated[float, above(0.0, 1e6)] = 1.0
    max_turn_acceleration: Annotated[float, above(0.0, 1e6)] = 6.0
    wheel_base: Annotated[float, above(0.0, 20.0)] = 0.23
    ticks_per_metre: Annotated[float, above(0.0, 1e7)] = 11724.0
    length: Annotated[float, above(0.0, 20.0)] = 0.352
    width: Annotated[float, above(0.0, 20.0)] = 0.352
    build: Build = field(default_factory=Build)

    def __post_init__(self) -> None:
        check_settings(self, "the robot")
        if not isinstance(self.build, Build):
            raise ValueError(f"build of the robot is {shown(self.build)}; want Build")
        if self.build.clearance >= self.height:
            raise ValueError(
                f"clearance of the build is {self.build.clearance} m; want less than the robot's height of "
                f"{self.height} m"
            )
        if self.cruise_speed > self.max_speed:
            raise ValueError(
                f"cruise_speed is {self.cruise_speed} m/s, above max_speed {self.max_speed} m/s; want at most that"
            )

    def wheel_speeds(self, speed: float, turn_rate: float) -> tuple[float, float]:
        """Return the speeds of the left and the right wheel [m/s].

        They belong to a speed [m/s] and turn rate [rad/s] of the body.
        """
        side = 0.5 * turn_rate * self.wheel_base
        return speed - side, speed + side

    def body_motion(self, left: float, right: float) -> tuple[float, float]:
        """Return speed [m/s] and turn rate [rad/s] of the body for wheel speeds [m/s]."""
        return 0.5 * (left + right), (right - left) / self.wheel_base

    @property
    def numbers(self) -> NDArray[np.float64]:
        """Numbers of the robot for the kernels, shape (8,).

        They are radius, greatest speed, greatest turn rate, their greatest changes, height, wheel
        base and ticks.
        """
        return np.array(
            [
                self.radius,
                self.max_speed,
                self.max_turn_rate,
                self.max_acceleration,
                self.max_turn_acceleration,
                self.height,
                self.wheel_base,
                self.ticks_per_metre,
            ]
        )


ROBOTS: Registry[Robot] = Registry("robot")
"""Robots by name."""

ROBOTS.register("kobuki", Robot(), "Yujin Kobuki, 0.35 m across, 0.77 m/s at most")
ROBOTS.register(
    "pioneer",
    Robot(
        radius=0.267,
        height=0.24,
        cruise_speed=0.5,
        max_speed=1.2,
        max_turn_rate=5.24,
        max_acceleration=0.8,
        max_turn_acceleration=3.0,
        wheel_base=0.331,
        ticks_per_metre=500 / (2 * math.pi * 0.0975),
        length=0.455,
        width=0.381,
        build=Build(
            base_mass=8.2,
            wheel_mass=0.4,
            mass_height=0.12,
            clearance=0.06,
            wheel_radius=0.0975,
            wheel_width=0.05,
            caster_radius=0.0375,
            caster_offset=0.2,
            motor_torque=4.0,
        ),
    ),
    "Adept MobileRobots Pioneer P3-DX, 1.2 m/s at most",
)
ROBOTS.register(
    "service",
    Robot(
        radius=0.30,
        height=1.2,
        cruise_speed=0.5,
        max_speed=1.0,
        max_turn_rate=1.8,
        max_acceleration=0.6,
        max_turn_acceleration=2.0,
        wheel_base=0.45,
        ticks_per_metre=4000.0,
        length=0.6,
        width=0.6,
        build=Build(
            base_mass=38.0,
            wheel_mass=1.0,
            mass_height=0.35,
            clearance=0.04,
            wheel_radius=0.08,
            wheel_width=0.04,
            caster_radius=0.03,
            caster_offset=0.24,
            motor_torque=12.0,
        ),
    ),
    "a tall service robot, 0.6 m across, 1.0 m/s at most",
)
ROBOTS.register(
    "point",
    Robot(
        radius=0.01,
        height=0.5,
        cruise_speed=1.0,
        max_speed=1.0,
        max_turn_rate=6.28,
        max_acceleration=100.0,
        max_turn_acceleration=600.0,
        wheel_base=0.02,
        ticks_per_metre=100000.0,
        length=0.02,
        width=0.02,
        build=Build(
            base_mass=0.2,
            wheel_mass=0.01,
            mass_height=0.004,
            clearance=0.003,
            wheel_radius=0.004,
            wheel_width=0.002,
            caster_radius=0.002,
            caster_offset=0.008,
            motor_torque=0.02,
        ),
    ),
    "almost a point that follows commands at once; for tests and bounds",
)

LARGEST = ("radius", "height", "length", "width")
"""Values for which a mixed team uses the maximum."""

SMALLEST = ("cruise_speed", "max_speed", "max_turn_rate", "max_acceleration", "max_turn_acceleration")
"""Values for which a mixed team uses the minimum."""


def kinds_of(names: Any) -> tuple[str, ...]:  # noqa: ANN401
    """Return names of robots as a tuple, checked."""
    if not isinstance(names, list | tuple):
        raise ValueError(f"kinds is {shown(names)}; want names of robots ({', '.join(ROBOTS)}) in a list")
    chosen = tuple(names)
    for name in chosen:
        if not isinstance(name, str) or name not in ROBOTS:
            raise ValueError(f"kinds has an {unknown('robot', name, ROBOTS)}")
    return chosen


def envelope_of(team: Sequence[Robot]) -> Robot:
    """Return a body with room for all of a team, with the limits of the slowest.

    Each robot can drive the paths planned for it.
    """
    largest = {name: max(getattr(robot, name) for robot in team) for name in LARGEST}
    smallest = {name: min(getattr(robot, name) for robot in team) for name in SMALLEST}
    return replace(team[0], **largest, **smallest)
