"""The simulation of teams: a world moves and senses, beliefs follow, the score counts."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.free_space import reachable_free_space
from lidarium.envs.settings.cameras import DepthCamera
from lidarium.envs.settings.lidar import Lidar, by_robot
from lidarium.envs.simulation.backend import World
from lidarium.envs.simulation.beliefs import Beliefs
from lidarium.envs.simulation.depth.depth_sensor import DepthSensor
from lidarium.envs.simulation.disturbances.noise import GAUSSIAN_TABLE
from lidarium.envs.simulation.disturbances.odometry import RADIUS
from lidarium.envs.simulation.kernels.arrays import (
    DEAD_RECKONING,
    KNOWN_TEAMMATES,
    OWN_FRAME,
    SOME_TEAMMATES,
    TRUE_POSE,
    sensor_numbers,
    table_of_owners,
)
from lidarium.envs.simulation.kernels.floor_cache import FloorTables
from lidarium.envs.simulation.kernels.stepping import (
    perceive_parallel,
    perceive_serial,
    render_row,
    score_and_localize,
)
from lidarium.envs.simulation.people.doors import with_shut_doors
from lidarium.envs.simulation.people.population import Population, no_people
from lidarium.envs.simulation.score import Score
from lidarium.mapping.geometry.rigid import composed, relative
from lidarium.mapping.grids.occupancy import OccupancySettings
from lidarium.mapping.grids.scan_integration import WORD
from lidarium.mapping.kernels.compilation import available_threads, use_threads
from lidarium.mapping.kernels.huge_pages import ArrayPool

ROWS_FOR_THREADS = 8
"""Threads pay only for batches of at least this many rows."""


def within_half_turns(starts: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return poses (robots, 3) with headings in (-pi, pi]; headings in that range keep their bits."""
    poses = np.array(starts, np.float64)
    headings = poses[:, 2]
    wrapped = math.pi - np.mod(math.pi - headings, 2.0 * math.pi)
    poses[:, 2] = np.where((headings > -math.pi) & (headings <= math.pi), headings, wrapped)
    return poses


@dataclass(frozen=True, slots=True)
class PoseSources:
    """Sources of the robots' pose information.

    Attributes
    ----------
    localization : str
        Localization of the robots: ``truth``, ``odometry``, or another, which writes ``beliefs.believed``
        before ``perceive``.
    knows_teammates : bool
        Whether, with known starts, all poses of teammates are known at once; otherwise those that
        ``beliefs.contact`` names.
    """

    localization: str = "truth"
    knows_teammates: bool = True


