"""Watches an episode for the metrics over time.

It keeps what the team and each robot knew, and how far they had driven by then.

A sample is taken at the start, every decision period of simulated time and at the end; what a threshold of
coverage asks for is noted in the very step that reaches it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.exploration import ExplorationEnv
from lidarium.evaluation.episodes.watching import Watcher
from lidarium.evaluation.metrics.cells import overlap
from lidarium.evaluation.truth.footprints import Footprints
from lidarium.evaluation.truth.map_tally import MapTally
from lidarium.evaluation.truth.team_counts import COUNTED, KNOWABLE, VALID
from lidarium.evaluation.truth.true_map import Truth, truth_of

WHOLE = 0.99
"""Coverage at which the overlap of maps is asked for."""


@dataclass(frozen=True, slots=True, eq=False)
class Milestone:
    """The step in which a threshold of ``C_free`` was reached.

    Attributes
    ----------
    time_s, coverage : float
        When [s], and ``C_free`` then.
    decisions : int
        Decisions taken until then, the one under way included.
    lengths : (robots,) float64
        Length of each robot's path until then [m].
    overlap : float
        Share of the seen cells that two robots or more had seen.
    known_shares : (robots,) float64 or None
        ``C_known`` of each robot's own map; None below `WHOLE`, before which nobody asks for it.
    """

    time_s: float
    coverage: float
    decisions: int
    lengths: NDArray[np.float64]
    overlap: float
    known_shares: NDArray[np.float64] | None


@dataclass(frozen=True, slots=True, eq=False)
class Curves:
    """Metrics over time.

    Attributes
    ----------
    times : (samples,) float64
        When [s]: at the start, every decision period, and at the end.
    c_free, c_known, c_valid : (samples,) float64
        Shares of F that were sensed, of all that can be known, and of F and its surface that the team's map
        knows.
    c_own : (samples, robots) float64
        Share of F that each robot holds to be free, by its own map or, where it reaches the robot, the
        team's.
    lengths : (samples, robots) float64
        Length of each robot's path [m].
    seen_once, seen_twice : (decisions,) int64
        Cells of F that a robot or more, and two or more, saw at once from where they stood, at the start and
        every decision period; both 0 where no two footprints could meet.
    """

    times: NDArray[np.float64]
    c_free: NDArray[np.float64]
    c_known: NDArray[np.float64]
    c_valid: NDArray[np.float64]
    c_own: NDArray[np.float64]
    lengths: NDArray[np.float64]
    seen_once: NDArray[np.int64]
    seen_twice: NDArray[np.int64]


class History(Watcher):
    """What metrics over time need, of the episode that runs or ran last.

    Attributes
    ----------
    truth : Truth
        What is true of the floor; after ``begin``.
    milestones : list of Milestone
        Steps in which thresholds of coverage were reached, in their order; one step may have reached several.
    """

    truth: Truth

    def __init__(self) -> None:
        self.milestones: list[Milestone] = []
        self._times: list[float] = []

    @property
    def has_begun(self) -> bool:
        """Whether there is a sample."""
        return bool(self._times)

    def begin(self, env: ExplorationEnv) -> None:
        """Take the first sample; what was seen of an episode before is forgotten."""
        self.truth = truth_of(env)
        self.milestones = []
        self._tally, self._footprints = MapTally(env, self.truth), Footprints(env)
        self._period, self._left = env.settings.decision_steps, env.settings.decision_steps
        self._decisions = 0
        self._thresholds = 0
        self._times = []
        self._coverage: list[float] = []
        self._counts: list[NDArray[np.int64]] = []
        self._lengths: list[NDArray[np.float64]] = []
        self._footprint_counts: list[tuple[int, int]] = []
        self._believed: list[NDArray[np.float64]] = [env.beliefs.believed.copy()]
        self._note_thresholds(env)
        self._sample(env, is_decision=True)

    def step(self, env: ExplorationEnv, _commands: NDArray[np.float64]) -> None:
        """Note what this step changed; take a sample where it is time for one."""
        self._tally.note_step(env)
        scorer = env.scorer
        if len(scorer.track) != len(self._believed):
            self._believed.append(env.beliefs.believed.copy())
        if len(scorer.times) != self._thresholds:
            self._note_thresholds(env)
        self._left -= 1
        if self._left == 0:
            self._left = self._period
            self._sample(env, is_decision=True)

    def outcome(self, env: ExplorationEnv) -> None:
        """Count a decision; take the last sample where all agents have ended."""
        self._decisions += 1
        if not env.agents and self._times[-1] != env.scorer.time:
            self._sample(env, is_decision=False)

    def _sample(self, env: ExplorationEnv, is_decision: bool) -> None:
        self._tally.take_in(env)
        self._times.append(env.scorer.time)
        self._coverage.append(env.scorer.coverage)
        self._counts.append(self._tally.counts.copy())
        self._lengths.append(env.world.travelled.copy())
        if is_decision:
            self._footprint_counts.append(self._footprints.count(env))

    def _note_thresholds(self, env: ExplorationEnv) -> None:
        scorer, world = env.scorer, env.world
        self._thresholds = len(scorer.times)
        if not scorer.times:
            return
        known_shares = None
        if scorer.coverage >= WHOLE:
            self._tally.take_in(env)
            known_shares = self._tally.known_shares
        decisions = self._decisions + 1 if int(world.steps[0]) > 0 else 0
        self.milestones.append(
            Milestone(
                scorer.time,
                scorer.coverage,
                decisions,
                world.travelled.copy(),
                overlap(env.score.masks),
                known_shares,
            )
        )

    def milestone(self, share: float) -> Milestone | None:
        """Return the step in which coverage first reached one of the thresholds.

        Coverage is then at least the threshold. None where it was not reached.
        """
        return next((milestone for milestone in self.milestones if milestone.coverage >= share), None)

    @property
    def believed(self) -> NDArray[np.float64]:
        """Believed poses (times, robots, 3), in each robot's map frame [m, rad].

        They are at the times of the scorer's track.
        """
        return np.stack(self._believed)

    @property
    def curves(self) -> Curves:
        """The metrics over time, of what has been seen so far."""
        counts, sizes = np.stack(self._counts), np.maximum(self._tally.sizes, 1)
        team = counts[:, -1] / sizes
        held = counts[:, -1:] if self._tally.shares else counts[:, :-1]
        footprints = np.array(self._footprint_counts, np.int64).reshape(-1, 2)
        robots = counts.shape[1] - 1
        return Curves(
            np.array(self._times),
            np.array(self._coverage),
            team[:, KNOWABLE],
            team[:, VALID],
            np.repeat(held[:, :, COUNTED], robots // held.shape[1], axis=1) / sizes[COUNTED],
            np.stack(self._lengths),
            footprints[:, 0],
            footprints[:, 1],
        )
