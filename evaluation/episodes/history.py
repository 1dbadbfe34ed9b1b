"""Watches an episode for the metrics over time.

It keeps the knowledge of the team and of each robot, and the lengths of their paths by then. A sample is taken at the
start, every decision period of simulated time and at the end; the values for a threshold of coverage are recorded in
the very step that reaches it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.simulation.coverage import count_bits
from lidarium.envs.simulation.kernels.arrays import (
    COUNTED_MASK,
    ENDED,
    MAP_RESOLUTION,
    MASK_ROWS,
    MASK_WORDS,
    RANGE_MAX,
    WorldArrays,
    world_at,
)
from lidarium.envs.simulation.kernels.masks import footprint
from lidarium.evaluation.episodes.watching import Watcher
from lidarium.evaluation.metrics.cells import overlap
from lidarium.evaluation.truth.map_tally import COUNTED, KNOWABLE, VALID, MapTally
from lidarium.evaluation.truth.true_map import Truth, truth_of
from lidarium.mapping.grids.scan_polygon import window_rows, window_words
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.views import grid_at


@kernel
def _is_any_pair_near(world: WorldArrays, first: int, robots: int) -> bool:
    """Whether the footprints of two robots at work may meet."""
    for row in range(first, first + robots):
        for other in range(row + 1, first + robots):
            gap_x, gap_y = (
                world.poses[row, 0] - world.poses[other, 0],
                world.poses[row, 1] - world.poses[other, 1],
            )
            ranges = world.sensor[row - first, RANGE_MAX] + world.sensor[other - first, RANGE_MAX]
            reach = ranges + 4.0 * world.sensor[0, MAP_RESOLUTION]
            if not (world.flags[row] | world.flags[other]) & ENDED and gap_x * gap_x + gap_y * gap_y < reach * reach:
                return True
    return False


@kernel
def _count_footprints(table: Array, episode: int, windows: Array) -> tuple[int, int]:
    """Count the cells of F that a robot or more, and two or more, see now.

    Ended robots see nothing.

    If no two footprints can meet, the first count is not needed and is 0. ``windows`` (robots, window rows, words)
    uint64 is scratch memory, all zero before and after.
    """
    world, robots = world_at(table), windows.shape[0]
    first = episode * robots
    if not _is_any_pair_near(world, first, robots):
        return 0, 0
    # Of each window the rows and words of the masks that may hold bits, and its origin.
    boxes, spans, corners = (
        np.zeros((robots, 4), np.int64),
        np.zeros((robots, 4), np.int64),
        np.zeros((robots, 2), np.int64),
    )
    once, twice = 0, 0
    for robot in range(robots):
        row = first + robot
        if world.flags[row] & ENDED:
            continue
        masks = world.mask_rows[row]
        counted = grid_at(masks[COUNTED_MASK], masks[MASK_ROWS], masks[MASK_WORDS], np.uint64)
        box, row_offset, word_offset = footprint(world, row, first, robots, windows[robot])
        spans[robot, 0], spans[robot, 1], spans[robot, 2], spans[robot, 3] = box
        corners[robot, 0], corners[robot, 1] = row_offset, word_offset
        boxes[robot, 0], boxes[robot, 1] = (
            max(box[0] + row_offset, 0),
            min(box[1] + row_offset, masks[MASK_ROWS]),
        )
        boxes[robot, 2], boxes[robot, 3] = (
            max(box[2] + word_offset, 0),
            min(box[3] + word_offset, masks[MASK_WORDS]),
        )
        for i in range(boxes[robot, 0], boxes[robot, 1]):
            for j in range(boxes[robot, 2], boxes[robot, 3]):
                seen = windows[robot, i - row_offset, j - word_offset] & counted[i, j]
                if seen == np.uint64(0):
                    continue
                by_one, by_two = np.uint64(0), np.uint64(0)
                for other in range(robot):
                    if boxes[other, 0] <= i < boxes[other, 1] and boxes[other, 2] <= j < boxes[other, 3]:
                        bits = windows[other, i - corners[other, 0], j - corners[other, 1]]
                        by_two |= by_one & bits
                        by_one |= bits
                once += count_bits(seen & ~by_one)
                twice += count_bits(seen & by_one & ~by_two)
    for robot in range(robots):
        windows[robot, spans[robot, 0] : spans[robot, 1], spans[robot, 2] : spans[robot, 3]] = 0
    return once, twice


class Footprints:
    """Cells that the robots of a team see from their positions."""

    def __init__(self, env: ExplorationEnv) -> None:
        reach = env.settings.lidar.range_max / env.settings.occupancy.resolution
        self._windows = np.zeros((env.settings.robots, window_rows(reach), window_words(reach)), np.uint64)

    def count(self, env: ExplorationEnv) -> tuple[int, int]:
        """Return how many cells of F a robot or more, and two or more, see now.

        (0, 0) if no two footprints can meet.
        """
        once, twice = _count_footprints(env.simulation.table, 0, self._windows)
        return int(once), int(twice)


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
        ``C_known`` of each robot's own map; None below `WHOLE`, because it is not used before.
    """

    time_s: float
    coverage: float
    decisions: int
    lengths: NDArray[np.float64]
    overlap: float
    known_shares: NDArray[np.float64] | None


@dataclass(frozen=True, slots=True, eq=False)
class _Curves:
    """Metrics over time.

    Attributes
    ----------
    times : (samples,) float64
        When [s]: at the start, every decision period, and at the end.
    c_free, c_known, c_valid : (samples,) float64
        Shares of F that were sensed, of all that can be known, and of F and its surface that the team's map
        knows.
    c_own : (samples, robots) float64
        Share of F that each robot holds to be free, by its own map or, if it reaches the robot, the
        team's.
    lengths : (samples, robots) float64
        Length of each robot's path [m].
    seen_once, seen_twice : (decisions,) int64
        Cells of F that one robot or more, and two or more, saw at once from their current poses, at the start and
        every decision period; both 0 if no two footprints could overlap.
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
    """Data for metrics over time, of the current or last episode.

    Attributes
    ----------
    truth : Truth
        Ground truth of the floor; after ``begin``.
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
        """Take the first sample; data of an earlier episode is dropped."""
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
        """Note the changes of this step; take a sample if it is time for one."""
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
        """Count a decision; take the last sample if all agents have ended."""
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

        Coverage is then at least the threshold. None if it was not reached.
        """
        return next((milestone for milestone in self.milestones if milestone.coverage >= share), None)

    @property
    def believed(self) -> NDArray[np.float64]:
        """Believed poses (times, robots, 3), in each robot's map frame [m, rad].

        They are at the times of the scorer's track.
        """
        return np.stack(self._believed)

    @property
    def curves(self) -> _Curves:
        """The metrics over time so far."""
        counts, sizes = np.stack(self._counts), np.maximum(self._tally.sizes, 1)
        team = counts[:, -1] / sizes
        held = counts[:, -1:] if self._tally.shares else counts[:, :-1]
        footprints = np.array(self._footprint_counts, np.int64).reshape(-1, 2)
        robots = counts.shape[1] - 1
        return _Curves(
            np.array(self._times),
            np.array(self._coverage),
            team[:, KNOWABLE],
            team[:, VALID],
            np.repeat(held[:, :, COUNTED], robots // held.shape[1], axis=1) / sizes[COUNTED],
            np.stack(self._lengths),
            footprints[:, 0],
            footprints[:, 1],
        )
