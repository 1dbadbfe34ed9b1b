"""The safety stop: limits the speed so that a robot can stop before an obstacle ahead.

Returns of the laser are obstacles in the swath of the body. Teammates whose poses are known are met with half
the room, because they brake as well; of two robots whose paths cross, the one with the higher number lets the
other pass. Near a person in sight a robot slows down, the more the nearer, in whatever direction the person is.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.simulation.kernels.arrays import PERSON_GAP, YIELDED
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.views import scratch_grid

STANDSTILL = 0.006
"""Gap to a return at which a robot stops [m]."""

TEAMMATE_GAP = 0.03
"""Gap that robots keep to each other [m]."""

LEAST_TEAMMATE_GAP = 0.004
"""Gap that the lower-numbered robot keeps in passing [m].

It applies to two robots that are closer than the usual gap.
"""

SIDE_GAP = 0.0003
"""Extra width of the swath that must be clear of returns, each side [m].

The swath is this much wider than the body.
"""

YIELD_M = 0.8
"""Gap to a person below which a robot slows down [m]."""

YIELD_PER_M, CREEP = 0.6, 0.12
"""Speed near a person per metre of the gap, and minimum [1/s, m/s]."""

BACKING_GAP = 0.3
"""Gap to a person below which a robot does not back [m]."""

FORESIGHT_TIMES = np.array([0.0, 0.4, 0.8])
"""Times at which the robot with the higher number predicts the other's position [s]."""

CRUISE, TURN_LIMIT, BRAKING, TIME_STEP = range(4)
"""Places in ``Bodies.limits``."""


class Sensed(NamedTuple):
    """Current state of the robots of a team for the safety stop.

    Attributes
    ----------
    poses, velocities : (robots, 3), (robots, 2) float64
        Believed poses and velocities [m, rad, m/s, rad/s].
    ranges : (robots, beams) float32
        Scans [m].
    scanned : (robots, 3) float64
        Believed poses at which these were taken [m, rad].
    contact, heard : (robots, robots) uint8, (robots, robots * 3) float64
        If not all teammates' poses are known: from which robots each heard lately, and their poses then [m, rad].
    safety : (robots, 11) float64
        Gap to the nearest person in sight, and time lost by yielding (``kernels.arrays``).
    """

    poses: NDArray[np.float64]
    velocities: NDArray[np.float64]
    ranges: NDArray[np.float32]
    scanned: NDArray[np.float64]
    contact: NDArray[np.uint8]
    heard: NDArray[np.float64]
    safety: NDArray[np.float64]


class Bodies(NamedTuple):
    """Bodies and limits of the robots of a team.

    Attributes
    ----------
    unit_vectors : (robots, 2, beams) float64
        Directions of the beams of each robot.
    radii : (robots,) float64
        Radius of the bodies [m].
    limits : (4,) float64
        Cruise speed, greatest turn rate, braking and length of a step [m/s, rad/s, m/s2, s].
    knows_teammates : bool
        Whether teammates' poses are known (and comparable).
    present : (robots,) uint8
        Which robots are bodies to keep clear of.
    foresight : (K,) float64
        Times at which the other is predicted, the first 0 [s].
    """

    unit_vectors: NDArray[np.float64]
    radii: NDArray[np.float64]
    limits: NDArray[np.float64]
    knows_teammates: bool
    present: NDArray[np.uint8]
    foresight: NDArray[np.float64]


@kernel(nrt=False)
def _gap_in_scan(ranges: Array, unit_vectors: Array, radius: float, scanned: Array, pose: Array) -> float:
    """Distance that the disc can move straight ahead before it meets a return [m].

    It moves from ``pose``; the scan was taken at ``scanned``.
    """
    gap = np.inf
    # 1, 0, 0 and 0 for a scan that was taken here, which changes no bit of a return.
    cosine, sine = math.cos(scanned[2] - pose[2]), math.sin(scanned[2] - pose[2])
    along_x, along_y = scanned[0] - pose[0], scanned[1] - pose[1]
    ahead = along_x * math.cos(pose[2]) + along_y * math.sin(pose[2])
    aside = along_y * math.cos(pose[2]) - along_x * math.sin(pose[2])
    for beam in range(ranges.shape[0]):
        distance = ranges[beam]
        if not distance < np.inf:
            continue
        left = distance * unit_vectors[1, beam]
        front = distance * unit_vectors[0, beam]
        y = sine * front + cosine * left + aside
        x = cosine * front - sine * left + ahead
        if x > 0.0 and -radius < y < radius:
            gap = min(gap, x - math.sqrt(radius * radius - y * y))
    return gap


