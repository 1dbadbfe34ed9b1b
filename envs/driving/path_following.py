"""Path following with a safety stop, for all robots of a team in one kernel call.

A robot turns on the spot towards the next piece of its path, drives along the piece's line, and looks ahead
with its laser: the speed is never higher than what still stops before the nearest return in the swath of its
body. Teammates whose poses are known are met with half the room, because they brake as well; of two robots
whose ways cross, the one with the higher number lets the other pass.
"""

import math

import numpy as np

from lidarium.mapping.kernels.compilation import Array, kernel

IDLE, DRIVING, ARRIVED, BLOCKED = range(4)
"""States of a drive."""

MAX_POINTS = 512
"""Most points of a path."""

LOOKAHEAD = (0.08, 0.25)
"""Distance ahead on its line at which a robot aims [m].

The first is where it is tight, the second where there is room.
"""

TURN_GAIN = 3.0
"""Turn rate per radian of heading error [1/s]."""

ARRIVAL = 0.03
"""Distance at which the end of a path counts as reached [m]."""

FACING = 0.1
"""Heading error at which a wanted final heading counts as reached [rad]."""

STANDSTILL = 0.006
"""Gap to a return at which a robot stands [m]."""

MATE_GAP = 0.03
"""Gap that robots keep to each other [m]."""

LEAST_MATE_GAP = 0.004
"""Gap that the lower-numbered robot keeps in passing [m].

It holds where two robots stand nearer than the usual gap.
"""

SIDE_GAP = 0.0003
"""Extra width of the swath that must be clear of returns, each side [m].

The swath is this much wider than the body.
"""

FORESIGHT_TIMES = np.array([0.0, 0.4, 0.8])
"""How far ahead the robot with the higher number looks where another will be [s]."""

BACKING_SPEED = 0.05
"""A robot that a wall blocks backs out the way it came at this speed [m/s]."""

BLOCKED_S = 1.0
"""A robot that wants to drive and has stood for this long is blocked [s]."""


@kernel(inline=True)
def _wrap(angle: float) -> float:
    return angle - 2.0 * math.pi * math.floor((angle + math.pi) / (2.0 * math.pi))


@kernel
def _gap_in_scan(ranges: Array, unit_vectors: Array, radius: float) -> float:
    """How far the disc can go straight ahead before it meets a return [m]."""
    gap = np.inf
    for beam in range(ranges.shape[0]):
        distance = ranges[beam]
        if not distance < np.inf:
            continue
        y = distance * unit_vectors[1, beam]
        x = distance * unit_vectors[0, beam]
        if x > 0.0 and -radius < y < radius:
            gap = min(gap, x - math.sqrt(radius * radius - y * y))
    return gap


@kernel
def _gap_to_mates(
    robot: int, poses: Array, velocities: Array, radii: Array, foresight: Array, present: Array
) -> float:
    """Return how far the disc can go straight to a known teammate [m].

    The teammate counts now or where it will be soon.
    """
    gap = np.inf
    cosine, sine = math.cos(poses[robot, 2]), math.sin(poses[robot, 2])
    for other in range(poses.shape[0]):
        if other == robot or present[other] == 0:
            continue
        for k in range(foresight.shape[0]):
            if k > 0 and other > robot:
                break
            reach = radii[robot] + radii[other] + MATE_GAP
            drift = velocities[other, 0] * foresight[k]
            gap_x = poses[other, 0] + drift * math.cos(poses[other, 2]) - poses[robot, 0]
            gap_y = poses[other, 1] + drift * math.sin(poses[other, 2]) - poses[robot, 1]
            x, y = cosine * gap_x + sine * gap_y, cosine * gap_y - sine * gap_x
            if x * x + y * y <= reach * reach:
                # Nearer than robots should be: the one with the lower number may pass where it does not
                # touch, else apart.
                touching = radii[robot] + radii[other] + LEAST_MATE_GAP
                if x > 0.0 and (robot > other or -touching < y < touching):
                    gap = 0.0
            elif x > 0.0 and -reach < y < reach:
                gap = min(gap, x - math.sqrt(reach * reach - y * y))
    return gap


@kernel
def _gap_to_heard(
    robot: int, poses: Array, radii: Array, foresight: Array, contact: Array, heard: Array
) -> float:
    """Return how far the disc can go straight to a teammate heard of [m].

    The teammate is taken to stand where it was.
    """
    known = heard.reshape((-1, 3)).copy()
    known[robot] = poses[robot]
    return _gap_to_mates(robot, known, np.zeros((poses.shape[0], 2)), radii, foresight, contact)  # type: ignore[no-any-return]


