"""Robots as URDF text: a cylinder on two driven wheels and two casters.

The frame of a robot lies on the ground between its wheels. Wheels touch the ground in one point each, as
spheres do: a wheel with width would turn about an unknown point.
"""

import math

from lidarium.envs.settings.robots import Robot

LEFT, RIGHT = 0, 1
"""Joints of the driven wheels."""

CASTER_GAP = 5e-4
"""Gap between the casters and the ground if a robot is upright, so that wheels carry it [m]."""

_CASTER_MASS = 1e-3

Numbers = tuple[float, ...]


def urdf_of(robot: Robot) -> str:
    """Return a robot as the text of a URDF file."""
    build = robot.build
    height = robot.height - build.clearance
    middle = build.clearance + 0.5 * height
    lying = build.base_mass * (3.0 * robot.radius**2 + height**2) / 12.0
    upright = build.base_mass * robot.radius**2 / 2.0
    body = _shape(f'<cylinder radius="{robot.radius}" length="{height}"/>', (0.0, 0.0, middle))
    place = (0.0, 0.0, build.mass_height)
    parts = [_link("base", build.base_mass, (lying, lying, upright), build.body_friction, body, place)]
    side = 0.5 * robot.wheel_base
    for name, y in (("left", side), ("right", -side)):
        parts += [_wheel(robot, name), _joint(name, "continuous", (0.0, y, build.wheel_radius))]
    ball = f'<sphere radius="{build.caster_radius}"/>'
    casters = [
        _shape(ball, (x, 0.0, build.caster_radius + CASTER_GAP)) for x in (build.caster_offset, -build.caster_offset)
    ]
    inertia = (_CASTER_MASS * build.caster_offset**2,) * 3
    parts.append(_link("casters", _CASTER_MASS, inertia, build.caster_friction, "".join(casters)))
    parts.append(_joint("casters", "fixed", (0.0, 0.0, 0.0)))
    line = "\n"
    return f'<robot name="robot">{line.join(parts)}</robot>'


def _wheel(robot: Robot, name: str) -> str:
    build = robot.build
    around = build.wheel_mass * build.wheel_radius**2 / 2.0
    across = build.wheel_mass * (3.0 * build.wheel_radius**2 + build.wheel_width**2) / 12.0
    ball = _shape(f'<sphere radius="{build.wheel_radius}"/>', (0.0, 0.0, 0.0))
    return _link(name, build.wheel_mass, (across, around, across), build.wheel_friction, ball)


def _link(
    name: str,
    mass: float,
    inertia: Numbers,
    friction: float,
    shapes: str,
    place: Numbers = (0.0, 0.0, 0.0),
) -> str:
    """Return a link with its centre of mass at a position of its frame [m]."""
    along = " ".join(f'{axis}="{value!r}"' for axis, value in zip(("ixx", "iyy", "izz"), inertia, strict=True))
    return (
        f'<link name="{name}"><contact><lateral_friction value="{friction!r}"/></contact>'
        f'<inertial><origin xyz="{_numbers(place)}"/><mass value="{mass!r}"/>'
        f'<inertia {along} ixy="0" ixz="0" iyz="0"/></inertial>{shapes}</link>'
    )


def _shape(geometry: str, place: Numbers) -> str:
    return f'<collision><origin xyz="{_numbers(place)}"/><geometry>{geometry}</geometry></collision>'


def _joint(name: str, kind: str, place: Numbers) -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="base"/><child link="{name}"/>'
        f'<origin xyz="{_numbers(place)}"/><axis xyz="0 1 0"/></joint>'
    )


def _numbers(values: Numbers) -> str:
    if not all(map(math.isfinite, values)):
        raise ValueError(f"{values} are no places")
    return " ".join(map(repr, values))
