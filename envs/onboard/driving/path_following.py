"""Path following for all robots of a team in one kernel call.

A robot turns on the spot towards the next piece of its path and drives along the piece's line, never faster
than the safety stop allows.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.onboard.driving.safety_stop import (
    BRAKING,
    CRUISE,
    TIME_STEP,
    TURN_LIMIT,
    Bodies,
    Sensed,
    safe_speed,
    yielding_speed,
)
from lidarium.envs.onboard.radio.messages import MOST_POINTS
from lidarium.mapping.kernels.compilation import Array, kernel

IDLE, DRIVING, ARRIVED, BLOCKED = range(4)
"""States of a drive."""

MAX_POINTS = MOST_POINTS
"""Maximum number of points of a path."""

LEAST_LOOKAHEAD, MOST_LOOKAHEAD = 0.08, 0.25
"""Distance ahead on its line at which a robot aims [m].

The first holds in tight passages, the second in open space.
"""

LOOKAHEAD_PER_ROOM = 2.0
"""Additional look-ahead distance per room around the body [m/m]."""

TURN_GAIN = 3.0
"""Turn rate per radian of heading error [1/s]."""

TURN_IN_A_STEP = 0.5
"""Maximum share of a heading error that a robot corrects in one step."""

PASSING_PER_ROOM, LEAST_PASSING, MOST_PASSING = 0.5, 0.015, 0.12
"""Distance at which a point of a path counts as passed.

Per room around the body [m/m], minimum and maximum [m].
"""

TOLERANCE_PER_ROOM, LEAST_TOLERANCE, MOST_TOLERANCE = 2.0, 0.01, 0.6
"""Heading error with which a robot drives.

