"""The reports that have reached the station, with where the robots drove."""

from collections import deque

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.supervisor.settings import SupervisorSettings
from lidarium.envs.onboard.radio.messages import OperatingState
from lidarium.envs.onboard.station.reports import Report
from lidarium.mapping.grids.occupancy import UNKNOWN


class ReceivedReports:
    """The reports of a team: the latest of each robot, and what earlier ones say.

    Parameters
    ----------
    agents : list of str
        The team.
    resolution : float
        Side of a cell of the robots' maps [m].
    settings : SupervisorSettings
        What counts as enclosed.

    Attributes
    ----------
    latest : dict of str to Report
        The latest of each robot that ever reported.
    """

    def __init__(self, agents: list[str], resolution: float, settings: SupervisorSettings) -> None:
        self._resolution, self._settings = resolution, settings
        self._tracks: dict[str, deque[tuple[float, float]]] = {agent: deque() for agent in agents}
        self._trails: dict[str, list[tuple[float, float]]] = {agent: [] for agent in agents}
        self.latest: dict[str, Report] = {}

    def add(self, agent: str, report: Report) -> None:
        """Take in a report that is newer than all before of its robot."""
        self.latest[agent] = report
        self._trails[agent].append((report.pose.x, report.pose.y))
        track = self._tracks[agent]
        track.append((report.travelled_m, self.known_m2(agent)))
        while len(track) > 1 and track[1][0] <= report.travelled_m - self._settings.enclosed_way_m:
            track.popleft()

    def known_m2(self, agent: str) -> float:
        """Return how much a robot's own map knows [m2], 0 where it never reported."""
        report = self.latest.get(agent)
        return (
            0.0
            if report is None
            else float(np.count_nonzero(report.map.levels != UNKNOWN)) * self._resolution**2
        )

    def is_enclosed(self, agent: str) -> bool:
        """Whether a robot has mapped too little on the last of its way."""
        track = self._tracks[agent]
        if not track or track[-1][0] - track[0][0] < self._settings.enclosed_way_m:
            return False
        way, gain = (last - first for first, last in zip(track[0], track[-1], strict=True))
        return gain < self._settings.enclosed_gain_m2_per_m * way

    def place(self, agent: str) -> tuple[float, float]:
        """Return where a robot was last, in its map frame [m]."""
        pose = self.latest[agent].pose
        return pose.x, pose.y

    def trail(self, agent: str) -> NDArray[np.float64]:
        """Return where a robot has been, in its map frame, shape (N, 2) [m]."""
        return np.array(self._trails[agent], np.float64).reshape(-1, 2)

    def is_used(self, agent: str) -> bool:
        """Whether a robot's map is used.

        The robot has reported something, and has not failed (rules 1 and 2).
        """
        report = self.latest.get(agent)
        return (
            report is not None
            and report.state is not OperatingState.FAILED
            and bool((report.map.levels != UNKNOWN).any())
        )
