"""A compass from the directions of a building's walls.

It keeps headings from drifting.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.localization.matching.settings.graph import CompassSettings
from lidarium.mapping.localization.matching.wall_direction import wall_direction, within_quarter


@dataclass(frozen=True, slots=True)
class Bearing:
    """Where walls run, as seen from a node of the graph.

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

    Where walls run is surveyed once, over the first local map. From then on both are estimated together, by a
    Kalman filter: what the next nodes show says more of the building, what later ones show more of the
    headings.

    Parameters
    ----------
    settings : CompassSettings
        How.

    Attributes
    ----------
    bearings : list of Bearing
        Those that count, by node.
    """

    def __init__(self, settings: CompassSettings) -> None:
        self._settings = settings
        self.bearings: list[Bearing] = []
        # Points of scans since the last node, in its frame [m].
        self._points: list[NDArray[np.float64]] = []
        # Where walls run, and the variances of the last node's heading, of that direction, and of both
        # together.
        self._walls: float | None = None
        self._heading_variance, self._walls_variance, self._covariance = 0.0, 0.0, 0.0

    @property
    def is_surveyed(self) -> bool:
        """Whether it is known where walls run."""
        return self._walls is not None

    def survey(self, points: NDArray[np.float64], node: int, heading: float) -> bool:
        """Find where walls run.

        Parameters
        ----------
        points : (n, 2) float64
            Points of all scans since a local map was begun at a node, in its frame [m].
        node : int
            The node.
        heading : float
            What is believed of it [rad].

        Returns
        -------
        bool
            Whether there are such walls.
        """
        direction, information = wall_direction(points)
        if information == 0.0:
            return False
        noise = 1.0 / information + self._settings.deviation_angle**2
        self.bearings.append(Bearing(node, direction, 1.0 / noise))
        # Headings have drifted since as far as each is uncertain; the local map's own node has not.
        self._walls, self._walls_variance, self._covariance = heading + direction, noise, 0.0
        return True

    def observe(self, points: NDArray[np.float64]) -> None:
        """Take in the points (points, 2) of a scan, in the frame of the last node [m]."""
        if self.is_surveyed:
            self._points.append(points)

    def forget(self) -> None:
        """Forget what was seen since the last node."""
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
            What is believed of the new one [rad].

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
        bearing = Bearing(node, seen - since, 1.0 / noise)
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

    def rest(self, bearing: Bearing, heading: float) -> float:
        """Return the turn of a heading that would align its walls with the building's.

        The heading is that of the bearing's node; the turn is in radians [rad].
        """
        return float(within_quarter((self._walls or 0.0) - bearing.direction - heading))
