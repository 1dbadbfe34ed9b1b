"""Faults of robots: at set times or at a rate, drawn by the episode's seed.

A world holds each robot's faults in a table that its kernels read in every step, so faults act in the midst
of decisions that run in a kernel, and without faults nothing is read.
"""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.settings.faults import KINDS, MOST_DRAWN, Fault, FaultSettings
from lidarium.envs.simulation.disturbances.odometry import (
    MAX_ACCELERATION,
    MAX_SPEED,
    MAX_TURN_ACCELERATION,
    MAX_TURN_RATE,
    RADIUS,
    WHEEL_BASE,
)
from lidarium.mapping.kernels.compilation import Array, kernel

NO_FAULT, LASER_DROPOUT, BLIND_SECTOR, STUCK_WHEEL, KIDNAPPING, DEAD_ROBOT, DEAD_RADIO = range(7)
"""Kinds of faults by number."""

FAULT_STREAM = 0x66617565
"""Sets the draws of faults apart from others of the same seed."""

KIND, FIRST_STEP, END_STEP, WHEEL = range(4)
"""Places of a fault's numbers: its kind, its first step, the step after its last, the wheel that is stuck."""

BEARING, WIDTH = 3, 4
"""Places of a blind sector's numbers, after the steps [rad]."""

PLACE_X, PLACE_Y, PLACE_THETA = 3, 4, 5
"""Places of a kidnapping's numbers, after the steps [m, rad]."""

FAULT_NUMBERS = 6
"""Numbers of a fault: kind, first step, end step and parameters.

The end step is the one after the last; the parameters depend on the kind.
"""

LONGEST_DRAWN_S = 24 * 3600.0
"""Time for which faults are drawn if an episode has no horizon [s]."""