Per room around the body [rad/m], minimum and maximum [rad].
"""

SLOWING = 0.7
"""Share of its speed that a robot gives up at its largest heading error [1]."""

LEAST_BEND = 0.2
"""A robot drives through all bends below this, the more slowly the sharper [rad]."""

LEAST_PIECE = 1e-9
"""Shorter pieces of a path have no direction [m]."""

LEAST_SPEED_AT_END = 0.02
"""Speed with which a robot comes up to the end of its path at least [m/s]."""

STANDING_SPEED = 0.01
"""A slower robot counts as standing [m/s]."""

ROUNDING_S = 1e-9
"""Times that differ by less than this are the same [s]."""

ARRIVAL = 0.03
"""Distance at which the end of a path counts as reached [m]."""

FACING = 0.1
"""Heading error at which a wanted final heading counts as reached [rad]."""

BACKING_SPEED = 0.05
"""A robot that a wall blocks backs out along its path at this speed [m/s]."""

BLOCKED_S = 1.0
"""A robot that wants to drive and has stood for this long is blocked [s]."""

PUSHING_S = 10.0
"""A robot that drives and has not moved for this long is blocked [s]; most that push for a moment slide free."""


class Courses(NamedTuple):
    """The paths that the robots of a team follow.

    Attributes
    ----------
    paths, margins : (robots, points, 2), (robots, points) float64
        Points x, y [m], and the room around the body on the piece that leads to each [m].
    counts, places : (robots,) int64
        Number of points, and the point that each robot drives to now.
    headings : (robots,) float64
        Wanted heading at the end [rad], nan for any.
    states, stood : (robots,) int64
        State of the drive, and steps for which the robot has stood although it wanted to drive; below 0 if it was told
        to drive and pushes against something that its laser does not see.
    backing : (robots,) int64
        Steps for which the robot still backs out.
    """

    paths: NDArray[np.float64]
    margins: NDArray[np.float64]
    counts: NDArray[np.int64]
    places: NDArray[np.int64]
    headings: NDArray[np.float64]
    states: NDArray[np.int64]
    stood: NDArray[np.int64]
    backing: NDArray[np.int64]


@kernel(forceinline=True, nrt=False)
def _wrap(angle: float) -> float:
    return angle - 2.0 * math.pi * math.floor((angle + math.pi) / (2.0 * math.pi))


@kernel(nrt=False)
def follow_paths(sensed: Sensed, courses: Courses, bodies: Bodies, commands: Array) -> None:
    """Give each robot the speed and turn rate that follow its path (kernel).

    Parameters
    ----------
    commands : (robots, 2) float64
        Result: speed and turn rate [m/s, rad/s].
    """
    for robot in range(sensed.poses.shape[0]):
        commands[robot, 0] = commands[robot, 1] = 0.0
        if courses.states[robot] != DRIVING and courses.states[robot] != BLOCKED:
            courses.stood[robot] = courses.backing[robot] = 0
        elif courses.backing[robot] > 0:
            courses.backing[robot] -= 1
            commands[robot, 0] = yielding_speed(sensed.safety[robot], -BACKING_SPEED, -BACKING_SPEED)
        else:
            _pass_points(sensed, courses, robot)
            if _is_at_end(sensed, courses, robot):
                commands[robot, 1] = _turn_at_end(sensed, courses, bodies, robot)
            else:
                _drive_on(sensed, courses, bodies, robot, commands)


@kernel(forceinline=True, nrt=False)
def _drive_on(sensed: Sensed, courses: Courses, bodies: Bodies, robot: int, commands: Array) -> None:
    """Turn a robot to the next piece of its path, and drive if it faces it."""
    aim_x, aim_y = _aim(sensed, courses, robot)
    x, y, heading = sensed.poses[robot, 0], sensed.poses[robot, 1], sensed.poses[robot, 2]
    error = _wrap(math.atan2(aim_y - y, aim_x - x) - heading)
    margin = courses.margins[robot, courses.places[robot]]
    tolerance = min(max(LEAST_TOLERANCE + TOLERANCE_PER_ROOM * margin, LEAST_TOLERANCE), MOST_TOLERANCE)
    commands[robot, 1] = _turn_rate(error, bodies.limits)
    if abs(error) > tolerance:
        return
    speed = bodies.limits[CRUISE] * (1.0 - SLOWING * abs(error) / tolerance)
    speed = min(speed, _speed_to_next(sensed, courses, bodies.limits, robot, tolerance))
    speed = yielding_speed(sensed.safety[robot], speed, min(speed, safe_speed(sensed, bodies, robot)))
    commands[robot, 0] = speed
    if speed < STANDING_SPEED:
        courses.stood[robot] = max(courses.stood[robot], 0) + 1
    else:
        is_pushing = abs(sensed.velocities[robot, 0]) < STANDING_SPEED
        courses.stood[robot] = min(courses.stood[robot], 0) - 1 if is_pushing else 0
        courses.states[robot] = DRIVING
    longest = BLOCKED_S if courses.stood[robot] >= 0 else PUSHING_S
    if abs(courses.stood[robot]) * bodies.limits[TIME_STEP] >= longest - ROUNDING_S:
        courses.states[robot] = BLOCKED


@kernel(forceinline=True, nrt=False)
def _turn_rate(error: float, limits: Array) -> float:
    """Return the turn rate that makes up for a heading error [rad/s]."""
    gain, limit = min(TURN_GAIN, TURN_IN_A_STEP / limits[TIME_STEP]), limits[TURN_LIMIT]
    return float(min(max(gain * error, -limit), limit))


@kernel(forceinline=True, nrt=False)
def _pass_points(sensed: Sensed, courses: Courses, robot: int) -> None:
    """Let a robot drive to the first point of its path that it has not passed."""
    x, y = sensed.poses[robot, 0], sensed.poses[robot, 1]
    paths, place = courses.paths, courses.places[robot]
    while place < courses.counts[robot] - 1:
        room = courses.margins[robot, place]
        passing = min(max(PASSING_PER_ROOM * room, LEAST_PASSING), MOST_PASSING)
        if math.hypot(paths[robot, place, 0] - x, paths[robot, place, 1] - y) > passing:
            break
        place += 1
    courses.places[robot] = place


@kernel(forceinline=True, nrt=False)
def _remaining(sensed: Sensed, courses: Courses, robot: int) -> float:
    """Return the distance to the point that a robot drives to [m]."""
    place, x, y = courses.places[robot], sensed.poses[robot, 0], sensed.poses[robot, 1]
    return math.hypot(courses.paths[robot, place, 0] - x, courses.paths[robot, place, 1] - y)


@kernel(forceinline=True, nrt=False)
def _is_at_end(sensed: Sensed, courses: Courses, robot: int) -> bool:
    """Whether a robot is at the end of its path."""
    is_last = courses.places[robot] == courses.counts[robot] - 1
    return bool(is_last and _remaining(sensed, courses, robot) <= ARRIVAL)


@kernel(forceinline=True, nrt=False)
def _turn_at_end(sensed: Sensed, courses: Courses, bodies: Bodies, robot: int) -> float:
    """Return the turn rate towards the wanted heading; note when it is reached."""
    wanted = courses.headings[robot]
    error = _wrap(wanted - sensed.poses[robot, 2]) if wanted == wanted else 0.0
    if abs(error) > FACING:
        return float(_turn_rate(error, bodies.limits))
    courses.states[robot] = ARRIVED
    courses.stood[robot] = 0
    return 0.0


@kernel(forceinline=True, nrt=False)
def _aim(sensed: Sensed, courses: Courses, robot: int) -> tuple[float, float]:
    """Return the point at which a robot aims, on the line of its piece of path [m].

    A little ahead of the robot's foot on that line.
    """
    x, y = sensed.poses[robot, 0], sensed.poses[robot, 1]
    paths, place = courses.paths, courses.places[robot]
    end_x, end_y = paths[robot, place, 0], paths[robot, place, 1]
    from_x, from_y = (paths[robot, place - 1, 0], paths[robot, place - 1, 1]) if place > 0 else (x, y)
    along_x, along_y = end_x - from_x, end_y - from_y
    length = math.hypot(along_x, along_y)
    if not length > LEAST_PIECE:
        return end_x, end_y
    foot = ((x - from_x) * along_x + (y - from_y) * along_y) / length
    lookahead = LEAST_LOOKAHEAD + LOOKAHEAD_PER_ROOM * courses.margins[robot, place]
    ahead = min(max(foot, 0.0) + min(max(lookahead, LEAST_LOOKAHEAD), MOST_LOOKAHEAD), length)
    return from_x + along_x * ahead / length, from_y + along_y * ahead / length


@kernel(forceinline=True, nrt=False)
def _speed_to_next(sensed: Sensed, courses: Courses, limits: Array, robot: int, tolerance: float) -> float:
    """Return the speed that still brakes for the next bend or the end [m/s].

    At a bend it slows down to a speed at which it can turn.
    """
    remaining, braking = _remaining(sensed, courses, robot), limits[BRAKING]
    paths, place = courses.paths, courses.places[robot]
    if place == courses.counts[robot] - 1:
        at_end = max(remaining / limits[TIME_STEP], LEAST_SPEED_AT_END)
        return float(min(math.sqrt(2.0 * braking * remaining), at_end))
    x, y = sensed.poses[robot, 0], sensed.poses[robot, 1]
    end_x, end_y = paths[robot, place, 0], paths[robot, place, 1]
    next_x, next_y = paths[robot, place + 1, 0], paths[robot, place + 1, 1]
    bend = abs(_wrap(math.atan2(next_y - end_y, next_x - end_x) - math.atan2(end_y - y, end_x - x)))
    through = limits[CRUISE] * max(0.0, 1.0 - bend / max(tolerance, LEAST_BEND))
    if through > 0.0:
        return math.sqrt(through * through + 2.0 * braking * remaining)
    return math.sqrt(2.0 * braking * remaining)
