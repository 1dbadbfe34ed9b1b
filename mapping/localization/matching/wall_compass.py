"""A compass from the directions of a building's walls.

It keeps headings from drifting.

In most buildings walls run in two directions, at right angles. Seen along either, all points of a wall
coincide: of all pairs of axes at right angles, projections onto those of the walls have the least entropy.
This measurement gives a heading, up to quarter turns, and does not drift. Points need not lie in rows, so
distant ones, which noise separates, count as well.

References
----------
Gallup, Frahm, Mordohai, Yang and Pollefeys, Real-time plane-sweeping stereo with multiple sweeping directions
(CVPR 2007), section 3.2, for points of a camera; here with a search from coarse to fine, and with the
information.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.localization.settings import CompassSettings

QUARTER = 0.5 * math.pi
"""Turns by so much change nothing about the directions of walls [rad]."""

MIN_POINTS = 20
"""Of fewer points nothing is estimated."""

COARSE_POINTS = 600
"""Maximum number of points examined in all directions."""

COARSE_CELL_M, COARSE_STEPS = 0.05, 180
"""Side of the coarse counting cells [m], and steps per quarter turn.

Steps are the directions in which points are then counted.
"""

MIN_GAIN, APART = 0.2, math.radians(10.0)
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

MAX_MOVES = 3
"""Maximum number of finer searches of the best direction."""

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
        Its information, 0 if there are no walls, or hardly any that agree on two directions at right
        angles [1/rad^2].
    """
    count = len(points)
    if count < MIN_POINTS:
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
        for _ in range(MAX_MOVES):
            best = int(np.argmax(order))
            if best == 3:
                break
            direction += (best - 3) * step
            shifted = np.empty(7)
            for k in range(7):
                before = k + best - 3
                known = 0 <= before < 7
                shifted[k] = (
                    order[before] if known else _fine_order(points, direction + (k - 3) * step, cell, reach, counts)
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
    return best * QUARTER / COARSE_STEPS, order[best] - beside >= MIN_GAIN


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
            position = cosine * points[k, 0] + sine * points[k, 1] + middle
            first = int(position)
            share = position - first
            counts[first] += 1.0 - share
            counts[first + 1] += share
        for k in range(1, 2 * middle - 1):
            smooth = 0.25 * (counts[k - 1] + counts[k + 1]) + 0.5 * counts[k]
            if smooth > 0.0:
                total += smooth * math.log(smooth)
        cosine, sine = -sine, cosine
    return total / len(points)


@dataclass(frozen=True, slots=True)
class _Bearing:
    """Directions of walls, as seen from a node of the graph.

    Attributes
    ----------
    node : int
        The node.
    direction : float
        Direction of the walls in its frame, up to quarter turns [rad].
    information : float
        How well it is known [1/rad^2].
    """

    node: int
    direction: float
    information: float


class WallCompass:
    """Estimator of wall directions and of the drift of headings.

    It collects directions of walls between nodes. The walls are those of the building.

    The directions of walls are surveyed once, over the first local map. From then on both are estimated together, by a
    Kalman filter: what the next nodes show says more of the building, what later ones show more of the
    headings.

    Attributes
    ----------
    bearings : list of Bearing
        Those that count, by node.
    """

    def __init__(self, settings: CompassSettings) -> None:
        self._settings = settings
        self.bearings: list[_Bearing] = []
        # Points of scans since the last node, in its frame [m].
        self._points: list[NDArray[np.float64]] = []
        # Where walls run, and the variances of the last node's heading, of that direction, and of both
        # together.
        self._walls: float | None = None
        self._heading_variance, self._walls_variance, self._covariance = 0.0, 0.0, 0.0

    @property
    def is_surveyed(self) -> bool:
        """Whether the directions of walls are known."""
        return self._walls is not None

    def survey(self, points: NDArray[np.float64], node: int, heading: float) -> bool:
        """Find the directions of walls.

        Parameters
        ----------
        points : (n, 2) float64
            Points of all scans since a local map was begun at a node, in its frame [m].
        node : int
            The node.
        heading : float
            Its believed direction [rad].
        """
        direction, information = wall_direction(points)
        if information == 0.0:
            return False
        noise = 1.0 / information + self._settings.deviation_angle**2
        self.bearings.append(_Bearing(node, direction, 1.0 / noise))
        # Headings have drifted since as far as each is uncertain; the local map's own node has not.
        self._walls, self._walls_variance, self._covariance = heading + direction, noise, 0.0
        return True

    def observe(self, points: NDArray[np.float64]) -> None:
        """Take in the points (points, 2) of a scan, in the frame of the last node [m]."""
        if self.is_surveyed:
            self._points.append(points)

    def forget(self) -> None:
        """Forget everything seen since the last node."""
        self._points = []

    def turn(self, node: int, since: float, variance: float, heading: float) -> tuple[float, float]:
        """Add a node; return its heading correction [rad] and its variance [rad^2].

        The variance is that after the correction.

        Parameters
        ----------
        node : int
            The new node.
        since, variance : float
            Turn since the last one, and its variance [rad, rad^2].
        heading : float
            Believed direction of the new one [rad].

        Returns
        -------
        float
            The turn [rad].
        float
            The variance, in the measure of ``variance``: as much too large as that is by ``drift`` [rad^2].
        """
        turn = self._turn(node, since, variance, heading)
        return turn, self._heading_variance / self._settings.drift**2

    def relieve(self, variance: float) -> None:
        """Take note that the last heading is known so well, in the same measure [rad^2]."""
        known = self._settings.drift**2 * variance
        if known < self._heading_variance:
            share = known / self._heading_variance
            self._walls_variance -= (1.0 - share) * self._covariance**2 / self._heading_variance
            self._covariance *= share
            self._heading_variance = known

    def _turn(self, node: int, since: float, variance: float, heading: float) -> float:
        """Return by how much a new node's heading is to be turned."""
        settings = self._settings
        points = self._points
        self.forget()
        self._heading_variance += settings.drift**2 * variance
        if not points or self._heading_variance > settings.most_deviation**2:
            return 0.0
        seen, information = wall_direction(np.concatenate(points))
        if information == 0.0:
            return 0.0
        noise = 1.0 / information + settings.deviation_angle**2
        bearing = _Bearing(node, seen - since, 1.0 / noise)
        rest = self.rest(bearing, heading)
        of_heading, of_walls = (
            self._heading_variance - self._covariance,
            self._walls_variance - self._covariance,
        )
        spread = of_heading + of_walls + noise
        if rest * rest > settings.deviations**2 * spread:
            return 0.0
        self.bearings.append(bearing)
        self._walls = (self._walls or 0.0) - of_walls / spread * rest
        self._heading_variance -= of_heading * of_heading / spread
        self._walls_variance -= of_walls * of_walls / spread
        self._covariance += of_heading * of_walls / spread
        return float(of_heading / spread * rest)

    def edges(
        self, nodes: NDArray[np.float64]
    ) -> list[tuple[int, int, NDArray[np.float64], NDArray[np.float64], bool]]:
        """Return the bearings as edges between the first node and others.

        Each measures the turn (poses, 3) between the two, and may be wrong.
        """
        edges, share = [], self._settings.drift**2
        for bearing in self.bearings:
            heading = float(nodes[bearing.node, 2])
            turn = heading + self.rest(bearing, heading) - float(nodes[0, 2])
            edges.append(
                (
                    0,
                    bearing.node,
                    np.array([0.0, 0.0, turn]),
                    np.diag([0.0, 0.0, share * bearing.information]),
                    True,
                )
            )
        return edges

    def rest(self, bearing: _Bearing, heading: float) -> float:
        """Return the turn of a heading that would align its walls with the building's.

        The heading is that of the bearing's node; the turn is in radians [rad].
        """
        return float(within_quarter((self._walls or 0.0) - bearing.direction - heading))
