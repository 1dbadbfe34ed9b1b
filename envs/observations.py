"""Observations of a robot: the spaces, and the kernel that writes them.

The kernel writes the observations of all rows where the caller wants them.
"""

import math
import os
from collections.abc import Mapping
from itertools import starmap
from operator import itemgetter
from typing import Annotated, Any, NamedTuple

import numba
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lidarium.envs.settings.exploration import OBSERVABLES, ExplorationSettings
from lidarium.envs.simulation.kernels.arrays import (
    MAP,
    MAP_COLUMNS,
    MAP_ROWS,
    TOUCHED,
    TOUCHED_ROWS,
    world_at,
)
from lidarium.envs.simulation.kernels.scanning import RANGE_GAP
from lidarium.envs.simulation.simulation import ROWS_FOR_THREADS, Simulation
from lidarium.mapping.grids.map_crops import crop_levels, crop_turned
from lidarium.mapping.grids.pooled_maps import (
    POOL,
    POOL_COLUMNS,
    POOL_ROWS,
    forget_touched,
    pool_touched,
    touched_words,
)
from lidarium.mapping.kernels.compilation import Array, kernel, use_threads
from lidarium.mapping.kernels.views import arrays_at, grid_at, int8_grid_at, table_of, word_grid_at

FARTHEST = 1000.0
"""Bound of positions in observations [m]."""

KEYS = (*OBSERVABLES, "goal")
"""All that is ever observed, in the order in which the kernel takes the arrays."""

SCAN, POSE, VELOCITY, BUMPER, LEVELS, EGOCENTRIC_LEVELS, GOAL = range(len(KEYS))
"""Places of the arrays of ``KEYS``."""

Arrays = tuple[Array, ...]
"""Arrays that go to the kernel together.

A tuple costs no more than its arrays alone, where a named one costs twice as much.
"""


def observed_keys(settings: ExplorationSettings, has_goal: bool) -> tuple[str, ...]:
    """Return the keys of an observation.

    They are what the settings choose, and the goal where there is one.
    """
    return (*settings.observe, "goal") if has_goal else settings.observe


def observation_space(settings: ExplorationSettings, has_goal: bool) -> spaces.Dict:
    """Return the space of one robot's observation; every box is bounded."""
    boxes = _boxes(settings)
    return spaces.Dict({name: boxes[name] for name in observed_keys(settings, has_goal)})


def _boxes(settings: ExplorationSettings) -> dict[str, spaces.Box]:
    """Return the space of everything that can be observed."""
    robot, cells, own_cells = settings.robot, settings.map_cells, settings.egocentric_cells
    pose_limit = np.array([FARTHEST, FARTHEST, math.pi], np.float32)
    # The largest float32 angle that is wrapped from float64 may round up to the float32 above pi.
    pose_limit[2] = np.nextafter(np.float32(math.pi), np.float32(4.0))
    velocity_limit = np.array([robot.max_speed, robot.max_turn_rate], np.float32)
    return {
        "scan": spaces.Box(0.0, np.float32(settings.lidar.range_max), (settings.lidar.beams,), np.float32),
        "pose": spaces.Box(-pose_limit, pose_limit, dtype=np.float32),
        "velocity": spaces.Box(-velocity_limit, velocity_limit, dtype=np.float32),
        "bumper": spaces.Box(0, 1, (3,), np.int8),
        "map": spaces.Box(0, 255, (1, cells, cells), np.uint8),
        "egocentric_map": spaces.Box(
            0, 255, (len(settings.egocentric_scales), own_cells, own_cells), np.uint8
        ),
        "goal": spaces.Box(-FARTHEST, FARTHEST, (2,), np.float32),
    }


def action_space() -> spaces.Box:
    """Return the space of one robot's action.

    An action is speed and turn rate as shares of the robot's limits.
    """
    return spaces.Box(-1.0, 1.0, (2,), np.float32)


class Sources(NamedTuple):
    """What observations are written from.

    Attributes
    ----------
    world : (arrays, 3) int64
        The table of the world's arrays.
    offsets, goals : (rows, 2) float64
        Origin of each robot's map frame, and its goal, in the frame of its believed pose [m].
    pools : (rows, scales * 3) int64
        Address, rows and columns of each robot's pooled maps.
    limits : (4,) float64
        Resolution of the maps [m], and what ranges [m], speeds [m/s] and turn rates [rad/s] are clipped to.
    scales : (scales,) int64
        Scales of the pooled maps [cells].
    """

    world: Annotated[Array, np.int64, 2]
    offsets: Annotated[Array, np.float64, 2]
    goals: Annotated[Array, np.float64, 2]
    pools: Annotated[Array, np.int64, 2]
    limits: Annotated[Array, np.float64, 1]
    scales: Annotated[Array, np.int64, 1]


RESOLUTION, LONGEST_RANGE, TOP_SPEED, TOP_TURN_RATE = range(4)
"""Places in ``Sources.limits``."""