class Simulation:
    """A world of any kind, with the beliefs of its robots and its score.

    Row = episode * robots + robot. Maps of the score and of the beliefs share the floor's lattice: if a
    robot's believed pose is the true one, its map and its mask agree to the cell.

    Parameters
    ----------
    world : World
        Moves the bodies and senses.
    lidar : Lidar or sequence of Lidar
        The laser of every robot, or of each in order; see ``by_robot``.
    occupancy : OccupancySettings
        Resolution and sensor model of the maps; its cell must be a whole multiple of the floors' raster cell.
    time_step : float
        Length of a step [s].
    threads : int
        1 for the serial kernels; more lets batches of 8 rows and more run on numba's threads, with the same
        result.
    scales : sequence of int
        Scales at which maps are pooled for observations [cells].
    reward_weights : (4,) float64 or None
        Weights of ``scoring.rewards.TERMS``; nothing if None.
    pose_sources : PoseSources
        Sources of the robots' pose information.
    scan_steps : int
        Steps from scan to scan; those of the world.

    Attributes
    ----------
    world, beliefs, score : World, Beliefs, Score
        Its three parts.
    camera : DepthSensor or None
        The depth cameras of the robots, if they have any.
    """

    is_fused = False
    """Whether one kernel call runs a whole step, so that batches may call it themselves."""

    def __init__(
        self,
        world: World,
        lidar: Lidar | Sequence[Lidar],
        occupancy: OccupancySettings,
        time_step: float = 0.1,
        threads: int = 1,
        scales: Sequence[int] = (),
        reward_weights: NDArray[np.float64] | None = None,
        pose_sources: PoseSources = PoseSources(),
        scan_steps: int = 1,
    ) -> None:
        self.world, self.robots, self.episodes = world, world.robots, world.episodes
        localization = pose_sources.localization
        rows, is_true = self.robots * self.episodes, localization == "truth"
        self.beliefs = Beliefs(rows, self.robots, occupancy, scales, is_true, scan_steps == 1)
        self.score = Score(self.robots, self.episodes, reward_weights)
        self.lidars, self.occupancy, self.time_step = by_robot(lidar, self.robots), occupancy, time_step
        self.scan_steps = scan_steps
        self._flags = {"truth": TRUE_POSE, "odometry": DEAD_RECKONING}.get(localization, 0)
        self._teammate_flag = KNOWN_TEAMMATES if pose_sources.knows_teammates else SOME_TEAMMATES
        self.sensor = sensor_numbers(self.lidars, time_step, occupancy.resolution, scan_steps)
        self.unit_vectors = np.concatenate([each.unit_vectors for each in self.lidars])
        self.noise_table = GAUSSIAN_TABLE
        sensors = world.sensors
        self.ranges, self.odometry = sensors["scan"], sensors["odometry"]
        self.measured, self.bumpers = sensors["velocity"], sensors["bumper"]
        self.floor_rows, self.frames = np.zeros((self.episodes, 10), np.int64), np.zeros((self.episodes, 3))
        self._everywhere = np.ones(self.episodes, np.bool_)
        self._pool: ArrayPool | None = None
        self._threads = min(threads, available_threads())
        self._is_parallel = self.threads > 1
        # A world of a user's own may have no people.
        self.population: Population | None = getattr(world, "population", None)
        self.safety = no_people(self.robots * self.episodes) if self.population is None else self.population.safety
        self._table = self._make_table()
        self.camera: DepthSensor | None = None

    def _make_table(self) -> NDArray[np.int64]:
        return table_of_owners(self, self.world, self.beliefs, self.score, self.population)

    def mount(self, camera: DepthCamera) -> None:
        """Put a depth camera on each robot."""
        self.camera = DepthSensor(self.world, camera, self.time_step, self._threads)

    @property
    def sensors(self) -> Mapping[str, NDArray[Any]]:
        """Last measurements by sensor name: those of the world, and ``depth`` of the cameras."""
        sensors = self.world.sensors
        return sensors if self.camera is None else {**sensors, "depth": self.camera.frames}

    @property
    def scan_poses(self) -> NDArray[np.float64]:
        """True poses at which robots took their last scans, as their beliefs since then tell, (rows, 3) [m, rad]."""
        poses, beliefs = self.world.poses, self.beliefs
        return poses if self.scan_steps == 1 else composed(poses, relative(beliefs.believed, beliefs.scanned))

    @property
    def dead_reckoning(self) -> NDArray[np.float64]:
        """Poses by the wheels since the starts, (rows, 3) [m, rad].

        Wheels that do not err are not simulated unless a localizer reads them: they measure the true motion.
        """
        measures = len(getattr(self.world, "odometry_model", (0,))) > 0
        return self.odometry if measures else relative(self.world.starts, self.world.poses)

    def place(
        self,
        episode: int,
        floor: FloorTables,
        starts: NDArray[np.float64],
        seed: int,
        known_starts: bool = True,
    ) -> None:
        """Start an episode: robots at ``starts`` (robots, 3) of a floor, blank maps and masks.

        All draws come from ``seed``.
        """
        multiple = self._multiple(floor)
        first, last = episode * self.robots, (episode + 1) * self.robots
        starts = within_half_turns(starts)
        # Area that the laser cannot see does not count, even if a low body could pass below it.
        smallest = float(self.world.bodies[:, RADIUS].min())
        body = floor.body
        if self.population is not None and self.population.share:
            body = with_shut_doors(body, self.population.draw_doors(floor, starts, seed))
        free = reachable_free_space(body, smallest, starts) & (floor.laser.solid == 0)
        floors = enumerate(self.world.floors)
        same = [other for other, known in floors if other != episode and known is floor]
        counted = self.score.shared(free, multiple, same)
        rows, words = counted.shape
        # Arrays used in one step of an episode are stored together.
        if self._pool is None:
            # Log-odds take a byte a cell; masks and pooled maps hardly half of that.
            self._pool = ArrayPool(3 * counted.size * WORD * self.robots * self.episodes // 2)
        self.world.place(episode, floor, starts, free, seed)
        if self.camera is not None:
            self.camera.place(episode, floor)
        self.frames[episode] = floor.frame
        self.score.place(episode, counted, self._pool)
        for row in range(first, last):
            start = starts[row - first] if known_starts else None
            self.score.place_robot(row, self._pool)
            self.beliefs.place(row, floor, start, (rows, words * WORD), self._pool)
        self._point_at(episode)
        self.world.flags[first:last] = self._flags | (self._teammate_flag if known_starts else OWN_FRAME)
        self.beliefs.forget_changes(first, last)

    def _multiple(self, floor: FloorTables) -> int:
        """Return the number of raster cells along a map cell."""
        resolution, map_resolution = floor.laser.resolution, self.occupancy.resolution
        multiple = round(map_resolution / resolution)
        if multiple < 1 or abs(multiple * resolution - map_resolution) > 1e-9:
            raise ValueError(
                f"a map cell of {map_resolution} m is not a whole multiple of the floor's raster cell of {resolution} m"
            )
        return multiple

    def _point_at(self, episode: int) -> None:
        """Store the addresses of the floor, the maps and the masks of an episode, for kernels."""
        floor = self.world.floors[episode]
        if floor is not None:
            self.floor_rows[episode] = floor.row
        for row in range(episode * self.robots, (episode + 1) * self.robots):
            self.score.point_at(row)
            self.beliefs.point_at(row)

    @property
    def table(self) -> NDArray[np.int64]:
        """Addresses of all arrays, as kernels take them (``kernels.arrays``); never changes."""
        return self._table

    @property
    def threads(self) -> int:
        """Threads that kernels over the rows may use: 1 if there are too few rows to share out."""
        return self._threads if self.robots * self.episodes >= ROWS_FOR_THREADS else 1

    def use_threads(self) -> int:
        """Let parallel kernels run on the threads of this simulation, and return how many they may use."""
        return use_threads(self.threads)

    def step(
        self,
        commands: NDArray[np.float64],
        *,
        moves_bodies: bool = True,
        perceives: bool = True,
        runs: NDArray[np.bool_] | None = None,
    ) -> None:
        """Run a step of all episodes.

        Parameters
        ----------
        commands : (rows, 2) float64
            Wanted speed and turn rate [m/s, rad/s].
        runs : (episodes,) bool or None
            Which episodes take the step; all by default.
        """
        self.world.move_and_sense(commands, moves_bodies=moves_bodies, runs=runs)
        if self.camera is not None:
            self.camera.take(self.world.steps, runs)
        score_and_localize(self._table, self.robots, self._everywhere if runs is None else runs)
        if perceives:
            self.perceive(runs)

    def perceive(self, runs: NDArray[np.bool_] | None = None) -> None:
        """Update the maps by the last scans at the believed poses.

        Parameters
        ----------
        runs : (episodes,) bool or None
            Of which episodes; all by default.
        """
        perceive = perceive_parallel if self.use_threads() > 1 else perceive_serial
        perceive(self._table, self.robots, self._everywhere if runs is None else runs)

    def close(self) -> None:
        """Release everything of the world that is not an array; further calls do nothing."""
        self.world.close()

    def render_again(self, row: int, poses: NDArray[np.float64], ranges: NDArray[np.float32]) -> None:
        """Forget a robot's map and render it of scans.

        Parameters
        ----------
        poses : (scans, 3) float64
            Sensor poses of the scans, in the frame of its believed pose [m, rad].
        ranges : (scans, beams) float32
            The scans [m].
        """
        self.beliefs.wipe(row)
        render_row(self._table, row, self.robots, np.ascontiguousarray(poses), np.ascontiguousarray(ranges))

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name not in ("_table", "_pool")}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._pool = None
        self._table = self._make_table()
        for episode in range(self.episodes):
            self._point_at(episode)