def plan_faults(
    settings: FaultSettings,
    robots: int,
    seed: int,
    time_step: float,
    horizon_s: float | None,
    places: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the faults of a team in an episode, as kernels read them.

    Parameters
    ----------
    time_step : float
        Length of a step [s].
    horizon_s : float or None
        Maximum duration of the episode [s].
    places : (places, 2) float64
        Positions to which a robot may be kidnapped [m]; required if kidnapping is possible.

    Returns
    -------
    (robots, capacity * 6) float64
        Kind, first step, step after the last, and the parameters of each fault; kind 0 for no fault.
    """
    table = np.zeros((robots, settings.capacity, FAULT_NUMBERS))
    generator = np.random.default_rng([seed, FAULT_STREAM])
    longest = LONGEST_DRAWN_S if horizon_s is None else horizon_s
    for robot in range(robots):
        faults = [fault for fault in settings.schedule if fault.robot == robot] + _drawn(
            settings, robot, longest, generator
        )
        for k, fault in enumerate(faults[: settings.capacity]):
            table[robot, k, KIND] = KINDS.index(fault.kind)
            table[robot, k, FIRST_STEP] = math.ceil(fault.at_s / time_step - 1e-9)
            is_for_ever = fault.lasts_s is None or fault.kind == "dead_robot"
            # A fault shorter than a step lasts one step.
            table[robot, k, END_STEP] = (
                math.inf if is_for_ever else fault.at_s / time_step + max((fault.lasts_s or 0.0) / time_step, 1.0)
            )
            table[robot, k, WHEEL:] = _needs(fault, generator, places)
    return table.reshape(robots, -1)


def _drawn(settings: FaultSettings, robot: int, longest: float, generator: np.random.Generator) -> list[Fault]:
    """Draw the faults that rates bring a robot, in the order of time."""
    faults: list[Fault] = []
    for kind, rate in zip(KINDS[1:], settings.rates, strict=True):
        time, before = 0.0, len(faults)
        while rate > 0.0 and len(faults) - before < 4 * MOST_DRAWN:
            time += generator.exponential(3600.0 / rate)
            if time > longest:
                break
            faults.append(
                Fault(
                    kind=kind,
                    robot=robot,
                    at_s=time,
                    lasts_s=max(generator.exponential(settings.lasts_s), 1e-3),
                    bearing=generator.uniform(-math.pi, math.pi),
                    wheel="left" if generator.random() < 0.5 else "right",
                )
            )
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


@kernel(forceinline=True, nrt=False)
def _is_active(faults: Array, k: int, kind: int, step: int) -> bool:
    return bool(faults[k + KIND] == kind and faults[k + FIRST_STEP] <= step < faults[k + END_STEP])


@kernel(nrt=False)
def has_fault(faults: Array, kind: int, step: int) -> bool:
    """Whether a robot with ``faults`` (capacity * 6,) has one of a kind in a step."""
    for k in range(0, faults.shape[0], FAULT_NUMBERS):
        if _is_active(faults, k, kind, step):
            return True
    return False


@kernel(nrt=False)
def stick_wheels(faults: Array, step: int, body: Array, duration: float, velocity: Array, command: Array) -> None:
    """Reduce a robot's speed and turn rate (2,) if a wheel does not turn.

    What remains of ``velocity`` and ``command`` is the motion of the other wheel, and within a step of ``duration`` [s]
    the drive can get from one to the other.
    """
    base = body[WHEEL_BASE]
    for k in range(0, faults.shape[0], FAULT_NUMBERS):
        if _is_active(faults, k, STUCK_WHEEL, step):
            side = -1.0 if faults[k + WHEEL] != 0.0 else 1.0
            now = velocity[0] + side * 0.5 * base * velocity[1]
            fastest = min(2.0 * body[MAX_SPEED], base * body[MAX_TURN_RATE])
            gain = min(2.0 * body[MAX_ACCELERATION], base * body[MAX_TURN_ACCELERATION]) * duration
            now = min(max(now, -fastest), fastest)
            wanted = min(max(command[0] + side * 0.5 * base * command[1], -fastest), fastest)
            wanted = now + min(max(wanted - now, -gain), gain)
            velocity[0], velocity[1] = 0.5 * now, side * now / base
            command[0], command[1] = 0.5 * wanted, side * wanted / base


@kernel(nrt=False)
def kidnap(faults: Array, step: int, robot: int, bodies: Array, poses: Array) -> bool:
    """Put a robot elsewhere if it is time to and the place is free.

    If a teammate is at that position, the robot is put there as soon as the teammate has left.
    """
    for k in range(0, faults.shape[0], FAULT_NUMBERS):
        if faults[k + KIND] != KIDNAPPING or step < faults[k + FIRST_STEP]:
            continue
        is_free = True
        for other in range(poses.shape[0]):
            reach = bodies[robot, RADIUS] + bodies[other, RADIUS]
            gap_x, gap_y = faults[k + PLACE_X] - poses[other, 0], faults[k + PLACE_Y] - poses[other, 1]
            is_free = is_free and (other == robot or gap_x * gap_x + gap_y * gap_y > reach * reach)
        if is_free:
            for axis in range(3):
                poses[robot, axis] = faults[k + PLACE_X + axis]
            faults[k + KIND] = NO_FAULT
            return True
    return False


@kernel(nrt=False)
def blind_beams(faults: Array, step: int, angle_first: float, increment: float, ranges: Array, lengths: Array) -> None:
    """Make beams invalid that a fault takes away: ``ranges`` nan, ``lengths`` 0.

    The fault is a dropout, a blind sector or death.
    """
    for k in range(0, faults.shape[0], FAULT_NUMBERS):
        is_out = _is_active(faults, k, LASER_DROPOUT, step) or _is_active(faults, k, DEAD_ROBOT, step)
        is_sector = _is_active(faults, k, BLIND_SECTOR, step)
        if not is_out and not is_sector:
            continue
        for beam in range(ranges.shape[0]):
            away = angle_first + beam * increment - faults[k + BEARING]
            away -= 2.0 * math.pi * math.floor((away + math.pi) / (2.0 * math.pi))
            if is_out or abs(away) <= 0.5 * faults[k + WIDTH]:
                ranges[beam], lengths[beam] = np.float32(np.nan), 0.0
