"""The kinematic world: the arrays of all episodes x robots, and the calls that step them.

Row = episode * robots + robot. Maps of the scorer and of the beliefs share the floor's lattice: where a
robot's believed pose is the true one, its map and its mask agree to the cell.
"""

import math
import os
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from lidarium.envs.floors.free_space import swept_free_space
from lidarium.envs.scoring.coverage import pack_bits
from lidarium.envs.settings.faults import NO_FAULTS, FaultSettings
from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.settings.odometry import ODOMETRY, OdometrySettings
from lidarium.envs.settings.robots import Robot
from lidarium.envs.simulation.backend import Sensed
from lidarium.envs.simulation.faults import FAULT_NUMBERS, plan_faults
from lidarium.envs.simulation.kinematic.arrays import (
    DEAD_RECKONING,
    KNOWN_MATES,
    OWN_FRAME,
    SOME_MATES,
    TRUE_POSE,
    WorldArrays,
)
from lidarium.envs.simulation.kinematic.belief_maps import blank, map_around_start, map_with_margin, wipe
from lidarium.envs.simulation.kinematic.floor_tables import FloorTables
from lidarium.envs.simulation.kinematic.stepping import (
    perceive_parallel,
    perceive_serial,
    render_row,
    step_rows,
    step_serial,
)
from lidarium.envs.simulation.noise import GAUSSIAN_TABLE
from lidarium.envs.simulation.odometry import WHEEL_NUMBERS, begin_wheels
from lidarium.mapping.grids.occupancy import WORD, OccupancySettings
from lidarium.mapping.grids.pooled_maps import untouched
from lidarium.mapping.kernels.compilation import use_threads
from lidarium.mapping.kernels.huge_pages import Pages
from lidarium.mapping.kernels.views import table_of

ROWS_FOR_THREADS = 8
"""Threads pay only for batches of at least this many rows."""


