"""The true coverage of an episode over time, and the track of its robots."""

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.simulation.simulation import Simulation

THRESHOLDS = (0.85, 0.90, 0.95, 0.99)
"""Shares of F of which the time is noted."""

TRACK_PERIOD_S = 0.2
"""Time between two poses of the track [s]."""


class Tally:
    """The tally of one episode; apart from `evaluation`, only it has access to the true state.

    Parameters
    ----------
    simulation : Simulation
        Simulation of the one episode.
    settings : ExplorationSettings
        The length of a step.

    Attributes
    ----------
    coverage : float
        ``C_free``: share of F that any robot has sensed.
    times : dict
        Simulated time at which each threshold of coverage was reached [s].
    curve : list of (time [s], coverage)
        Coverage over time, at every change.
    track : list of (time [s], (robots, 3) float64)
        True poses, five times a second.
    touched : (robots,) bool
        Whether each robot touched something in the last step.
    ended_because : dict
        Why each ended agent ended.
    """

    def __init__(self, simulation: Simulation, settings: ExplorationSettings) -> None:
        self._world, self._score, self._settings = simulation.world, simulation.score, settings
        self.coverage = 0.0
        self.times: dict[float, float] = {}
        self.curve: list[tuple[float, float]] = []
        self.track: list[tuple[float, NDArray[np.float64]]] = []
        self.ended_because: dict[str, str] = {}
        self._last_seen = -1
        self._track_steps = max(round(TRACK_PERIOD_S / settings.time_step), 1)

    def start(self) -> None:
        """Start an episode with the scan taken at the start."""
        self.times, self.curve, self.track, self.ended_because = {}, [], [], {}
        self._last_seen = -1
        self.advance()

    def advance(self) -> None:
        """Take in one step of the world, or the scan taken at the start."""
        world = self._world
        step, seen = world.steps.item(0), self._score.team_seen.item(0)
        time = step * self._settings.time_step
        if step % self._track_steps == 0:
            self.track.append((time, world.poses.copy()))
        if seen == self._last_seen:
            return
        self._last_seen = seen
        self.coverage = seen / max(self._score.counted.item(0), 1)
        self.curve.append((time, self.coverage))
        for threshold in THRESHOLDS[len(self.times) :]:
            if self.coverage < threshold:
                break
            self.times[threshold] = time

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return float(self._world.steps[0]) * self._settings.time_step

    @property
    def touched(self) -> NDArray[np.bool_]:
        """Whether each robot touched something in the last step."""
        return np.asarray(self._world.contacts != 0)
