"""The arrays of a world, as its kernels take them: one table of addresses in place of thirty arguments.

A kernel views the arrays where they lie. Arrays handed over as arguments would be counted as references at
every use, by all threads in the same places of memory; views are not.
"""

from typing import Annotated, NamedTuple

import numpy as np

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.views import arrays_at

TRUE_POSE, KNOWN_MATES, ENDED, OWN_FRAME, DEAD_RECKONING, SOME_MATES = 1, 2, 4, 8, 16, 32
"""Flags of a row: the localizer knows the true pose; teammates' poses are known; the robot has ended (its
body stands there, its sensors are off); it believes in the frame of its own start; its localizer reckons from
its odometry alone; the poses of those teammates are known that the radio told of."""

(
    SQUARES,
    FLOOR_ROWS,
    FLOOR_COLUMNS,
    FACE_TABLE,
    FACE_COUNT,
    FACE_STARTS,
    FACE_START_COUNT,
    TILE_COLUMNS,
    BOUND,
    BODY_SOLID,
) = range(10)
"""Columns of ``floors``: addresses and sizes, as ``FloorTables.row`` has them."""

FRAME_X, FRAME_Y, FRAME_RESOLUTION = range(3)
"""Columns of ``frames``."""

MAP, MAP_ROWS, MAP_COLUMNS, TOUCHED, TOUCHED_ROWS = range(5)
"""Columns of ``maps``."""

OWN_MASK, TEAM_MASK, COUNTED_MASK, MASK_ROWS, MASK_WORDS = range(5)
"""Columns of ``masks``."""


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

    bodies: Annotated[Array, np.float64, 2]
    sensor: Annotated[Array, np.float64, 1]
    unit_vectors: Annotated[Array, np.float64, 2]
    noise_table: Annotated[Array, np.float32, 1]
    increments: Annotated[Array, np.int64, 1]
    floors: Annotated[Array, np.int64, 2]
    frames: Annotated[Array, np.float64, 2]
    seeds: Annotated[Array, np.uint64, 1]
    steps: Annotated[Array, np.int64, 1]
    team_seen: Annotated[Array, np.int64, 1]
    moves: Annotated[Array, np.uint8, 1]
    flags: Annotated[Array, np.int64, 1]
    poses: Annotated[Array, np.float64, 2]
    velocities: Annotated[Array, np.float64, 2]
    starts: Annotated[Array, np.float64, 2]
    believed: Annotated[Array, np.float64, 2]
    ranges: Annotated[Array, np.float32, 2]
    maps: Annotated[Array, np.int64, 2]
    origins: Annotated[Array, np.float64, 2]
    windows: Annotated[Array, np.int64, 2]
    masks: Annotated[Array, np.int64, 2]
    boxes: Annotated[Array, np.int64, 2]
    seen: Annotated[Array, np.int64, 1]
    gains: Annotated[Array, np.float64, 1]
    bumpers: Annotated[Array, np.int8, 2]
    contacts: Annotated[Array, np.uint8, 1]
    travelled: Annotated[Array, np.float64, 1]
    collisions: Annotated[Array, np.int64, 1]
    reward_weights: Annotated[Array, np.float64, 1]
    rewarded: Annotated[Array, np.float64, 1]
    rewards: Annotated[Array, np.float64, 1]
    odometry_model: Annotated[Array, np.float64, 1]
    wheels: Annotated[Array, np.float64, 2]
    odometry: Annotated[Array, np.float64, 2]
    measured: Annotated[Array, np.float64, 2]
    faults: Annotated[Array, np.float64, 2]
    failed: Annotated[Array, np.uint8, 1]
    driven: Annotated[Array, np.float64, 2]
    contact: Annotated[Array, np.uint8, 2]
    heard: Annotated[Array, np.float64, 2]


@kernel(spliced=True)
def world_at(table: Array) -> WorldArrays:
    """View the arrays of a table inside a kernel."""
    return arrays_at(table, WorldArrays)  # type: ignore[no-any-return]