def counted_cells(body_free: NDArray[np.bool_], multiple: int) -> NDArray[np.bool_]:
    """Return the map cells whose world cells all count, for a map cell of ``multiple`` x ``multiple`` world cells."""
    rows, columns = (-(-size // multiple) * multiple for size in body_free.shape)
    padded = np.zeros((rows, columns), np.bool_)
    padded[: body_free.shape[0], : body_free.shape[1]] = body_free
    counted = np.ones((rows // multiple, columns // multiple), np.bool_)
    for i in range(multiple):
        for j in range(multiple):
            counted &= padded[i::multiple, j::multiple]
    return counted


def _within_half_turns(starts: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return poses (robots, 3) with headings in (-pi, pi], as all poses are told; what lies there already keeps its bits."""
    poses = np.array(starts, np.float64)
    headings = poses[:, 2]
    wrapped = math.pi - np.mod(math.pi - headings, 2.0 * math.pi)
    poses[:, 2] = np.where((headings > -math.pi) & (headings <= math.pi), headings, wrapped)
    return poses


class KinematicWorld:
    """Robots on floors, stepped by kernels.

    Parameters
    ----------
    robots : sequence of Robot
        The team of every episode.
    lidar : Lidar
        The laser of every robot.
    occupancy : OccupancySettings
        Resolution and sensor model of the maps; its cell must be a whole multiple of the floors' raster cell.
    time_step : float
        Length of a step [s].
    episodes : int
        Number of episodes.
    threads : int
        1 for the serial kernels; more lets batches of 8 rows and more run on numba's threads, with the same
        result.
    scales : sequence of int
        Scales at which maps are pooled for observations [cells].
    reward_weights : (4,) float64 or None
        What a new cell earns, and what a step, a contact and a metre cost; nothing where None.
    localization : str
        Who says where the robots are: ``truth``, ``odometry``, or another, which writes ``believed`` between
        the two stages.
    odometry : OdometrySettings
        How well wheels tell the way.
    faults : FaultSettings
        What goes wrong with the robots.
    horizon_s : float or None
        For how long faults are drawn [s].
    knows_mates : bool
        Whether, with known starts, all poses of teammates are known at once; otherwise those are that
        ``contact`` tells of.

    Attributes
    ----------
    poses, velocities, believed : (rows, 3), (rows, 2), (rows, 3) float64
        True poses and velocities; poses as the localizers believe, in the floor's axes where starts are
        known.
    ranges : (rows, beams) float32
        The last scans [m]; inf for no return, nan for an invalid beam.
    odometry : (rows, 3) float64
        Poses by dead reckoning since the start [m, rad]; kept where wheels do not tell the truth or somebody
        reckons with them.
    measured : (rows, 2) float64
        Speeds and turn rates as the encoders tell [m/s, rad/s]; ``velocities`` itself where they tell the
        truth.
    failed : (rows,) uint8
        Whether each robot is dead.
    gains : (rows,) float64
        Cells credited to each robot in the last step.
    contact, heard : (rows, robots) uint8, (rows, robots * 3) float64
        Of which teammates a robot knows the pose although not all are known, and these poses [m, rad]; the
        radio writes them.
    renderings : (rows,) int64
        How often each map was rendered anew.
    rewards : (rows,) float64
        What each robot has earned since this was last set to 0.
    seen : (rows,) int64
        Cells of F that each robot has seen.
    team_seen, counted : (episodes,) int64
        Cells of F that the team has seen, and the size of F.
    windows : (rows, 4) int64
        What part of each map has changed since ``forget_changes``: row_low, row_high, column_low,
        column_high.
    pool_rows : (rows, scales, 3) int64
        Address, rows and columns of each robot's pooled maps.
    """

    def __init__(
        self,
        robots: Sequence[Robot],
        lidar: Lidar,
        occupancy: OccupancySettings,
        time_step: float = 0.1,
        episodes: int = 1,
        threads: int = 1,
        scales: Sequence[int] = (),
        reward_weights: NDArray[np.float64] | None = None,
        localization: str = "truth",
        odometry: OdometrySettings = ODOMETRY["ideal"],
        faults: FaultSettings = NO_FAULTS,
        horizon_s: float | None = None,
        knows_mates: bool = True,
    ) -> None:
        self.lidar, self.occupancy, self.time_step = lidar, occupancy, time_step
        self.robots, self.episodes = len(robots), episodes
        rows = self.robots * episodes
        self.bodies = np.stack([robot.numbers for robot in robots])
        self.smallest_radius = float(self.bodies[:, 0].min())
        self.poses, self.velocities, self.believed = (
            np.zeros((rows, 3)),
            np.zeros((rows, 2)),
            np.zeros((rows, 3)),
        )
        self.starts = np.zeros((rows, 3))
        self.ranges = np.full((rows, lidar.beams), np.inf, np.float32)
        self.bumpers, self.contacts = np.zeros((rows, 3), np.int8), np.zeros(rows, np.uint8)
        self.moves, self.flags = np.ones(rows, np.uint8), np.zeros(rows, np.int64)
        self.travelled, self.collisions = np.zeros(rows), np.zeros(rows, np.int64)
        self.gains, self.seen = np.zeros(rows), np.zeros(rows, np.int64)
        self._reward_weights = np.zeros(4) if reward_weights is None else np.array(reward_weights, np.float64)
        self._rewarded, self.rewards = np.zeros(rows), np.zeros(rows)
        self._is_true, self._odometry, self._faults, self._horizon_s = (
            localization == "truth",
            odometry,
            faults,
            horizon_s,
        )
        self._flags = {"truth": TRUE_POSE, "odometry": DEAD_RECKONING}.get(localization, 0)
        is_plain = self._is_true and odometry.is_ideal
        self._odometry_model = np.zeros(0) if is_plain else odometry.numbers
        self._wheels, self.odometry = np.zeros((rows, WHEEL_NUMBERS)), np.zeros((rows, 3))
        self.measured = self.velocities if is_plain else np.zeros((rows, 2))
        self.faults, self.failed = np.zeros((rows, faults.capacity * FAULT_NUMBERS)), np.zeros(rows, np.uint8)
        self._driven, self.renderings = np.zeros((rows, 2)), np.zeros(rows, np.int64)
        self.contact, self.heard = np.zeros((rows, self.robots), np.uint8), np.zeros((rows, 3 * self.robots))
        self._mate_flag = KNOWN_MATES if knows_mates else SOME_MATES
        self.team_seen, self.counted = np.zeros(episodes, np.int64), np.zeros(episodes, np.int64)
        self.seeds, self.steps = np.zeros(episodes, np.uint64), np.zeros(episodes, np.int64)
        self.windows = np.zeros((rows, 4), np.int64)
        self.scales = tuple(scales)
        self._touched: list[NDArray[np.uint64]] = [untouched(0, WORD)] * rows
        self._pools: list[list[NDArray[np.int8]]] = [[] for _ in range(rows)]
        self.pool_rows = np.zeros((rows, len(self.scales), 3), np.int64)
        self.log_odds: list[NDArray[np.int8]] = [np.zeros((0, WORD), np.int8)] * rows
        self.masks: list[NDArray[np.uint64]] = [np.zeros((0, 1), np.uint64)] * rows
        self.team_masks: list[NDArray[np.uint64]] = [np.zeros((0, 1), np.uint64)] * episodes
        self.counted_masks: list[NDArray[np.uint64]] = [np.zeros((0, 1), np.uint64)] * episodes
        self.floors: list[FloorTables | None] = [None] * episodes
        self._floor_rows, self._frames = np.zeros((episodes, 10), np.int64), np.zeros((episodes, 3))
        self.belief_rows, self.origins = np.zeros((rows, 5), np.int64), np.zeros((rows, 2))
        self._mask_rows = np.zeros((rows, 5), np.int64)
        self._boxes = np.zeros((rows, 4), np.int64)
        self._unit_vectors, self._increments = lidar.unit_vectors, occupancy.increments
        self._sensor = np.array(
            [
                lidar.angle_first,
                lidar.angle_increment,
                float(lidar.is_full_circle),
                lidar.range_min,
                lidar.range_max,
                lidar.noise_floor,
                lidar.noise_share,
                lidar.height,
                occupancy.resolution,
                time_step,
            ]
        )
        self._everywhere = np.ones(episodes, np.bool_)
        self._pages: Pages | None = None
        self._threads = min(threads, int(os.cpu_count() or 1))
        self._choose_kernels()

    def place(
        self,
        episode: int,
        floor: FloorTables,
        starts: NDArray[np.float64],
        seed: int,
        known_starts: bool = True,
    ) -> None:
        """Start an episode: robots at ``starts`` (robots, 3) of a floor, blank maps and masks, noise from ``seed``.

        Raises
        ------
        ValueError
            Where the maps' cell is not a whole multiple of the floor's raster cell.
        """
        resolution, map_resolution = floor.laser.resolution, self.occupancy.resolution
        multiple = round(map_resolution / resolution)
        if multiple < 1 or abs(multiple * resolution - map_resolution) > 1e-9:
            raise ValueError(
                f"a map cell of {map_resolution} m is not a whole multiple of the floor's raster cell of {resolution} m"
            )
        first, last = episode * self.robots, (episode + 1) * self.robots
        starts = _within_half_turns(starts)
        # What the laser cannot look into does not count, even where a low body could pass below it.
        free = swept_free_space(floor.body, self.smallest_radius, starts) & (floor.laser.solid == 0)
        counted = self._shared(episode, floor, pack_bits(counted_cells(free, multiple)))
        rows, words = counted.shape
        # What an episode's step goes through lies together.
        if self._pages is None:
            # Log-odds take a byte a cell; masks and pooled maps hardly half of that.
            self._pages = Pages(3 * counted.size * WORD * self.robots * self.episodes // 2)
        pages = self._pages
        self.floors[episode] = floor
        self._frames[episode] = floor.frame
        self.counted_masks[episode], self.team_masks[episode] = counted, pages.blank(counted.shape, np.uint64)
        self.counted[episode] = int(np.bitwise_count(counted).sum())
        self.team_seen[episode], self.seeds[episode] = 0, seed
        # The scan at the start is taken before step 0.
        self.steps[episode] = -1
        self.poses[first:last], self.velocities[first:last] = starts, 0.0
        self.bumpers[first:last], self.contacts[first:last], self.moves[first:last] = 0, 0, 1
        self.ranges[first:last], self.seen[first:last], self.gains[first:last] = np.inf, 0, 0.0
        self.travelled[first:last], self.collisions[first:last] = 0.0, 0
        self._rewarded[first:last], self.rewards[first:last] = 0.0, 0.0
        self._wheels[first:last] = begin_wheels(self._odometry, self.robots, seed)
        self.odometry[first:last], self.measured[first:last], self.failed[first:last] = 0.0, 0.0, 0
        self.faults[first:last] = self._plan_faults(floor, free, starts, seed)
        for row in range(first, last):
            self.masks[row] = pages.blank(counted.shape, np.uint64)
            if known_starts and self._is_true:
                self.believed[row], self.origins[row] = starts[row - first], floor.laser.origin
                self.log_odds[row] = pages.blank((rows, words * WORD), np.int8)
            elif known_starts:
                self.believed[row] = starts[row - first]
                self.log_odds[row], self.origins[row] = map_with_margin(
                    pages, floor, rows, words * WORD, self.occupancy.resolution
                )
            else:
                self.believed[row] = 0.0
                self.log_odds[row], self.origins[row] = map_around_start(
                    pages, floor, self.occupancy.resolution
                )
            height, width = self.log_odds[row].shape
            # At scale 1 a map is its own pooled map.
            self._pools[row] = [
                pages.blank((-(-height // scale), -(-width // scale)), np.int8)
                if scale > 1
                else self.log_odds[row]
                for scale in self.scales
            ]
            self._touched[row] = pages.blank(untouched(height if self.scales else 0, width).shape, np.uint64)
        self._point_at(episode)
        self.starts[first:last] = starts
        self.contact[first:last], self.heard[first:last] = 0, 0.0
        self.flags[first:last] = self._flags | (self._mate_flag if known_starts else OWN_FRAME)
        self.forget_changes(first, last)

    def _shared(self, episode: int, floor: FloorTables, counted: NDArray[np.uint64]) -> NDArray[np.uint64]:
        """Return F, in the array of an episode on the same floor with the same F if there is one: less memory to go through in a step."""
        others = (other for other in range(self.episodes) if other != episode and self.floors[other] is floor)
        same = (self.counted_masks[other] for other in others)
        return next((mask for mask in same if np.array_equal(mask, counted)), counted)

    def _point_at(self, episode: int) -> None:
        """Fill the kernels' tables of addresses with where the episode's arrays lie."""
        floor = self.floors[episode]
        if floor is None:
            return
        self._floor_rows[episode] = floor.row
        counted, team = self.counted_masks[episode], self.team_masks[episode]
        for row in range(episode * self.robots, (episode + 1) * self.robots):
            self._mask_rows[row] = (
                self.masks[row].ctypes.data,
                team.ctypes.data,
                counted.ctypes.data,
                *counted.shape,
            )
            touched = self._touched[row]
            self.belief_rows[row] = (
                self.log_odds[row].ctypes.data,
                *self.log_odds[row].shape,
                touched.ctypes.data,
                len(touched),
            )
            for k, pooled in enumerate(self._pools[row]):
                self.pool_rows[row, k] = (pooled.ctypes.data, *pooled.shape)

    @property
    def table(self) -> NDArray[np.int64]:
        """Where the arrays lie, as kernels take them (``arrays.world_at``).

        The same for the life of the world.
        """
        return self._table

    @property
    def threads(self) -> int:
        """Threads that kernels over this world's rows may use: 1 where there are too few rows to share out."""
        return self._threads if self.robots * self.episodes >= ROWS_FOR_THREADS else 1

    def use_threads(self) -> None:
        """Let numba's parallel kernels run on this world's threads."""
        if self.threads > 1:
            use_threads(self.threads)

    def __getstate__(self) -> dict[str, Any]:
        return {
            name: value
            for name, value in self.__dict__.items()
            if name not in ("_step", "_perceive", "_table", "_pages")
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._pages = None
        self._choose_kernels()
        for episode in range(self.episodes):
            self._point_at(episode)

    def _choose_kernels(self) -> None:
        arrays = WorldArrays(
            self.bodies,
            self._sensor,
            self._unit_vectors,
            GAUSSIAN_TABLE,
            self._increments,
            self._floor_rows,
            self._frames,
            self.seeds,
            self.steps,
            self.team_seen,
            self.moves,
            self.flags,
            self.poses,
            self.velocities,
            self.starts,
            self.believed,
            self.ranges,
            self.belief_rows,
            self.origins,
            self.windows,
            self._mask_rows,
            self._boxes,
            self.seen,
            self.gains,
            self.bumpers,
            self.contacts,
            self.travelled,
            self.collisions,
            self._reward_weights,
            self._rewarded,
            self.rewards,
            self._odometry_model,
            self._wheels,
            self.odometry,
            self.measured,
            self.faults,
            self.failed,
            self._driven,
            self.contact,
            self.heard,
        )
        self._table = table_of(arrays)
        is_parallel = self.threads > 1
        self._step = step_rows if is_parallel else step_serial
        self._perceive = perceive_parallel if is_parallel else perceive_serial

    def _plan_faults(
        self, floor: FloorTables, free: NDArray[np.bool_], starts: NDArray[np.float64], seed: int
    ) -> NDArray[np.float64]:
        """Return the faults of an episode, kidnappings to places that the robots could have reached by themselves."""
        if self._faults.capacity == 0:
            return np.zeros((self.robots, 0))
        x, y = floor.laser.origin
        room = np.asarray(ndimage.distance_transform_edt(free)) * floor.laser.resolution
        rows, columns = np.nonzero(room > self.bodies[:, 0].max() + floor.laser.resolution)
        places = (np.stack([columns, rows], axis=1) + 0.5) * floor.laser.resolution + (x, y)
        somewhere = np.asarray(places if len(places) else starts[:, :2], np.float64)
        return plan_faults(self._faults, self.robots, seed, self.time_step, self._horizon_s, somewhere)

    def render_anew(self, row: int, poses: NDArray[np.float64], ranges: NDArray[np.float32]) -> None:
        """Forget a robot's map and render it of scans (scans, beams) taken at ``poses`` (scans, 3) in the frame of its believed pose."""
        wipe(self.log_odds[row], self._touched[row], self.windows[row])
        render_row(self._table, row, self.robots, np.ascontiguousarray(poses), np.ascontiguousarray(ranges))
        self.renderings[row] += 1

    def forget(self, row: int, where: NDArray[np.bool_], corner: tuple[int, int]) -> None:
        """Make cells of a robot's map unknown: those of a mask (rows, columns) whose first cell is that of ``corner`` (row, column)."""
        blank(self.log_odds[row], where, corner, self._touched[row], self.windows[row])

    def forget_changes(self, first: int, last: int) -> None:
        """Start anew to note what part of the maps changes, for rows ``first`` to ``last``."""
        for row in range(first, last):
            map_rows, map_columns = self.log_odds[row].shape
            self.windows[row] = (map_rows, 0, map_columns, 0)

    def step(
        self,
        commands: NDArray[np.float64],
        *,
        moves_bodies: bool = True,
        perceives: bool = True,
        runs: NDArray[np.bool_] | None = None,
    ) -> None:
        """Run a step of all episodes, both stages in one call.

        Parameters
        ----------
        commands : (rows, 2) float64
            Wanted speed and turn rate [m/s, rad/s].
        moves_bodies : bool
            False for the first scan of an episode, taken where the robots stand.
        perceives : bool
            False for stage one alone; ``perceive`` is stage two.
        runs : (episodes,) bool or None
            Which episodes take the step; all where None.
        """
        self.use_threads()
        self._step(
            self._table,
            self.robots,
            commands,
            self._everywhere if runs is None else runs,
            moves_bodies,
            perceives,
        )

    def move_and_sense(self, commands: NDArray[np.float64], step: int) -> Sensed:
        """Run stage one alone and return what it brings.

        The arrays are the world's own, valid until the next step.
        """
        self.steps[:] = step
        self.step(commands, perceives=False)
        return Sensed(self.ranges, self.measured, self.bumpers, self.contacts, self.poses)

    def perceive(self, runs: NDArray[np.bool_] | None = None) -> None:
        """Run stage two alone, of all episodes or those with ``runs`` (episodes,): maps follow ``ranges`` at the believed poses."""
        self.use_threads()
        self._perceive(self._table, self.robots, self._everywhere if runs is None else runs)

    def coverage(self, episode: int) -> float:
        """Return the sensed share of F, ``C_free``."""
        return float(self.team_seen[episode] / max(int(self.counted[episode]), 1))

    def coverages(self) -> NDArray[np.float64]:
        """Return the sensed share of F of every episode, ``C_free``, shape (episodes,)."""
        return np.asarray(self.team_seen / np.maximum(self.counted, 1))
