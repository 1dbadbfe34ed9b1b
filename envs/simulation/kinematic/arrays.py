"""The arrays of a world, as its kernels take them: one table of addresses in place of thirty arguments.

A kernel views the arrays where they lie. Arrays handed over as arguments would be counted as references at
every use, by all threads in the same places of memory; views are not.
"""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.views import grid_at, vector_at

TRUE_POSE, KNOWN_MATES, ENDED, OWN_FRAME, DEAD_RECKONING, SOME_MATES = 1, 2, 4, 8, 16, 32
"""Flags of a row: the localizer knows the true pose; teammates' poses are known; the robot has ended (its
body stands there, its sensors are off); it believes in the frame of its own start; its localizer reckons from
its odometry alone; the poses of those teammates are known that the radio told of."""


class WorldArrays(NamedTuple):
    """Arrays over episodes, robots of a team, and rows = episodes x robots.

    Attributes
    ----------
    bodies : (robots, 8) float64
        ``Robot.numbers`` of each robot of a team.
    sensor : (10,) float64
        Numbers of the laser, the maps and the step, see ``stages``.
    unit_vectors : (2, beams) float64
        Which way the beams look.
    noise_table : (4096,) float32
        ``GAUSSIAN_TABLE``.
    increments : (4,) int64
        ``OccupancySettings.increments``.
    floors, frames : (episodes, 10) int64, (episodes, 3) float64
        ``FloorTables.row`` and ``FloorTables.frame`` of each episode's floor.
    seeds, steps : (episodes,) uint64, (episodes,) int64
        Where the noise comes from, and the step that comes next.
    team_seen : (episodes,) int64
        Cells of F that the team has seen.
    moves, flags : (rows,) uint8, (rows,) int64
        Whether the robot drives, and its flags.
    poses, velocities, starts, believed : (rows, 3), (rows, 2), (rows, 3), (rows, 3) float64
        True poses and velocities, poses at the start, and poses as the localizers believe.
    ranges : (rows, beams) float32
        Scans [m]; inf for no return.
    maps, origins : (rows, 5) int64, (rows, 2) float64
        Address, rows and columns of each robot's log-odds, address and rows (0 for none) of the words of each
        row that have changed since the pooled maps took them in, and where cell (0, 0) begins.
    windows : (rows, 4) int64
        What part of each map has changed since planning took it in.
    masks : (rows, 5) int64
        Addresses of the robot's mask, the team's and F's, and their rows and words.
    boxes : (rows, 4) int64
        Part of the masks in which the robot saw new cells of F in this step: row_low, row_high, word_low,
        word_high.
    seen, gains : (rows,) int64, (rows,) float64
        Cells of F that each robot has seen, and those credited to it in the last step.
    bumpers, contacts : (rows, 3) int8, (rows,) uint8
        Left, centre, right; and whether the body touched anything.
    travelled, collisions : (rows,) float64, (rows,) int64
        Length of each robot's path [m], and how often it came into contact.
    reward_weights : (4,) float64
        What a new cell earns, and what a step, a contact and a metre cost.
    rewarded, rewards : (rows,) float64
        Length of each robot's path at its last reward [m], and what it has earned since rewards were last
        taken.
    odometry_model : (7,) float64
        ``OdometrySettings.numbers``; nothing (0,) where wheels tell the truth and nobody reckons with them.
    wheels, odometry, measured : (rows, 7), (rows, 3), (rows, 2) float64
        What the encoders are at, poses by dead reckoning since the start, and speeds and turn rates as the
        encoders tell; the last is ``velocities`` itself where wheels tell the truth.
    faults, failed : (rows, numbers) float64, (rows,) uint8
        Faults of each robot, see ``faults``, and whether it is dead.
    driven : (rows, 2) float64
        Scratch: speeds and turn rates that drives make of what they are told.
    contact, heard : (rows, robots) uint8, (rows, robots * 3) float64
        Of which teammates a robot knows the poses although not all are known (0 where all are), and these
        poses.
    """

    bodies: Array
    sensor: Array
    unit_vectors: Array
    noise_table: Array
    increments: Array
    floors: Array
    frames: Array
    seeds: Array
    steps: Array
    team_seen: Array
    moves: Array
    flags: Array
    poses: Array
    velocities: Array
    starts: Array
    believed: Array
    ranges: Array
    maps: Array
    origins: Array
    windows: Array
    masks: Array
    boxes: Array
    seen: Array
    gains: Array
    bumpers: Array
    contacts: Array
    travelled: Array
    collisions: Array
    reward_weights: Array
    rewarded: Array
    rewards: Array
    odometry_model: Array
    wheels: Array
    odometry: Array
    measured: Array
    faults: Array
    failed: Array
    driven: Array
    contact: Array
    heard: Array


def table_of(arrays: Iterable[NDArray[Any]]) -> NDArray[np.int64]:
    """Return where arrays lie: address, rows and columns (1 for a vector) of each, shape (arrays, 3). The caller keeps them alive."""
    return np.array(
        [(array.ctypes.data, array.shape[0], array.size // max(array.shape[0], 1)) for array in arrays],
        np.int64,
    )


@kernel(spliced=True)
def vector_of(table: Array, place: int, kind: type[np.generic]) -> Array:
    """View the vector that has a place in a table, inside a kernel."""
    return vector_at(table[place, 0], table[place, 1], kind)  # type: ignore[no-any-return]


@kernel(spliced=True)
def grid_of(table: Array, place: int, kind: type[np.generic]) -> Array:
    """View the grid that has a place in a table, inside a kernel."""
    return grid_at(table[place, 0], table[place, 1], table[place, 2], kind)  # type: ignore[no-any-return]


@kernel(spliced=True)
def world_at(table: Array) -> WorldArrays:
    """View the arrays of a table inside a kernel."""
    return WorldArrays(
        grid_of(table, 0, np.float64),
        vector_of(table, 1, np.float64),
        grid_of(table, 2, np.float64),
        vector_of(table, 3, np.float32),
        vector_of(table, 4, np.int64),
        grid_of(table, 5, np.int64),
        grid_of(table, 6, np.float64),
        vector_of(table, 7, np.uint64),
        vector_of(table, 8, np.int64),
        vector_of(table, 9, np.int64),
        vector_of(table, 10, np.uint8),
        vector_of(table, 11, np.int64),
        grid_of(table, 12, np.float64),
        grid_of(table, 13, np.float64),
        grid_of(table, 14, np.float64),
        grid_of(table, 15, np.float64),
        grid_of(table, 16, np.float32),
        grid_of(table, 17, np.int64),
        grid_of(table, 18, np.float64),
        grid_of(table, 19, np.int64),
        grid_of(table, 20, np.int64),
        grid_of(table, 21, np.int64),
        vector_of(table, 22, np.int64),
        vector_of(table, 23, np.float64),
        grid_of(table, 24, np.int8),
        vector_of(table, 25, np.uint8),
        vector_of(table, 26, np.float64),
        vector_of(table, 27, np.int64),
        vector_of(table, 28, np.float64),
        vector_of(table, 29, np.float64),
        vector_of(table, 30, np.float64),
        vector_of(table, 31, np.float64),
        grid_of(table, 32, np.float64),
        grid_of(table, 33, np.float64),
        grid_of(table, 34, np.float64),
        grid_of(table, 35, np.float64),
        vector_of(table, 36, np.uint8),
        grid_of(table, 37, np.float64),
        grid_of(table, 38, np.uint8),
        grid_of(table, 39, np.float64),
    )
