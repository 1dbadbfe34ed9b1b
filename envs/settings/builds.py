"""How robots are built: what a world with forces has to know of them beside their outlines."""

from dataclasses import dataclass
from typing import Annotated

from lidarium.mapping.geometry.bounds import above, check_settings, within

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
    wheel_radius, wheel_width : float
        Radius and width of a driven wheel [m].
    caster_radius : float
        Radius of a caster [m].
    caster_offset : float
        Distance of the casters from the middle of the robot [m].
    wheel_friction, caster_friction : float
        Friction of the wheels and of the casters on the ground [1].
    body_friction : float
        Friction of the body on what it touches [1].
    motor_torque : float
        Greatest torque of a wheel's motor [N m].
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
