"""The scorer: how much the team has really seen, when, and at what cost.

Beside ``evaluation`` the only one to see the truth.
"""

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.observing.rows import Rows
from lidarium.envs.outcome.reward_terms import ExtraTerms
from lidarium.envs.scoring.rewards import TERMS
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.simulation.simulation import Simulation

THRESHOLDS = (0.85, 0.90, 0.95, 0.99)
"""Shares of F of which the time is noted."""

TRACK_PERIOD_S = 0.2
"""Time between two poses of the track [s]."""


class Scorer:
    """Tally of one episode.

    Parameters
    ----------
    simulation : Simulation
        Of the one episode.
    settings : ExplorationSettings
        Weights of the reward and the length of a step.

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
    terms : list of dict
        What each term of the reward brought each robot, of the rewards that were last taken.
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
        self.terms: list[dict[str, float]] = [{} for _ in range(settings.robots)]
        self._extra = ExtraTerms(settings.reward.more, Rows(simulation, settings))
        self._has_extra = not self._extra.is_empty
        self._last_seen = -1
        self._track_steps = max(round(TRACK_PERIOD_S / settings.time_step), 1)

    def start(self) -> None:
        """Start an episode with the scan taken at the start."""
        self._score.rewards[:], self._score.reward_terms[:] = 0.0, 0.0
        self._extra.start(0)
        names = (*TERMS, *self._extra.names)
        self.terms = [dict.fromkeys(names, 0.0) for _ in range(self._world.robots)]
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

    def take_rewards(self) -> list[float]:
        """Return each robot's reward since the last call, and begin again.

        ``terms`` says of what.
        """
        score = self._score
        rewards: list[float] = score.rewards.tolist()
        self.terms = [dict(zip(TERMS, row)) for row in score.reward_terms.tolist()]  # noqa: B905 (hot)
        score.earned.fill(0.0)
        if self._has_extra:
            for name, earned in self._extra.earned().items():
                for row, value in enumerate(earned.tolist()):
                    self.terms[row][name] = value
                    rewards[row] += value
        return rewards
