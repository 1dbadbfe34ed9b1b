"""Faults of robots: at set times or at a rate, drawn by the episode's seed.

A world holds each robot's faults in a table that its kernels read in every step, so faults act in the midst of decisions that run in a
kernel, and without faults nothing is read.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels import Array, kernel

NO_FAULT, LASER_DROPOUT, BLIND_SECTOR, STUCK_WHEEL, KIDNAPPING, DEAD_ROBOT, DEAD_RADIO = range(7)
"""Kinds of faults by number."""

KINDS = ("", "laser_dropout", "blind_sector", "stuck_wheel", "kidnapping", "dead_robot", "dead_radio")
"""Kinds of faults by name, in the order of their numbers."""

FAULT_STREAM = 0x66617565
"""Sets the draws of faults apart from others of the same seed."""

FAULT_NUMBERS = 6
"""Numbers of a fault: kind, first step, step after the last, and what the kind needs."""

MOST_DRAWN = 32
"""Most faults that rates bring a robot in an episode."""

LONGEST_DRAWN_S = 24 * 3600.0
"""Faults are drawn for this long where an episode has no horizon [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """A fault of a robot.

    Attributes
    ----------
    kind : str
        ``laser_dropout`` (no beam is valid), ``blind_sector`` (some are not), ``stuck_wheel``, ``kidnapping`` (the robot is put elsewhere),
        ``dead_robot`` or ``dead_radio``.
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
            raise ValueError(f"the blind sector is {self.width} rad wide at {self.bearing} rad; want a width above 0 and at most 2 pi")
        if self.wheel not in ("left", "right"):
            raise ValueError(f"wheel of the fault is {self.wheel!r}; want left or right")
        if self.place is not None:
            place = tuple(float(value) for value in self.place)
            if len(place) != 3 or not all(math.isfinite(value) for value in place):
                raise ValueError(f"place of the fault is {self.place!r}; want x, y [m] and theta [rad], or None")
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
                raise ValueError(f"rate of {kind} is {getattr(self, kind)}; want a number an hour of 0 or more")
        if not 0.0 < self.lasts_s < math.inf:
            raise ValueError(f"lasts_s of faults is {self.lasts_s}; want more than 0 s")

    @property
    def rates(self) -> tuple[float, ...]:
        """How often each kind befalls a robot [1/h], in the order of ``KINDS`` without the first."""
        return tuple(getattr(self, kind) for kind in KINDS[1:])

    @property
    def capacity(self) -> int:
        """Most faults of one robot in an episode."""
        robots = [fault.robot for fault in self.schedule]
        return max((robots.count(robot) for robot in robots), default=0) + (MOST_DRAWN if any(self.rates) else 0)


def plan_faults(
    settings: FaultSettings, robots: int, seed: int, time_step: float, horizon_s: float | None, places: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the faults of a team in an episode, as kernels read them.

    Parameters
    ----------
    settings : FaultSettings
        What goes wrong.
    robots : int
        Size of the team; scheduled faults of robots beyond it are left out.
    seed : int
        Where what is not set is drawn from.
    time_step : float
        Length of a step [s].
    horizon_s : float or None
        How long the episode lasts at most [s].
    places : (places, 2) float64
        Where a kidnapped robot may be put [m]; needed where one may be.

    Returns
    -------
    (robots, capacity * 6) float64
        Kind, first step, step after the last, and what the kind needs, of each fault; kind 0 for none.
    """
    table = np.zeros((robots, settings.capacity, FAULT_NUMBERS))
    generator = np.random.default_rng([seed, FAULT_STREAM])
    longest = LONGEST_DRAWN_S if horizon_s is None else horizon_s
    for robot in range(robots):
        faults = [fault for fault in settings.schedule if fault.robot == robot] + _drawn(settings, robot, longest, generator)
        for k, fault in enumerate(faults[: settings.capacity]):
            table[robot, k, 0] = KINDS.index(fault.kind)
            table[robot, k, 1] = math.ceil(fault.at_s / time_step - 1e-9)
            is_for_ever = fault.lasts_s is None or fault.kind == "dead_robot"
            # What lasts less than a step lasts one.
            table[robot, k, 2] = math.inf if is_for_ever else fault.at_s / time_step + max((fault.lasts_s or 0.0) / time_step, 1.0)
            table[robot, k, 3:] = _needs(fault, generator, places)
    return table.reshape(robots, -1)


def _drawn(settings: FaultSettings, robot: int, longest: float, generator: np.random.Generator) -> list[Fault]:
    """Draw the faults that rates bring a robot, in the order of time."""
    faults: list[Fault] = []
    for kind, rate in zip(KINDS[1:], settings.rates, strict=True):
        time = 0.0
        while rate > 0.0 and len(faults) < 4 * MOST_DRAWN:
            time += generator.exponential(3600.0 / rate)
            if time > longest:
                break
            faults.append(
                Fault(
                    kind=kind, robot=robot, at_s=time, lasts_s=max(generator.exponential(settings.lasts_s), 1e-3),
                    bearing=generator.uniform(-math.pi, math.pi), wheel="left" if generator.random() < 0.5 else "right",
                )
            )  # fmt: skip
    return sorted(faults, key=lambda fault: fault.at_s)[:MOST_DRAWN]


def _needs(fault: Fault, generator: np.random.Generator, places: NDArray[np.float64]) -> tuple[float, float, float]:
    """Return the three numbers that a fault's kind needs."""
    if fault.kind == "blind_sector":
        return fault.bearing, fault.width, 0.0
    if fault.kind == "stuck_wheel":
        return (0.0 if fault.wheel == "left" else 1.0), 0.0, 0.0
    if fault.kind != "kidnapping":
        return 0.0, 0.0, 0.0
    if fault.place is not None:
        return fault.place
    x, y = places[int(generator.integers(len(places)))]
    return float(x), float(y), float(generator.uniform(-math.pi, math.pi))


NO_FAULTS = FaultSettings()
"""Nothing goes wrong."""


@kernel(inline=True, borrowing=True)
def _is_active(faults: Array, k: int, kind: int, step: int) -> bool:
    return bool(faults[k] == kind and faults[k + 1] <= step < faults[k + 2])


@kernel(borrowing=True)
def has_fault(faults: Array, kind: int, step: int) -> bool:
    """Whether a robot with ``faults`` (capacity * 6,) has one of a kind in a step."""
    for k in range(0, faults.shape[0], FAULT_NUMBERS):  # noqa: SIM110 (kernels know no any())
        if _is_active(faults, k, kind, step):
            return True
    return False


@kernel(borrowing=True)
def stick_wheels(faults: Array, step: int, wheel_base: float, command: Array) -> None:
    """Change a robot's speed and turn rate (2,) to what is left of them where a wheel does not turn."""
    for k in range(0, faults.shape[0], FAULT_NUMBERS):
        if _is_active(faults, k, STUCK_WHEEL, step):
            side = 0.5 * command[1] * wheel_base
            turning = command[0] - side if faults[k + 3] != 0.0 else command[0] + side
            command[0] = 0.5 * turning
            command[1] = (-turning if faults[k + 3] != 0.0 else turning) / wheel_base


@kernel(borrowing=True)
def kidnap(faults: Array, step: int, robot: int, bodies: Array, poses: Array) -> bool:
    """Put a robot elsewhere if it is time to and the place is free; where a teammate stands there it is put as soon as that has left."""
    for k in range(0, faults.shape[0], FAULT_NUMBERS):
        if faults[k] != KIDNAPPING or step < faults[k + 1]:
            continue
        is_free = True
        for other in range(poses.shape[0]):
            reach = bodies[robot, 0] + bodies[other, 0]
            gap_x, gap_y = faults[k + 3] - poses[other, 0], faults[k + 4] - poses[other, 1]
            is_free = is_free and (other == robot or gap_x * gap_x + gap_y * gap_y > reach * reach)
        if is_free:
            poses[robot, 0], poses[robot, 1], poses[robot, 2] = faults[k + 3], faults[k + 4], faults[k + 5]
            faults[k] = NO_FAULT
            return True
    return False


@kernel(borrowing=True)
def blind_beams(faults: Array, step: int, angle_first: float, increment: float, ranges: Array, lengths: Array) -> None:
    """Make beams invalid that a dropout, a blind sector or death takes away: ``ranges`` nan, ``lengths`` 0."""
    for k in range(0, faults.shape[0], FAULT_NUMBERS):
        is_out = _is_active(faults, k, LASER_DROPOUT, step) or _is_active(faults, k, DEAD_ROBOT, step)
        is_sector = _is_active(faults, k, BLIND_SECTOR, step)
        if not is_out and not is_sector:
            continue
        for beam in range(ranges.shape[0]):
            away = angle_first + beam * increment - faults[k + 3]
            away -= 2.0 * math.pi * math.floor((away + math.pi) / (2.0 * math.pi))
            if is_out or abs(away) <= 0.5 * faults[k + 4]:
                ranges[beam], lengths[beam] = np.float32(np.nan), 0.0