@kernel
def follow_paths(
    poses: Array,
    velocities: Array,
    ranges: Array,
    unit_vectors: Array,
    radii: Array,
    limits: Array,
    paths: Array,
    margins: Array,
    counts: Array,
    places: Array,
    headings: Array,
    states: Array,
    stood: Array,
    backing: Array,
    knows_mates: bool,
    present: Array,
    foresight: Array,
    contact: Array,
    heard: Array,
    commands: Array,
) -> None:
    """Give each robot the speed and turn rate that follow its path.

    Parameters
    ----------
    poses, velocities : (robots, 3), (robots, 2) float64
        Believed poses and velocities [m, rad, m/s, rad/s].
    ranges : (robots, beams) float32
        Scans [m].
    unit_vectors : (2, beams) float64
        Which way the beams look.
    radii : (robots,) float64
        Of the bodies [m].
    limits : (4,) float64
        Cruise speed, greatest turn rate, braking and length of a step [m/s, rad/s, m/s2, s].
    paths, margins : (robots, points, 2), (robots, points) float64
        Points x, y [m], and the room beside the body on the piece that leads to each [m].
    counts, places : (robots,) int64
        Number of points, and the point that each robot drives to now (updated).
    headings : (robots,) float64
        Wanted heading at the end [rad], nan for any.
    states, stood : (robots,) int64
        State of the drive, and steps for which the robot has stood although it wanted to drive (updated).
    backing : (robots,) int64
        Steps for which the robot still backs out (updated).
    knows_mates : bool
        Whether teammates' poses are known (and comparable).
    present : (robots,) uint8
        Which robots are bodies to keep clear of.
    foresight : (K,) float64
        Times at which the other is looked for, the first 0 [s].
    contact, heard : (robots, robots) uint8, (robots, robots * 3) float64
        Where not all teammates' poses are known: of whom each robot heard lately, and where they were then
        [m, rad].
    commands : (robots, 2) float64
        Result: speed and turn rate [m/s, rad/s].
    """
    gain = min(TURN_GAIN, 0.5 / limits[3])
    cruise, turn_limit, braking, time_step = limits[0], limits[1], limits[2], limits[3]
    for robot in range(poses.shape[0]):
        commands[robot, 0] = commands[robot, 1] = 0.0
        if states[robot] != DRIVING and states[robot] != BLOCKED:
            stood[robot] = backing[robot] = 0
            continue
        if backing[robot] > 0:
            backing[robot] -= 1
            commands[robot, 0] = -BACKING_SPEED
            continue
        x, y, heading = poses[robot, 0], poses[robot, 1], poses[robot, 2]
        last = counts[robot] - 1
        place = places[robot]
        while place < last:
            passing = min(max(0.5 * margins[robot, place], 0.015), 0.12)
            if math.hypot(paths[robot, place, 0] - x, paths[robot, place, 1] - y) > passing:
                break
            place += 1
        places[robot] = place
        end_x, end_y = paths[robot, place, 0], paths[robot, place, 1]
        remaining = math.hypot(end_x - x, end_y - y)
        if place == last and remaining <= ARRIVAL:
            wanted = headings[robot]
            error = _wrap(wanted - heading) if wanted == wanted else 0.0
            if abs(error) <= FACING:
                states[robot] = ARRIVED
                stood[robot] = 0
            else:
                commands[robot, 1] = min(max(gain * error, -turn_limit), turn_limit)
            continue
        # Aim at a point on the line of this piece, a little ahead of the foot of the robot on it.
        from_x, from_y = (paths[robot, place - 1, 0], paths[robot, place - 1, 1]) if place > 0 else (x, y)
        along_x, along_y = end_x - from_x, end_y - from_y
        length = math.hypot(along_x, along_y)
        aim_x, aim_y = end_x, end_y
        if length > 1e-9:
            foot = ((x - from_x) * along_x + (y - from_y) * along_y) / length
            ahead = min(
                max(foot, 0.0)
                + min(max(LOOKAHEAD[0] + 2.0 * margins[robot, place], LOOKAHEAD[0]), LOOKAHEAD[1]),
                length,
            )
            aim_x, aim_y = from_x + along_x * ahead / length, from_y + along_y * ahead / length
        error = _wrap(math.atan2(aim_y - y, aim_x - x) - heading)
        margin = margins[robot, place]
        tolerance = min(max(0.01 + 2.0 * margin, 0.01), 0.6)
        commands[robot, 1] = min(max(gain * error, -turn_limit), turn_limit)
        if abs(error) > tolerance:
            continue
        speed = cruise * (1.0 - 0.7 * abs(error) / tolerance)
        # At a bend the robot slows down to what it can turn with.
        if place < last:
            next_x, next_y = paths[robot, place + 1, 0], paths[robot, place + 1, 1]
            bend = abs(_wrap(math.atan2(next_y - end_y, next_x - end_x) - math.atan2(end_y - y, end_x - x)))
            through = cruise * max(0.0, 1.0 - bend / max(tolerance, 0.2))
        else:
            through = 0.0
        speed = min(
            speed,
            math.sqrt(through * through + 2.0 * braking * remaining)
            if through > 0.0
            else math.sqrt(2.0 * braking * remaining),
        )
        speed = min(speed, max(remaining / time_step, 0.02)) if place == last else speed
        gap = _gap_in_scan(ranges[robot], unit_vectors, radii[robot] + SIDE_GAP)
        allowed = math.sqrt(
            2.0 * braking * max(gap - STANDSTILL - 0.5 * time_step * velocities[robot, 0], 0.0)
        )
        if knows_mates:
            mate_gap = _gap_to_mates(robot, poses, velocities, radii, foresight, present)
            allowed = min(allowed, math.sqrt(braking * max(mate_gap - time_step * velocities[robot, 0], 0.0)))
        elif contact[robot].sum() > 0:
            mate_gap = _gap_to_heard(robot, poses, radii, foresight, contact[robot], heard[robot])
            allowed = min(allowed, math.sqrt(braking * max(mate_gap - time_step * velocities[robot, 0], 0.0)))
        speed = min(speed, allowed)
        commands[robot, 0] = speed
        if speed < 0.01:
            stood[robot] += 1
            if stood[robot] * time_step >= BLOCKED_S - 1e-9:
                states[robot] = BLOCKED
        else:
            stood[robot] = 0
            states[robot] = DRIVING
