"""The arrays of a world, as its kernels take them.

They are one table of addresses in place of thirty arguments.

A kernel views the arrays if they lie. Arrays handed over as arguments would be counted as references at
every use, by all threads in the same places of memory; views are not.
"""

from collections.abc import Sequence
from typing import Annotated, NamedTuple, get_args, get_type_hints

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.settings.lidar import Lidar
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.views import arrays_at, table_of

TRUE_POSE, KNOWN_TEAMMATES, ENDED, OWN_FRAME, DEAD_RECKONING, SOME_TEAMMATES = 1, 2, 4, 8, 16, 32
"""Flags of a row: the poses that the robot knows, and whether it has ended.

In order: the localizer knows the true pose; teammates' poses are known; the robot has ended (its body stays
there, its sensors are off). Then: it believes in the frame of its own start; its localizer uses its odometry
alone; poses of teammates that the radio reported are known.
"""

DEAD, BROKEN_PHYSICS = 1, 2
"""Values of ``failed``: the robot is dead, or the physics of its episode gave no numbers."""

(
    ANGLE_FIRST,
    ANGLE_INCREMENT,
    FULL_CIRCLE,
    RANGE_MIN,
    RANGE_MAX,
    NOISE_FLOOR,
    NOISE_SHARE,
    LASER_HEIGHT,
    MAP_RESOLUTION,
    TIME_STEP,
    SCAN_STEPS,
) = range(11)
"""Columns of ``sensor``; steps from scan to scan are those of the first robot."""

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
"""Columns of ``floor_rows``: addresses and sizes, as ``FloorTables.row`` has them."""

FRAME_X, FRAME_Y, FRAME_RESOLUTION = range(3)
"""Columns of ``frames``."""

MAP, MAP_ROWS, MAP_COLUMNS, TOUCHED, TOUCHED_ROWS = range(5)
"""Columns of ``belief_rows``."""

OWN_MASK, TEAM_MASK, COUNTED_MASK, MASK_ROWS, MASK_WORDS = range(5)
"""Columns of ``mask_rows``."""

(
    WALKER_X,
    WALKER_Y,
    WALKER_VX,
    WALKER_VY,
    WALKER_RADIUS,
    WALKER_SPEED,
    WALKER_PLACE,
    WALKER_DRAWS,
    WALKER_WAIT,
    WALKER_STUCK,
    WALKER_TOUCHED,
    WALKER_NUMBERS,
) = range(12)
"""Columns of ``walkers``: position, velocity, radius and preferred speed [m, m/s]; then state.

The state is the number of the place that the person walks to, how often it has drawn one, steps for which it still
stands there, steps for which it has made no way, and the row of the robot that it has walked into, plus 1.
"""

(
    WALKWAY_SOLID,
    WALKWAY_BOUND,
    WALKWAY_ROWS,
    WALKWAY_COLUMNS,
    WALKWAY_CLEARANCE,
    WALKWAY_HEADINGS,
    WALKWAY_PLACES,
    WALKWAY_COUNT,
    WALKWAY_CELL,
    WALKWAY_NUMBERS,
) = range(10)
"""Columns of ``walkways``: addresses and sizes, as ``Walkways.row`` has them."""

DOOR_X, DOOR_Y, DOOR_END_X, DOOR_END_Y, DOOR_KIND, DOOR_OPEN, DOOR_HOLD, DOOR_NUMBERS = range(8)
"""Columns of ``doors``: ends of the leaf when shut [m], kind, share by which it is open, steps until it shuts."""

NO_DOOR, OPENS, STANDS_OPEN, STAYS_SHUT = range(4)
"""Kinds of doors by number."""

(
    CLOSEST,
    CLOSEST_SPEED,
    NEAR_STEPS,
    NEAR_SPEED,
    NEAR_MISSES,
    IS_NEAR,
    BY_ROBOT,
    BY_PERSON,
    YIELDED,
    PERSON_GAP,
    MET_PERSON,
    SAFETY_NUMBERS,
) = range(12)
"""Columns of ``safety``, of each robot among people.

Smallest gap to a person and the robot's speed then [m, m/s], steps with a gap below ``NEAR_M``, maximum speed in them
[m/s], how often such an approach began, whether one goes on; contacts by cause; steps lost by yielding; gap to the
nearest person that the laser sees [m]; whether the robot drove into a person in the last step.
"""