@kernel(borrowing=True)
def write_row(row: int, sources: Array, observed: Arrays) -> None:
    """Write a row of the arrays of ``KEYS``.

    Those of keys that are not observed hold no elements. See ``ObservationWriter.arguments``.
    """
    told = arrays_at(sources, Sources)
    world, offsets, goals, limits, scales = (
        world_at(told.world),
        told.offsets,
        told.goals,
        told.limits,
        told.scales,
    )
    ranges, believed, velocities, bumpers = world.ranges, world.believed, world.measured, world.bumpers
    beliefs, origins = world.belief_rows, world.origins
    scans, poses, motions, presses = observed[SCAN], observed[POSE], observed[VELOCITY], observed[BUMPER]
    maps, egocentric_maps, observed_goals = observed[LEVELS], observed[EGOCENTRIC_LEVELS], observed[GOAL]
    resolution, range_max = limits[RESOLUTION], limits[LONGEST_RANGE]
    max_speed, max_turn_rate = limits[TOP_SPEED], limits[TOP_TURN_RATE]
    farthest = np.float32(FARTHEST)
    if scans.size > 0:
        no_return, longest = np.float32(range_max), np.float32(range_max - RANGE_GAP)
        for beam in range(ranges.shape[1]):
            value = ranges[row, beam]
            hit = min(value, longest)
            scans[row, beam] = (
                no_return if value > no_return else (hit if value == value else np.float32(0.0))
            )
    if poses.size > 0:
        for axis in range(2):
            local = np.float32(believed[row, axis] - offsets[row, axis])
            poses[row, axis] = min(max(local, -farthest), farthest)
        poses[row, 2] = np.float32(believed[row, 2])
    if motions.size > 0:
        motions[row, 0] = np.float32(min(max(velocities[row, 0], -max_speed), max_speed))
        motions[row, 1] = np.float32(min(max(velocities[row, 1], -max_turn_rate), max_turn_rate))
    if presses.size > 0:
        for side in range(3):
            presses[row, side] = bumpers[row, side]
    if observed_goals.size > 0:
        for axis in range(2):
            local = np.float32(goals[row, axis] - offsets[row, axis])
            observed_goals[row, axis] = (
                min(max(local, -farthest), farthest) if local == local else np.float32(0.0)
            )
    if maps.size > 0 or egocentric_maps.size > 0:
        x, y = (
            (believed[row, 0] - origins[row, 0]) / resolution,
            (believed[row, 1] - origins[row, 1]) / resolution,
        )
        log_odds = int8_grid_at(beliefs[row, MAP], beliefs[row, MAP_ROWS], beliefs[row, MAP_COLUMNS])
        if maps.size > 0:
            crop_levels(log_odds, int(math.floor(y)), int(math.floor(x)), maps[row, 0])
        if egocentric_maps.size > 0:
            touched = word_grid_at(
                beliefs[row, TOUCHED], beliefs[row, TOUCHED_ROWS], touched_words(beliefs[row, MAP_COLUMNS])
            )
            pools = grid_at(
                told.pools.ctypes.data + row * told.pools.shape[1] * 8, scales.shape[0], 3, np.int64
            )
            for k in range(scales.shape[0]):
                if scales[k] > 1:
                    pool_touched(
                        log_odds,
                        touched,
                        scales[k],
                        int8_grid_at(pools[k, POOL], pools[k, POOL_ROWS], pools[k, POOL_COLUMNS]),
                    )
            forget_touched(touched, log_odds.shape[0])
            crop_turned(pools, x, y, believed[row, 2], scales, egocentric_maps[row])


@kernel
def _write_serial(active: Array, sources: Array, observed: Arrays) -> None:
    for row in range(active.shape[0]):
        if active[row]:
            write_row(row, sources, observed)


@kernel(parallel=True)
def _write_parallel(active: Array, sources: Array, observed: Arrays) -> None:
    for row in numba.prange(active.shape[0]):
        if active[row]:
            write_row(row, sources, observed)