@kernel(nrt=False)
def _gap_to_teammates(robot: int, poses: Array, velocities: Array, bodies: Bodies, present: Array) -> float:
    """Return how far the disc can go straight to a known teammate [m].

    The teammate counts at its current or its predicted position.
    """
    gap, radii, foresight = np.inf, bodies.radii, bodies.foresight
    cosine, sine = math.cos(poses[robot, 2]), math.sin(poses[robot, 2])
    for other in range(poses.shape[0]):
        if other == robot or present[other] == 0:
            continue
        for k in range(foresight.shape[0]):
            if k > 0 and other > robot:
                break
            reach = radii[robot] + radii[other] + TEAMMATE_GAP
            drift = velocities[other, 0] * foresight[k]
            gap_x = poses[other, 0] + drift * math.cos(poses[other, 2]) - poses[robot, 0]
            gap_y = poses[other, 1] + drift * math.sin(poses[other, 2]) - poses[robot, 1]
            x, y = cosine * gap_x + sine * gap_y, cosine * gap_y - sine * gap_x
            if x * x + y * y <= reach * reach:
                # Closer than robots should be: the one with the lower number may pass without touching; otherwise
                # they separate.
                touching = radii[robot] + radii[other] + LEAST_TEAMMATE_GAP
                if x > 0.0 and (robot > other or -touching < y < touching):
                    gap = 0.0
            elif x > 0.0 and -reach < y < reach:
                gap = min(gap, x - math.sqrt(reach * reach - y * y))
    return gap


@kernel(forceinline=True, nrt=False)
def _hears_any(contact: Array, robot: int) -> bool:
    """Whether a robot heard of any teammate lately."""
    heard = 0
    for other in range(contact.shape[1]):
        heard += contact[robot, other]
    return heard > 0


@kernel(nrt=False)
def _gap_to_heard(robot: int, sensed: Sensed, bodies: Bodies) -> float:
    """Return how far the disc can go straight to a teammate heard of [m].

    The teammate is assumed to stay at its last position.
    """
    robots = sensed.poses.shape[0]
    known, still = scratch_grid(robots, 3, np.float64), scratch_grid(robots, 2, np.float64)
    for other in range(robots):
        still[other, 0] = still[other, 1] = 0.0
        for axis in range(3):
            known[other, axis] = sensed.heard[robot, 3 * other + axis]
    for axis in range(3):
        known[robot, axis] = sensed.poses[robot, axis]
    gap: float = _gap_to_teammates(robot, known, still, bodies, sensed.contact[robot])
    return gap


@kernel(forceinline=True, nrt=False)
def yielding_speed(safety: Array, wanted: float, speed: float) -> float:
    """Return the speed near people of a robot that wants one and may drive at ``speed`` [m/s]; note the time lost.

    ``safety`` is the robot's row. Nobody looks behind: a robot does not back near a person.
    """
    gap = safety[PERSON_GAP]
    if speed < 0.0:
        return 0.0 if gap < BACKING_GAP else speed
    if gap < YIELD_M:
        speed = min(speed, max(YIELD_PER_M * gap, CREEP))
        if wanted > 0.0:
            safety[YIELDED] += 1.0 - min(speed / wanted, 1.0)
    return speed


@kernel(forceinline=True, nrt=False)
def safe_speed(sensed: Sensed, bodies: Bodies, robot: int) -> float:
    """Return the speed that still stops before returns and teammates [m/s] (kernel).

    Teammates brake as well.
    """
    braking, time_step = bodies.limits[BRAKING], bodies.limits[TIME_STEP]
    own, speed = bodies.radii[robot] + SIDE_GAP, sensed.velocities[robot, 0]
    ranges, scanned, pose = sensed.ranges[robot], sensed.scanned[robot], sensed.poses[robot]
    gap = _gap_in_scan(ranges, bodies.unit_vectors[robot], own, scanned, pose)
    allowed = math.sqrt(2.0 * braking * max(gap - STANDSTILL - 0.5 * time_step * speed, 0.0))
    if bodies.knows_teammates:
        teammate_gap = _gap_to_teammates(robot, sensed.poses, sensed.velocities, bodies, bodies.present)
        allowed = min(allowed, math.sqrt(braking * max(teammate_gap - time_step * speed, 0.0)))
    elif _hears_any(sensed.contact, robot):
        teammate_gap = _gap_to_heard(robot, sensed, bodies)
        allowed = min(allowed, math.sqrt(braking * max(teammate_gap - time_step * speed, 0.0)))
    return allowed
