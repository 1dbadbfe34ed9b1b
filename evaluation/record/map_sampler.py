"""Samples the team's three-level map as the changes since the sample before."""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.evaluation.record.display import MapChanges
from lidarium.evaluation.truth.beliefs import cells_beyond
from lidarium.mapping.grids.map_deltas import OverlaidMaps, note_changes, note_overlaid_changes

FAR = 1e5
"""How far from a robot a map may have changed that was rendered again [m]."""


class MapSampler:
    """Follows the team's map of an episode; the first sample is taken when it is made.

    The map is the sign of the sum of the robots' log-odds, those that do not know their starts overlaid over
    the floor by their true starts, as in ``result.json`` and the map files.

    Parameters
    ----------
    env : ExplorationEnv
        After ``reset``.
    period_s : float
        Longest time between samples [s].

    Attributes
    ----------
    origin : (x, y)
        Lower left corner of cell (0, 0) in the floor's frame [m].
    shape : (rows, words)
        Rows of the map, and words of 64 cells in a row.
    """

    def __init__(self, env: ExplorationEnv, period_s: float) -> None:
        world, settings = env.world, env.settings
        tables = world.floors[0]
        assert tables is not None
        self.origin: tuple[float, float] = tables.laser.origin
        self.shape: tuple[int, int] = (
            env.score.counted_masks[0].shape[0],
            env.score.counted_masks[0].shape[1],
        )
        self._env, self._time_step, self._resolution = (
            env,
            settings.time_step,
            settings.occupancy.resolution,
        )
        self._frame = np.array([*self.origin, self._resolution])
        self._known, self._occupied = np.zeros(self.shape, np.uint64), np.zeros(self.shape, np.uint64)
        self._buffer = np.empty((self.shape[0] * self.shape[1], 3), np.uint64)
        # Between two samples a robot gets no further from both places than half of what it can drive.
        self._reach = (
            settings.lidar.range_max
            + 0.5 * settings.speed_limits[:, 0].max() * period_s
            + 4 * self._resolution
        )
        self._last = env.beliefs.believed[:, :2].copy()
        self._is_overlaid = not settings.known_starts
        self._maps = env.beliefs.belief_rows.copy()
        if settings.known_starts:
            for row in range(settings.robots):
                first_row, first_column = cells_beyond(env, row)
                self._maps[row, 0] += first_row * self._maps[row, 2] + first_column
        self._renderings = env.beliefs.renderings.copy()
        self._placements = _overlays_of(env, self.origin)
        self._before = (
            [np.zeros(log_odds.shape, np.int8) for log_odds in env.beliefs.log_odds]
            if self._is_overlaid
            else []
        )
        self._before_at = np.array([log_odds.ctypes.data for log_odds in self._before], np.int64)
        self._steps: list[int] = []
        self._changes: list[NDArray[np.uint64]] = []
        self.sample()

    def sample(self) -> None:
        """Take a sample; once in a step."""
        world = self._env.world
        step = int(world.steps[0])
        if self._steps and step <= self._steps[-1]:
            return
        planes = (self._known, self._occupied, self._buffer)
        is_new = not np.array_equal(self._renderings, self._env.beliefs.renderings)
        reach = FAR if is_new else self._reach
        self._renderings[:] = self._env.beliefs.renderings
        if self._is_overlaid:
            overlaid = OverlaidMaps(
                self._env.beliefs.belief_rows, self._before_at, self._placements, self._resolution
            )
            count = note_overlaid_changes(overlaid, self._env.beliefs.believed, self._last, reach, *planes)
        else:
            count = note_changes(
                self._maps, self._env.beliefs.believed, self._last, reach, self._frame, *planes
            )
        self._steps.append(step)
        self._changes.append(self._buffer[:count].copy())

    def changes(self) -> MapChanges:
        """Return all samples so far."""
        changes = np.concatenate(self._changes)
        counts = np.array([len(change) for change in self._changes], np.int64)
        places = changes[:, 0].astype(np.int64)
        # Words above each other are alike, so that in this order they take less room when they are
        # compressed.
        order = np.lexsort((places, np.repeat(np.arange(len(counts)), counts)))
        times = np.array(self._steps) * self._time_step
        return MapChanges(*self.shape, times, counts, places[order], changes[order, 1], changes[order, 2])


def _overlays_of(env: ExplorationEnv, origin: tuple[float, float]) -> NDArray[np.float64]:
    """Return how maps in the frames of the starts lie over the floor's lattice.

    It is in the form that ``note_overlaid_changes`` takes.
    """
    world = env.world
    return np.array(
        [
            (*origin, x, y, math.cos(theta), math.sin(theta), *own_origin)
            for (x, y, theta), own_origin in zip(world.starts, env.beliefs.origins, strict=True)
        ]
    )