PERSON_BEAM, DOOR_BEAM = 1, 2
"""Values of ``recognised``."""

PERSON_HEIGHT_M, LEAF_HEIGHT_M = 1.7, 2.0
"""Heights of people and of leaves of doors [m]."""

NEAR_M = 0.5
"""A gap to a person below this is a near miss [m]."""


class WorldArrays(NamedTuple):
    """Arrays over episodes, robots of a team, and rows = episodes x robots.

    Attributes
    ----------
    bodies : (robots, 8) float64
        ``Robot.numbers`` of each robot of a team.
    sensor : (robots, 11) float64
        Numbers of each robot's laser, the maps and the steps, see ``sensor_numbers``.
    unit_vectors : (2 * robots, beams) float64
        Directions of the beams against the heading: cosines, then sines, of each robot; see ``beams_of``.
    noise_table : (4096,) float32
        ``GAUSSIAN_TABLE``.
    increments : (4,) int64
        ``OccupancySettings.increments``.
    floor_rows, frames : (episodes, 10) int64, (episodes, 3) float64
        ``FloorTables.row`` and ``FloorTables.frame`` of each episode's floor.
    seeds, steps : (episodes,) uint64, (episodes,) int64
        Seeds of the noise, and the next step.
    team_seen : (episodes,) int64
        Cells of F that the team has seen.
    moves, flags : (rows,) uint8, (rows,) int64
        Whether the robot drives, and its flags.
    poses, velocities, starts, believed : (rows, 3), (rows, 2), (rows, 3), (rows, 3) float64
        True poses and velocities, poses at the start, and poses as the localizers believe.
    scanned : (rows, 3) float64
        Believed poses at the last scans; ``believed`` itself if robots scan in each step.
    ranges, true_ranges : (rows, beams) float32
        Scans as measured, and without noise if stages run one by one [m]; inf for no return.
    belief_rows, origins : (rows, 5) int64, (rows, 2) float64
        Address, rows and columns of each robot's log-odds, address and rows (0 for none) of the words of each
        row that have changed since the pooled maps took them in, and the corner of cell (0, 0).
    windows : (rows, 4) int64
        Part of each map that has changed since planning last used it.
    mask_rows : (rows, 5) int64
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
        Reward of a new cell, and costs of a step, a contact and a metre.
    reward_terms : (rows, 4) float64
        Sum of each term for each robot since rewards were last taken.
    rewarded, rewards : (rows,) float64
        Length of each robot's path at its last reward [m], and its reward since rewards were last taken.
    odometry_model : (7,) float64
        ``OdometrySettings.numbers``; empty (0,) if wheels measure exactly and odometry is not used.
    wheels, odometry, measured : (rows, 7), (rows, 3), (rows, 2) float64
        Encoder states, poses by dead reckoning since the start, and speeds and turn rates as the
        encoders measure; the last is ``velocities`` itself if wheels measure exactly.
    faults, failed : (rows, numbers) float64, (rows,) uint8
        Faults of each robot, see ``faults``, and whether it is dead.
    driven : (rows, 2) float64
        Scratch: speeds and turn rates that drives make of their commands.
    contact, heard : (rows, robots) uint8, (rows, robots * 3) float64
        Of which teammates a robot knows the poses although not all are known (0 if all are), and these
        poses.
    walkers : (episodes * people, 11) float64
        The people of each episode.
    walkways : (episodes, 9) int64
        The part of each floor on which people walk, and their ways to places on it.
    doors : (episodes * doors, 7) float64
        The doors of each episode.
    recognised : (rows, beams) uint8
        Beams that met a person or a door that opens by itself, which robots recognise; empty without any.
    safety : (rows, 11) float64
        Approaches and contacts of robots and people.
    """

    bodies: Annotated[Array, np.float64, 2]
    sensor: Annotated[Array, np.float64, 2]
    unit_vectors: Annotated[Array, np.float64, 2]
    noise_table: Annotated[Array, np.float32, 1]
    increments: Annotated[Array, np.int64, 1]
    floor_rows: Annotated[Array, np.int64, 2]
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
    scanned: Annotated[Array, np.float64, 2]
    ranges: Annotated[Array, np.float32, 2]
    true_ranges: Annotated[Array, np.float32, 2]
    belief_rows: Annotated[Array, np.int64, 2]
    origins: Annotated[Array, np.float64, 2]
    windows: Annotated[Array, np.int64, 2]
    mask_rows: Annotated[Array, np.int64, 2]
    boxes: Annotated[Array, np.int64, 2]
    seen: Annotated[Array, np.int64, 1]
    gains: Annotated[Array, np.float64, 1]
    bumpers: Annotated[Array, np.int8, 2]
    contacts: Annotated[Array, np.uint8, 1]
    travelled: Annotated[Array, np.float64, 1]
    collisions: Annotated[Array, np.int64, 1]
    reward_weights: Annotated[Array, np.float64, 1]
    reward_terms: Annotated[Array, np.float64, 2]
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
    walkers: Annotated[Array, np.float64, 2]
    walkways: Annotated[Array, np.int64, 2]
    doors: Annotated[Array, np.float64, 2]
    recognised: Annotated[Array, np.uint8, 2]
    safety: Annotated[Array, np.float64, 2]


