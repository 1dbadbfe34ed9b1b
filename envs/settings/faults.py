"""Settings of faults: at set times or at a rate."""

import math
from dataclasses import dataclass

KINDS = ("", "laser_dropout", "blind_sector", "stuck_wheel", "kidnapping", "dead_robot", "dead_radio")
"""Kinds of faults by name, in the order of their numbers."""

MOST_DRAWN = 32
"""Most faults that rates bring a robot in an episode."""


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
        How long it lasts [s], None for ever; a robot that is dead stays so.
    bearing, width : float
        Middle and width of the blind sector against the heading [rad].
    wheel : str
        Which wheel sticks: ``left`` or ``right``.
    place : (x, y, theta) or None
        Where a kidnapped robot is put, in the floor's frame [m, rad]; drawn where None.
    """

    kind: str
    robot: int = 0
    at_s: float = 0.0
    lasts_s: float | None = None
    bearing: float = 0.0
    width: float = math.radians(60.0)
    wheel: str = "left"
    place: tuple[float, float, float] | None = None

    def __post_init__(self) -> None:
        if self.kind not in KINDS[1:]:
            raise ValueError(f"kind of the fault is {self.kind!r}; want one of {', '.join(KINDS[1:])}")
        if isinstance(self.robot, bool) or not isinstance(self.robot, int) or self.robot < 0:
            raise ValueError(f"robot of the fault is {self.robot!r}; want the number of a robot, from 0")
        if not (math.isfinite(self.at_s) and self.at_s >= 0.0):
            raise ValueError(f"at_s of the fault is {self.at_s}; want a time of 0 s or more")
        if self.lasts_s is not None and not self.lasts_s > 0.0:
            raise ValueError(f"lasts_s of the fault is {self.lasts_s}; want more than 0 s, or None for ever")
        if not (math.isfinite(self.bearing) and 0.0 < self.width <= 2.0 * math.pi):
            raise ValueError(
                f"the blind sector is {self.width} rad wide at {self.bearing} rad; want a width above 0 and "
                "at most 2 pi"
            )
        if self.wheel not in ("left", "right"):
            raise ValueError(f"wheel of the fault is {self.wheel!r}; want left or right")
        if self.place is not None:
            place = tuple(float(value) for value in self.place)
            if len(place) != 3 or not all(math.isfinite(value) for value in place):
                raise ValueError(
                    f"place of the fault is {self.place!r}; want x, y [m] and theta [rad], or None"
                )
            object.__setattr__(self, "place", place)


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultSettings:
    """What goes wrong with a team.

    Attributes
    ----------
    schedule : tuple of Fault
        Faults at set times.
    laser_dropout, blind_sector, stuck_wheel, kidnapping, dead_robot, dead_radio : float
        How often each kind befalls a robot, on average [1/h].
    lasts_s : float
        How long those that pass by last, on average [s].
    """

    schedule: tuple[Fault, ...] = ()
    laser_dropout: float = 0.0
    blind_sector: float = 0.0
    stuck_wheel: float = 0.0
    kidnapping: float = 0.0
    dead_robot: float = 0.0
    dead_radio: float = 0.0
    lasts_s: float = 3.0

    def __post_init__(self) -> None:
        faults = tuple(Fault(**fault) if isinstance(fault, dict) else fault for fault in self.schedule)
        if not all(isinstance(fault, Fault) for fault in faults):
            raise ValueError(f"schedule of faults is {self.schedule!r}; want faults")
        object.__setattr__(self, "schedule", faults)
        for kind in KINDS[1:]:
            if not 0.0 <= getattr(self, kind) < math.inf:
                raise ValueError(
                    f"rate of {kind} is {getattr(self, kind)}; want a number an hour of 0 or more"
                )
        if not 0.0 < self.lasts_s < math.inf:
            raise ValueError(f"lasts_s of faults is {self.lasts_s}; want more than 0 s")

    @property
    def rates(self) -> tuple[float, ...]:
        """Return how often each kind of fault befalls a robot [1/h].

        The order is that of ``KINDS`` without the first.
        """
        return tuple(getattr(self, kind) for kind in KINDS[1:])

    @property
    def capacity(self) -> int:
        """Most faults of one robot in an episode."""
        robots = [fault.robot for fault in self.schedule]
        return max((robots.count(robot) for robot in robots), default=0) + (
            MOST_DRAWN if any(self.rates) else 0
        )


NO_FAULTS = FaultSettings()
"""Nothing goes wrong."""
