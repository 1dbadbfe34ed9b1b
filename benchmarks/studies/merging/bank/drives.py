"""Partial maps of robots that really drive.

Noisy scans are drawn into a map at poses that err a little, as those of a localizer do.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.agents import make_policy
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.floors.floor import Floor
from lidarium.envs.floors.starts import draw_starts
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.making import make_settings
from lidarium.envs.simulation.kernels.floor_cache import floor_tables
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.watching import WatchedExploration, Watcher
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import UNKNOWN, OccupancyGrid

RESOLUTION = 0.025
"""Side of the maps' cells [m]."""

STARTS, RUNS = 3, 2
SNAPSHOTS = (1.0 / 3.0, 2.0 / 3.0, 0.95)
"""Shares of the floor that a robot has seen when its map is kept. What it has not reached by the end is kept then."""

HORIZON_S = 300.0
_MARGIN = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseError:
    """Errors of a pose that change smoothly with time.

    `distance_m`: largest error of the position [m]; `angle`: largest error of the heading [rad]; `shortest_s`,
    `longest_s`: periods of the waves that it is made of [s].
    """

    distance_m: float = 0.04
    angle: float = math.radians(0.3)
    shortest_s: float = 25.0
    longest_s: float = 120.0


@dataclass(frozen=True, slots=True, eq=False)
class Snapshot:
    """A map that a robot had made by some time.

    `levels` (rows, columns) uint8: what was known and a small margin; `floor_from_map`: where the map's lower left
    corner truly lies in the floor's frame; `time_s`, `coverage`: when [s], and what share of the floor was seen.
    """

    levels: NDArray[np.uint8]
    floor_from_map: Transform
    time_s: float
    coverage: float


class MapMaker(Watcher):
    """Draws the scans of a watched robot into a map of its own."""

    def __init__(self, error: PoseError, seed: int, shares: tuple[float, ...] = SNAPSHOTS) -> None:
        self.snapshots: list[Snapshot] = []
        self._shares = list(shares)
        self._waves = _Waves(error, np.random.default_rng(seed))

    def begin(self, env: ExplorationEnv) -> None:
        """Draw the first scan."""
        self._start = Transform(*env.world.starts[0].tolist())
        self._grid = OccupancyGrid(env.settings.occupancy)
        self.step(env, np.zeros((1, 2)))

    def step(self, env: ExplorationEnv, _commands: NDArray[np.float64]) -> None:
        """Draw a scan; keep the map if it is time for a snapshot."""
        world, scorer = env.world, env.scorer
        x, y, theta = self._waves.at(scorer.time)
        pose = self._start.inverse() @ Transform(*world.poses[0].tolist())
        lidar = env.settings.lidar
        noise = (lidar.noise_floor, lidar.noise_share)
        self._grid.integrate((pose.x + x, pose.y + y, pose.theta + theta), env.simulation.ranges[0], lidar, noise)
        while self._shares and scorer.coverage >= self._shares[0]:
            self._keep(scorer.time, scorer.coverage)

    def outcome(self, env: ExplorationEnv) -> None:
        """Keep what is left to be kept at the end."""
        while not env.agents and self._shares:
            self._keep(env.scorer.time, env.scorer.coverage)

    def _keep(self, time_s: float, coverage: float) -> None:
        self._shares.pop(0)
        levels = self._grid.levels()
        rows, columns = (np.flatnonzero((levels != UNKNOWN).any(axis=axis)) for axis in (1, 0))
        row, column = max(int(rows[0]) - _MARGIN, 0), max(int(columns[0]) - _MARGIN, 0)
        cut = levels[row : int(rows[-1]) + 1 + _MARGIN, column : int(columns[-1]) + 1 + _MARGIN].copy()
        x, y = self._grid.origin
        corner = Transform(x + column * RESOLUTION, y + row * RESOLUTION, 0.0)
        self.snapshots.append(Snapshot(cut, self._start @ corner, time_s, coverage))


class _Waves:
    """Sums of waves, each within its bound."""

    def __init__(self, error: PoseError, generator: np.random.Generator) -> None:
        waves = 3
        self._rates = 2.0 * math.pi / generator.uniform(error.shortest_s, error.longest_s, (3, waves))
        self._phases = generator.uniform(0.0, 2.0 * math.pi, (3, waves))
        shares = generator.uniform(0.5, 1.0, (3, waves))
        bounds = np.array([error.distance_m / math.sqrt(2.0), error.distance_m / math.sqrt(2.0), error.angle])
        self._sizes = bounds[:, None] * shares / shares.sum(axis=1, keepdims=True)

    def at(self, time_s: float) -> tuple[float, float, float]:
        """Return the error of x, y [m] and of theta [rad]."""
        x, y, theta = (self._sizes * np.sin(self._rates * time_s + self._phases)).sum(axis=1).tolist()
        return x, y, theta


def bank_settings() -> ExplorationSettings:
    """Return the settings of the bank's drives.

    They are one robot, its laser with 3 cm of noise, and maps of 2.5 cm.
    """
    return make_settings(
        robots=1, known_starts=False, noise="thesis", resolution=RESOLUTION, horizon_s=HORIZON_S, stop_coverage=0.97
    )


def bank_starts(floor: Floor, seed: int) -> NDArray[np.float64]:
    """Return where robots start on a floor, shape (STARTS, 3) [m, rad].

    Starts are those that the floor proposes, else drawn ones.
    """
    settings = bank_settings()
    tables = floor_tables(floor, settings.raster_resolution, settings.lidar.height, settings.robot.height)
    return draw_starts(tables.body, settings.robot.radius, STARTS, np.random.default_rng(seed), floor.starts)


def drive(
    floor: Floor,
    start: NDArray[np.float64],
    seed: int,
    error: PoseError | None = None,
    shares: tuple[float, ...] = SNAPSHOTS,
) -> list[Snapshot]:
    """Let a robot explore a floor and return its map at three times.

    `start` (3,) float64: from where [m, rad].
    """
    maker = MapMaker(error or PoseError(), seed, shares)
    env = WatchedExploration(floor, bank_settings(), watchers=[maker])
    run_episode(make_policy("nearest_frontier"), env, seed, {"starts": [start.tolist()]})
    return maker.snapshots
