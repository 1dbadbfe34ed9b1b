"""Settings of faults: at set times or at a rate."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from lidarium.mapping.geometry.bounds import Bounds, Rule, above, check_settings, shown, within

KINDS = ("", "laser_dropout", "blind_sector", "stuck_wheel", "kidnapping", "dead_robot", "dead_radio")
"""Kinds of faults by name, in the order of their numbers."""

Rate = Annotated[float, within(0.0, 1e6, "a number an hour")]
"""Mean rate of a fault of a robot [1/h]."""

LASTING = Bounds(0.0, 1e9, has_minimum=False, what="a time", never=True)
"""Bounds of the duration of a fault [s]."""

WIDTH = Rule(float, bounds=above(0.0, 2.0 * math.pi))
"""Bounds of the width of a blind sector [rad]."""

PLACE = Rule(float, bounds=within(-1e6, 1e6))
"""Rule for a number of a position [m, rad]."""

MOST_SCHEDULED = 10_000
"""Maximum number of faults of a schedule."""

MOST_DRAWN = 32
"""Maximum number of random faults of a robot in an episode."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """A fault of a robot.

    Attributes
    ----------
    kind : str
        ``laser_dropout`` (no beam is valid), ``blind_sector`` (some are not), ``stuck_wheel``, ``kidnapping``
        (the robot is put elsewhere), ``dead_robot`` or ``dead_radio``.
    robot : int
        Number of the robot, from 0.
    at_s : float
        When it begins [s].
    lasts_s : float or None
        Duration [s]; None (default) for permanent. A dead robot stays dead.
    bearing : float
        Middle of the blind sector against the heading [rad].
    width : float
        Width of the blind sector [rad].
    wheel : str
        Which wheel sticks: ``left`` or ``right``.
    place : (x, y, theta) or None
        Pose to which a kidnapped robot is moved, in the floor's frame [m, rad]; drawn if None.
    """

    kind: str
    robot: Annotated[int, within(0, 63)] = 0
    at_s: Annotated[float, within(0.0, 1e9)] = 0.0
    lasts_s: Annotated[float, LASTING] | None = None
    bearing: Annotated[float, within(-1000.0, 1000.0)] = 0.0
    width: float = math.radians(60.0)
    wheel: str = "left"
    place: tuple[float, float, float] | None = None

    def __post_init__(self) -> None:
        if self.kind not in KINDS[1:]:
            raise ValueError(f"kind of the fault is {self.kind!r}; want one of {', '.join(KINDS[1:])}")
        check_settings(self, "the fault")
        if not WIDTH.hold(self.width):
            raise ValueError(
                f"the blind sector is {self.width} rad wide at {self.bearing} rad; want a width above 0 and "
                "at most 2 pi"
            )
        if self.wheel not in ("left", "right"):
            raise ValueError(f"wheel of the fault is {self.wheel!r}; want left or right")
        if self.place is not None:
            object.__setattr__(self, "place", _place(self.place))


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultSettings:
    """Faults of a team.

    Attributes
    ----------
    schedule : tuple of Fault
        Faults at set times.
    laser_dropout : float, default 0.0
        Mean rate at which a robot's laser sees nothing for a while [1/h].
    blind_sector : float, default 0.0
        Mean rate at which a sector of a robot's laser goes blind [1/h].
    stuck_wheel : float, default 0.0
        Mean rate at which a wheel of a robot sticks [1/h].
    kidnapping : float, default 0.0
        Mean rate at which a robot is carried elsewhere [1/h].
    dead_robot : float, default 0.0
        Mean rate at which a robot stops for good [1/h].
    dead_radio : float, default 0.0
        Mean rate at which a robot's radio fails [1/h].
    lasts_s : float, default 3.0
        Mean duration of temporary faults [s].
    """

    schedule: tuple[Fault, ...] = ()
    laser_dropout: Rate = 0.0
    blind_sector: Rate = 0.0
    stuck_wheel: Rate = 0.0
    kidnapping: Rate = 0.0
    dead_robot: Rate = 0.0
    dead_radio: Rate = 0.0
    lasts_s: Annotated[float, above(0.0, 1e6)] = 3.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "schedule", _schedule(self.schedule))
        check_settings(self, "faults")

    @property
    def rates(self) -> tuple[float, ...]:
        """Return how often each kind of fault befalls a robot [1/h].

        The order is that of ``KINDS`` without the first.
        """
        return tuple(getattr(self, kind) for kind in KINDS[1:])

    @property
    def capacity(self) -> int:
        """Maximum number of faults of one robot in an episode."""
        robots = [fault.robot for fault in self.schedule]
        return max((robots.count(robot) for robot in robots), default=0) + (MOST_DRAWN if any(self.rates) else 0)


def _place(place: Any) -> tuple[float, float, float]:  # noqa: ANN401
    """Return the pose of a kidnapped robot, checked."""
    is_pose = isinstance(place, Sequence) and len(place) == 3
    if not is_pose or not all(PLACE.hold(value) for value in place):
        raise ValueError(
            f"place of the fault is {shown(place)}; want x, y [m] and theta [rad] within a million, or None"
        )
    return float(place[0]), float(place[1]), float(place[2])


def _schedule(faults: Any) -> tuple[Fault, ...]:  # noqa: ANN401
    """Return the faults of a schedule, checked; those of files are mappings."""
    wanted = f"want a list of faults, {MOST_SCHEDULED:,} at most"
    if not isinstance(faults, Sequence) or isinstance(faults, str) or len(faults) > MOST_SCHEDULED:
        raise ValueError(f"schedule of faults is {shown(faults)}; {wanted}")
    try:
        made = tuple(Fault(**fault) if isinstance(fault, Mapping) else fault for fault in faults)
    except TypeError as error:
        raise ValueError(f"schedule of faults has one that cannot be used: {error}") from error
    if not all(isinstance(fault, Fault) for fault in made):
        raise ValueError(f"schedule of faults is {shown(faults)}; {wanted}")
    return made


NO_FAULTS = FaultSettings()
"""No faults."""
