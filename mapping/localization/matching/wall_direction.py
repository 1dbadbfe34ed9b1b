"""Direction of the walls of a scan, or of many.

In most buildings walls run in two directions, at right angles. Seen along either, all points of a wall fall
together: of all pairs of axes at right angles, projections onto those of the walls have the least entropy.
This measurement gives a heading, up to quarter turns, and does not drift. Points need not lie in rows, so
that far ones, which noise parts from each other, count as well.

References
----------
Gallup, Frahm, Mordohai, Yang and Pollefeys, Real-time plane-sweeping stereo with multiple sweeping directions
(CVPR 2007), section 3.2, for points of a camera; here with a search from coarse to fine, and with the
information.
"""

import math

import numpy as np

from lidarium.mapping.kernels.compilation import Array, kernel

QUARTER = 0.5 * math.pi
"""Turns by so much change nothing about the directions of walls [rad]."""

LEAST_POINTS = 20
"""Of fewer points nothing is estimated."""

COARSE_POINTS = 600
"""At most so many points are examined in all directions."""

COARSE_CELL_M, COARSE_STEPS = 0.05, 180
"""Side of the coarse counting cells [m], and steps per quarter turn.

Steps are the directions in which points are then counted.
"""

LEAST_GAIN, APART = 0.2, math.radians(10.0)
"""Least gain in entropy along walls, and the least angle to rivals [nats, rad].

Entropy has to be less by this than in all directions that differ from theirs by more than the angle.
"""

FINE_CELLS_M = (0.04, 0.01, 0.005)
"""Sides of the cells of the fine search for the direction [m].

They are used one after the other.

In coarse cells two walls that run side by side, a few centimetres apart, would pass for one that slants.
"""

FINE_STEPS = (math.radians(0.2), math.radians(0.1), math.radians(0.05))
"""The steps that go with them [rad]."""

MOST_MOVES = 3
"""At most so often a finer search follows its best direction."""

DEPENDENCE = 3.0
"""Factor by which the curvature of the entropy overstates the information.

The points are not independent: they are placed by the walls whose direction they measure.
"""


@kernel
def within_quarter(angle: float) -> float:
    """Return an angle less quarter turns, in [-pi/4, pi/4)."""
    return float((angle + 0.5 * QUARTER) % QUARTER - 0.5 * QUARTER)


@kernel
def wall_direction(points: Array) -> tuple[float, float]:
    """Return in which direction walls run, up to quarter turns.

    Parameters
    ----------
    points : (points, 2) float64
        Points of surfaces, in any order [m].

    Returns
    -------
    float
        The direction, in [-pi/4, pi/4), in the frame of the points [rad].
    float
        Its information, 0 where there are no walls, or hardly any that agree on two directions at right
        angles [1/rad^2].
    """
    count = len(points)
    if count < LEAST_POINTS:
        return 0.0, 0.0
    reach = 0.0
    for k in range(count):
        reach = max(reach, math.hypot(points[k, 0], points[k, 1]))
    counts = np.zeros(2 * int(reach / min(COARSE_CELL_M, FINE_CELLS_M[-1])) + 8)
    direction, is_clear = _coarse_direction(points, reach, counts)
    if not is_clear:
        return 0.0, 0.0
    order, bend = np.empty(7), 0.0
    for level in range(len(FINE_CELLS_M)):
        cell, step = FINE_CELLS_M[level], FINE_STEPS[level]
        for k in range(7):
            order[k] = _fine_order(points, direction + (k - 3) * step, cell, reach, counts)
        for _ in range(MOST_MOVES):
            best = int(np.argmax(order))
            if best == 3:
                break
            direction += (best - 3) * step
            shifted = np.empty(7)
            for k in range(7):
                before = k + best - 3
                known = 0 <= before < 7
                shifted[k] = (
                    order[before]
                    if known
                    else _fine_order(points, direction + (k - 3) * step, cell, reach, counts)
                )
            order = shifted
        # A parabola through all seven smooths what single cells do.
        slope, bend = 0.0, 0.0
        for k in range(7):
            slope += (k - 3) * order[k] / 28.0
            bend += ((k - 3) * (k - 3) - 4.0) * order[k] / 42.0
        if bend >= 0.0:
            return 0.0, 0.0
        direction += min(max(-slope / bend, -3.0), 3.0) * step
        bend /= step * step
    return within_quarter(direction), -count * bend / DEPENDENCE


@kernel
def _coarse_direction(points: Array, reach: float, counts: Array) -> tuple[float, bool]:
    """Return the direction of least entropy, and whether it is clearly least.

    Clearly least means clearly less than far from there.
    """
    every = (len(points) - 1) // COARSE_POINTS + 1
    used = (len(points) - 1) // every + 1
    table = np.zeros(used + 1)
    for k in range(2, used + 1):
        table[k] = k * math.log(k)
    order = np.empty(COARSE_STEPS)
    scale = 1.0 / COARSE_CELL_M
    middle = int(reach * scale) + 2
    tally = np.zeros(2 * middle + 2, np.int64)
    for step in range(COARSE_STEPS):
        angle = step * QUARTER / COARSE_STEPS
        cosine, sine = math.cos(angle) * scale, math.sin(angle) * scale
        total = 0.0
        for _ in range(2):
            tally[:] = 0
            for k in range(0, len(points), every):
                tally[int(cosine * points[k, 0] + sine * points[k, 1] + middle)] += 1
            for cell in range(len(tally)):
                total += table[tally[cell]]
            cosine, sine = -sine, cosine
        order[step] = total / used
    best = int(np.argmax(order))
    beside = -math.inf
    for step in range(COARSE_STEPS):
        if abs(within_quarter((step - best) * QUARTER / COARSE_STEPS)) >= APART:
            beside = max(beside, order[step])
    return best * QUARTER / COARSE_STEPS, order[best] - beside >= LEAST_GAIN


@kernel
def _fine_order(points: Array, direction: float, cell: float, reach: float, counts: Array) -> float:
    """Return the negative entropy of projections, up to a constant [nats].

    Points are projected along and across a direction, and each is shared out among cells.
    """
    scale = 1.0 / cell
    middle = int(reach * scale) + 3
    cosine, sine = math.cos(direction) * scale, math.sin(direction) * scale
    total = 0.0
    for _ in range(2):
        counts[: 2 * middle] = 0.0
        for k in range(len(points)):
            place = cosine * points[k, 0] + sine * points[k, 1] + middle
            first = int(place)
            share = place - first
            counts[first] += 1.0 - share
            counts[first + 1] += share
        for k in range(1, 2 * middle - 1):
            smooth = 0.25 * (counts[k - 1] + counts[k + 1]) + 0.5 * counts[k]
            if smooth > 0.0:
                total += smooth * math.log(smooth)
        cosine, sine = -sine, cosine
    return total / len(points)
