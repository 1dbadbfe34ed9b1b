"""Watches an episode that runs again, for its replay on a page.

It samples the robots' own maps, the team's, scans and believed poses.
"""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.evaluation.episodes.watching import Watcher
from lidarium.evaluation.report.page.map_layers import Grid, Layer, coarse, grid_around
from lidarium.evaluation.truth.beliefs import believed_on_floor, map_within
from lidarium.evaluation.truth.true_map import occupied_in_truth, truth_of

MAP_PERIOD_S, SCAN_PERIOD_S = 1.0, 0.4
"""Least time between samples of maps, and of scans [s]; that of scans is a multiple of that of poses."""

MOST_MAPS, MOST_SCANS = 600, 1500
"""Most samples of an episode: those of a longer one are further apart."""

MOST_BEAMS = 60
"""Most beams of a scan of the page."""


@dataclass(slots=True)
class Samples:
    """What a page shows of an episode beside its record.

    Attributes
    ----------
    grid : Grid
        Which part of the lattice of the maps is shown.
    truth : Layer
        What is occupied.
    team : Layer
        The sum of all maps.
    own : list of Layer
        What each robot has mapped itself; none where there is one robot, whose map is the team's.
    map_times, scan_times : list of float
        When samples were taken [s].
    scans : list of (robots, beams) float32
        Ranges [m]; inf for no return.
    believed : list of (robots, 3) float64
        Believed poses in the floor's frame, with the scans; none where poses are true.
    """

    grid: Grid
    truth: Layer
    team: Layer
    own: list[Layer]
    map_times: list[float] = field(default_factory=list)
    scan_times: list[float] = field(default_factory=list)
    scans: list[NDArray[np.float32]] = field(default_factory=list)
    believed: list[NDArray[np.float64]] = field(default_factory=list)


class ReplaySampler(Watcher):
    """Samples an episode as it runs.

    Parameters
    ----------
    duration_s : float
        How long the episode is [s].
    """

    samples: Samples

    def __init__(self, duration_s: float) -> None:
        self._map_period = max(MAP_PERIOD_S, duration_s / MOST_MAPS)
        scans = max(SCAN_PERIOD_S, duration_s / MOST_SCANS)
        self._scan_period = SCAN_PERIOD_S * math.ceil(scans / SCAN_PERIOD_S - 1e-9)

    def begin(self, env: ExplorationEnv) -> None:
        """Choose what is shown, and take the first samples."""
        settings, truth = env.settings, truth_of(env)
        grid = grid_around(truth.knowable, settings.occupancy.resolution)
        own = settings.robots if settings.robots > 1 else 0
        self.samples = Samples(
            grid, Layer.blank(grid), Layer.blank(grid), [Layer.blank(grid) for _ in range(own)]
        )
        occupied = occupied_in_truth(env)[grid.window]
        self.samples.truth.add(coarse(occupied, np.zeros_like(occupied), grid.block))
        self._reach = settings.lidar.range_max + settings.speed_limits[:, 0].max() * self._map_period + 0.5
        self._renderings = env.beliefs.renderings.copy()
        self._steps_of_map = max(round(self._map_period / settings.time_step), 1)
        self._steps_of_scan = max(round(self._scan_period / settings.time_step), 1)
        self._stride = -(-settings.lidar.beams // MOST_BEAMS)
        self._last = self._places(env)
        self._sample_maps(env, is_whole=True)
        self._sample_scans(env)

    def step(self, env: ExplorationEnv, commands: NDArray[np.float64], /) -> None:
        """Take samples where it is time."""
        steps = int(env.world.steps[0])
        if steps % self._steps_of_scan == 0:
            self._sample_scans(env)
        if steps % self._steps_of_map == 0:
            self._sample_maps(env)

    def finish(self, env: ExplorationEnv) -> Samples:
        """Take the last samples, and return all."""
        self._sample_maps(env, is_whole=True)
        return self.samples

    def beam_angles(self, env: ExplorationEnv) -> list[float]:
        """Return the angles of the sampled beams against the heading [rad]."""
        return [round(float(angle), 5) for angle in env.settings.lidar.angles[:: self._stride]]

    def _sample_scans(self, env: ExplorationEnv) -> None:
        samples = self.samples
        samples.scan_times.append(int(env.world.steps[0]) * env.settings.time_step)
        samples.scans.append(np.array(env.simulation.ranges[:, :: self._stride], np.float32))
        if env.settings.localization != "truth":
            samples.believed.append(believed_on_floor(env))

    def _places(self, env: ExplorationEnv) -> NDArray[np.float64]:
        """Return where robots are and believe to be, (2 robots, 2) [m]."""
        return np.concatenate([env.world.poses[:, :2], believed_on_floor(env)[:, :2]])

    def _sample_maps(self, env: ExplorationEnv, *, is_whole: bool = False) -> None:
        """Take a sample of all maps; they change near the robots only, unless they were rendered again."""
        samples, grid, block = self.samples, self.samples.grid, self.samples.grid.block
        is_whole |= not np.array_equal(self._renderings, env.beliefs.renderings)
        self._renderings[:] = env.beliefs.renderings
        places = self._places(env)
        rows, columns = self._changed(env, np.concatenate([places, self._last]), is_whole)
        self._last = places
        window = (
            slice(grid.row + rows.start * block, grid.row + rows.stop * block),
            slice(grid.column + columns.start * block, grid.column + columns.stop * block),
        )
        maps = [map_within(env, row, *window) for row in range(env.settings.robots)]
        together = np.asarray(np.sum(maps, axis=0, dtype=np.int16))
        of_layers: list[NDArray[np.signedinteger[Any]]] = [together, *maps]
        for layer, log_odds in zip([samples.team, *samples.own], of_layers, strict=False):
            levels = layer.levels.copy()
            levels[rows, columns] = coarse(np.asarray(log_odds > 0), np.asarray(log_odds < 0), block)
            layer.add(levels)
        samples.map_times.append(int(env.world.steps[0]) * env.settings.time_step)

    def _changed(
        self, env: ExplorationEnv, places: NDArray[np.float64], is_whole: bool
    ) -> tuple[slice, slice]:
        """Return the rows and columns of the page's grid that may have changed."""
        grid = self.samples.grid
        if is_whole:
            return slice(0, grid.rows), slice(0, grid.columns)
        tables, resolution = env.world.floors[0], env.settings.occupancy.resolution
        assert tables is not None
        corner = np.array(tables.laser.origin) + np.array([grid.column, grid.row]) * resolution
        low = (places.min(axis=0) - self._reach - corner) / (grid.block * resolution)
        high = (places.max(axis=0) + self._reach - corner) / (grid.block * resolution)
        sides = []
        for axis, size in ((1, grid.rows), (0, grid.columns)):
            first = min(max(int(low[axis]), 0), size)
            sides.append(slice(first, min(max(int(high[axis]) + 1, first), size)))
        return sides[0], sides[1]
