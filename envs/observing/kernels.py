"""Kernels that write observations."""

import math
from typing import Annotated, NamedTuple

import numba
import numpy as np

from lidarium.envs.observing.spaces import FARTHEST, KEYS
from lidarium.envs.simulation.kernels.arrays import (
    MAP,
    MAP_COLUMNS,
    MAP_ROWS,
    RANGE_MAX,
    TOUCHED,
    TOUCHED_ROWS,
    WorldArrays,
    world_at,
)
from lidarium.envs.simulation.kernels.scanning import RANGE_GAP
from lidarium.mapping.grids.map_crops import crop_levels, crop_turned
from lidarium.mapping.grids.pooled_maps import (
    POOL,
    POOL_COLUMNS,
    POOL_ROWS,
    forget_touched,
    pool_touched,
    touched_words,
)
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.views import arrays_at, grid_at

SCAN, POSE, VELOCITY, BUMPER, LEVELS, EGOCENTRIC_LEVELS, GOAL = range(len(KEYS))
"""Places of the arrays of ``KEYS``."""


Arrays = tuple[Array, ...]
"""Arrays that go to the kernel together.

A tuple costs no more than its arrays alone; a named one costs twice as much.
"""


class _Sources(NamedTuple):
    """Arrays that observations are written from.

    Attributes
    ----------
    world : (arrays, 3) int64
        The table of the world's arrays.
    offsets, goals : (rows, 2) float64
        Origin of each robot's map frame, and its goal, in the frame of its believed pose [m].
    pools : (rows, scales * 3) int64
        Address, rows and columns of each robot's pooled maps.
    limits : (3,) float64
        Resolution of the maps [m], and limits of speeds [m/s] and turn rates [rad/s].
    scales : (scales,) int64
        Scales of the pooled maps [cells].
    """

    world: Annotated[Array, np.int64, 2]
    offsets: Annotated[Array, np.float64, 2]
    goals: Annotated[Array, np.float64, 2]
    pools: Annotated[Array, np.int64, 2]
    limits: Annotated[Array, np.float64, 1]
    scales: Annotated[Array, np.int64, 1]


RESOLUTION, TOP_SPEED, TOP_TURN_RATE = range(3)
"""Places in ``_Sources.limits``."""


@kernel(inline="always")
def _write_maps(row: int, world: WorldArrays, given: _Sources, maps: Array, egocentric_maps: Array) -> None:
    """Write the crops of a robot's map, each if it is observed."""
    believed, origins, beliefs = world.believed, world.origins, world.belief_rows
    resolution = given.limits[RESOLUTION]
    x, y = (
        (believed[row, 0] - origins[row, 0]) / resolution,
        (believed[row, 1] - origins[row, 1]) / resolution,
    )
    log_odds = grid_at(beliefs[row, MAP], beliefs[row, MAP_ROWS], beliefs[row, MAP_COLUMNS], np.int8)
    if maps.size > 0:
        crop_levels(log_odds, int(math.floor(y)), int(math.floor(x)), maps[row, 0])
    if egocentric_maps.size > 0:
        touched = grid_at(
            beliefs[row, TOUCHED],
            beliefs[row, TOUCHED_ROWS],
            touched_words(beliefs[row, MAP_COLUMNS]),
            np.uint64,
        )
        pools = grid_at(given.pools.ctypes.data + row * given.pools.shape[1] * 8, given.scales.shape[0], 3, np.int64)
        for k in range(given.scales.shape[0]):
            if given.scales[k] > 1:
                pool_touched(
                    log_odds,
                    touched,
                    given.scales[k],
                    grid_at(pools[k, POOL], pools[k, POOL_ROWS], pools[k, POOL_COLUMNS], np.int8),
                )
        forget_touched(touched, log_odds.shape[0])
        crop_turned(pools, x, y, believed[row, 2], given.scales, egocentric_maps[row])


@kernel(nrt=False)
def write_row(row: int, sources: Array, observed: Arrays) -> None:
    """Write a row of the arrays of ``KEYS``.

    Those of keys that are not observed hold no elements. See ``ObservationWriter.arguments``.
    """
    given = arrays_at(sources, _Sources)
    world, offsets, goals, limits = world_at(given.world), given.offsets, given.goals, given.limits
    ranges, believed, velocities, bumpers = world.ranges, world.believed, world.measured, world.bumpers
    scans, poses, motions, presses = observed[SCAN], observed[POSE], observed[VELOCITY], observed[BUMPER]
    maps, egocentric_maps, observed_goals = observed[LEVELS], observed[EGOCENTRIC_LEVELS], observed[GOAL]
    max_speed, max_turn_rate = limits[TOP_SPEED], limits[TOP_TURN_RATE]
    farthest = np.float32(FARTHEST)
    if scans.size > 0:
        no_return = np.float32(world.sensor[row % world.sensor.shape[0], RANGE_MAX])
        longest = np.float32(np.float64(no_return) - RANGE_GAP)
        for beam in range(ranges.shape[1]):
            value = ranges[row, beam]
            hit = min(value, longest)
            scans[row, beam] = no_return if value > no_return else (hit if value == value else np.float32(0.0))
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
            observed_goals[row, axis] = min(max(local, -farthest), farthest) if local == local else np.float32(0.0)
    if maps.size > 0 or egocentric_maps.size > 0:
        _write_maps(row, world, given, maps, egocentric_maps)


@kernel
def write_serial(active: Array, sources: Array, observed: Arrays) -> None:
    """Write the observations of the active rows, one after the other."""
    for row in range(active.shape[0]):
        if active[row]:
            write_row(row, sources, observed)


@kernel(parallel=True)
def write_parallel(active: Array, sources: Array, observed: Arrays) -> None:
    """Write the observations of the active rows on threads."""
    for row in numba.prange(active.shape[0]):
        if active[row]:
            write_row(row, sources, observed)