class ObservationWriter:
    """Writes the observations of all rows of a world in one kernel call.

    It writes what the settings choose and nothing else.

    Parameters
    ----------
    simulation : Simulation
        Of the robots.
    settings : ExplorationSettings
        What is observed; sizes, limits and threads.
    offsets : (rows, 2) float64
        Origin of each robot's map frame in the frame of its believed pose [m]; read at each call.
    goals : (rows, 2) float64 or None
        Each robot's goal in the frame of its believed pose [m], nan where it does not know one; read at each
        call. None where there are no goals, which are not observed then.

    Attributes
    ----------
    keys : tuple of str
        What is observed.

    Raises
    ------
    ValueError
        Where the offsets or goals are of another type, or the world does not pool its maps at the scales that
        are observed.
    """

    def __init__(
        self,
        simulation: Simulation,
        settings: ExplorationSettings,
        offsets: NDArray[np.float64],
        goals: NDArray[np.float64] | None = None,
    ) -> None:
        self.keys = observed_keys(settings, goals is not None)
        self.rows = len(simulation.beliefs.believed)
        for name, array in (("offsets", offsets), ("goals", offsets if goals is None else goals)):
            if array.shape != (self.rows, 2) or array.dtype != np.float64 or not array.flags.c_contiguous:
                raise ValueError(
                    f"{name} are {array.dtype} {array.shape}; want float64 {(self.rows, 2)}, contiguous"
                )
        if "egocentric_map" in self.keys and simulation.beliefs.scales != settings.egocentric_scales:
            raise ValueError(
                f"the world pools its maps at scales {simulation.beliefs.scales}; want those of the "
                f"settings, {settings.egocentric_scales}"
            )
        kinds = {name: ((self.rows, *box.shape), box.dtype) for name, box in _boxes(settings).items()}
        self._kinds = [kinds[name] for name in self.keys]
        # The kernel takes the arrays of all keys, in their order; what is not observed stands behind what is.
        absent = [name for name in KEYS if name not in self.keys]
        self._absent = [np.empty((0,) * len(kinds[name][0]), kinds[name][1]) for name in absent]
        self._in_order = itemgetter(*((*self.keys, *absent).index(name) for name in KEYS))
        robot = settings.robot
        # The space's bounds are float32, and so are those to which values are clipped.
        limits = [
            float(np.float32(limit))
            for limit in (settings.lidar.range_max, robot.max_speed, robot.max_turn_rate)
        ]
        self._simulation = simulation
        self._told = (
            offsets,
            offsets if goals is None else goals,
            simulation.beliefs.pool_rows,
            np.array([settings.occupancy.resolution, *limits]),
            np.array(settings.egocentric_scales, np.int64),
        )
        self._sources: NDArray[np.int64] | None = None
        self._everyone = np.ones(self.rows, np.bool_)
        self._threads = (
            min(settings.threads, int(os.cpu_count() or 1)) if self.rows >= ROWS_FOR_THREADS else 1
        )

    def buffers(self) -> dict[str, NDArray[Any]]:
        """Return new arrays for the observations, by key.

        What they hold is undefined until it is written.
        """
        return {name: np.empty(*kind) for name, kind in zip(self.keys, self._kinds, strict=True)}

    def write(
        self, out: Mapping[str, NDArray[Any]] | None = None, active: NDArray[np.bool_] | None = None
    ) -> Mapping[str, NDArray[Any]]:
        """Write one observation a row.

        Parameters
        ----------
        out : dict of arrays or None
            Where to write, as ``buffers`` makes it; new arrays where None.
        active : (rows,) bool or None
            Which rows to write, the others keep what they hold; all where None.

        Returns
        -------
        dict of arrays
            ``out``, or the new arrays.

        Raises
        ------
        ValueError
            Where an array is missing or is not of the shape, type and order that is written.
        """
        arrays = list(starmap(np.empty, self._kinds)) if out is None else self.check(out)
        sources = self._table() if self._sources is None else self._sources
        chosen, observed = self._everyone if active is None else active, self._in_order(arrays + self._absent)
        if self._threads > 1:
            use_threads(self._threads)
            _write_parallel(chosen, sources, observed)
        else:
            _write_serial(chosen, sources, observed)
        return dict(zip(self.keys, arrays, strict=True)) if out is None else out

    def arguments(self, out: Mapping[str, NDArray[Any]]) -> tuple[Array, Arrays]:
        """Return what ``write_row`` takes beside the row.

        These are where the sources of the observations lie, and where to write, as ``buffers`` makes
        it.
        """
        sources = self._table() if self._sources is None else self._sources
        return sources, self._in_order([out[name] for name in self.keys] + self._absent)

    def _table(self) -> NDArray[np.int64]:
        """Return the addresses of the sources of the observations.

        They are the world's table, offsets, goals, pooled maps, limits and scales.
        """
        self._sources = table_of((self._simulation.table, *self._told))
        return self._sources

    def __getstate__(self) -> dict[str, Any]:
        # A copy's arrays lie elsewhere; where, is known when all of it has been made.
        return {**self.__dict__, "_sources": None}

    def check(self, out: Mapping[str, NDArray[Any]]) -> list[NDArray[Any]]:
        """Check arrays that a caller gives, and return them in the order of the keys.

        Raises
        ------
        ValueError
            Where an array is missing or is not of the shape, type and order that is written.
        """
        arrays = []
        for name, (shape, dtype) in zip(self.keys, self._kinds, strict=True):
            array = out.get(name)
            if array is None:
                raise ValueError(f"out has no array for {name}; want {', '.join(self.keys)}")
            if array.shape != shape or array.dtype != dtype or not array.flags.carray:
                raise ValueError(
                    f"the array for {name} is {array.dtype} {array.shape}; want {dtype} {shape}, contiguous "
                    "and writeable"
                )
            arrays.append(array)
        return arrays