@kernel(inline="always")
def world_at(table: Array) -> WorldArrays:
    """View the arrays of a table inside a kernel."""
    return arrays_at(table, WorldArrays)  # type: ignore[no-any-return]


@kernel(inline="always")
def beams_of(world: WorldArrays, robot: int) -> Array:
    """Return the directions of a robot's beams against the heading, (2, beams)."""
    return world.unit_vectors[2 * robot : 2 * robot + 2]


@kernel(inline="always")
def is_scanning(world: WorldArrays, episode: int) -> bool:
    """Whether robots scan in the step of an episode that runs and is not counted yet."""
    return bool((world.steps[episode] + 1) % int(world.sensor[0, SCAN_STEPS]) == 0)


@kernel(inline="always")
def walkers_of(world: WorldArrays, episode: int) -> Array:
    """Return the people of an episode, (people, 11)."""
    people = world.walkers.shape[0] // world.steps.shape[0]
    return world.walkers[episode * people : (episode + 1) * people]


@kernel(inline="always")
def doors_of(world: WorldArrays, episode: int) -> Array:
    """Return the doors of an episode, (doors, 7)."""
    doors = world.doors.shape[0] // world.steps.shape[0]
    return world.doors[episode * doors : (episode + 1) * doors]


def table_of_owners(*owners: object) -> NDArray[np.int64]:
    """Return the table of a world's arrays, each an attribute of the first owner that has it.

    Arrays without an owner are empty. The owners keep the arrays alive.
    """
    hints = get_type_hints(WorldArrays, include_extras=True)
    arrays = []
    for name in WorldArrays._fields:
        owner = next((each for each in owners if hasattr(each, name)), None)
        _, dtype, dimensions = get_args(hints[name])
        array = np.zeros((0,) * dimensions, dtype) if owner is None else getattr(owner, name)
        if array.dtype != dtype or array.ndim != dimensions or not array.flags.c_contiguous:
            raise TypeError(
                f"{name} is {array.dtype} with {array.ndim} dimensions; want {np.dtype(dtype)} with "
                f"{dimensions}, "
                f"contiguous"
            )
        arrays.append(array)
    return table_of(arrays)


def sensor_numbers(
    lidars: Sequence[Lidar], time_step: float, map_resolution: float, scan_steps: int = 1
) -> NDArray[np.float64]:
    """Return numbers for kernels, (robots, 11): each laser, the maps' cells [m], a step [s], steps between scans."""
    numbers = np.zeros((len(lidars), 11))
    for row, lidar in zip(numbers, lidars, strict=True):
        row[ANGLE_FIRST], row[ANGLE_INCREMENT] = lidar.angle_first, lidar.angle_increment
        row[FULL_CIRCLE] = float(lidar.is_full_circle)
        row[RANGE_MIN], row[RANGE_MAX] = lidar.range_min, lidar.range_max
        row[NOISE_FLOOR], row[NOISE_SHARE] = lidar.noise_floor, lidar.noise_share
        row[LASER_HEIGHT], row[MAP_RESOLUTION], row[TIME_STEP] = lidar.height, map_resolution, time_step
        row[SCAN_STEPS] = scan_steps
    return numbers
