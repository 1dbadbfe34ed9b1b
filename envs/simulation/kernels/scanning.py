"""The scan of a robot in kernels: true ranges by ray casting, noise, invalid ranges."""

import math
from typing import NamedTuple

import numpy as np

from lidarium.envs.simulation.disturbances.faults import blind_beams
from lidarium.envs.simulation.disturbances.noise import fill_gaussian, stream_key
from lidarium.envs.simulation.disturbances.odometry import HEIGHT, RADIUS
from lidarium.envs.simulation.kernels.arrays import (
    ANGLE_FIRST,
    ANGLE_INCREMENT,
    DOOR_BEAM,
    DOOR_KIND,
    FRAME_RESOLUTION,
    FRAME_X,
    FRAME_Y,
    LASER_HEIGHT,
    LEAF_HEIGHT_M,
    MAP_RESOLUTION,
    NOISE_FLOOR,
    NOISE_SHARE,
    OPENS,
    PERSON_BEAM,
    PERSON_GAP,
    PERSON_HEIGHT_M,
    RANGE_MAX,
    RANGE_MIN,
    WALKER_RADIUS,
    WALKER_X,
    WALKER_Y,
    WorldArrays,
    beams_of,
    doors_of,
    walkers_of,
)
from lidarium.envs.simulation.kernels.contact import has_leaf, leaf_of
from lidarium.envs.simulation.kernels.ray_casting import cast_scan, cut_by_disc, cut_by_segment
from lidarium.mapping.grids.scan_geometry import Beams, beam_directions
from lidarium.mapping.grids.scan_polygon import window_rows, window_words
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.views import scratch_grid, scratch_vector

RANGE_GAP = 1e-3
"""Minimum difference between the range of a hit and the maximum range [m].

The longest range means no return in an observation.
"""


ROUND_UP = 1.0 + 1.2e-7
"""Factor by which ranges are rounded up to float32.

The end of a beam then lies in the cell that it met.
"""


class ScanScratch(NamedTuple):
    """Scratch arrays of a scan; one set serves robot after robot.

    Attributes
    ----------
    directions, lengths, ends : (4, beams), (beams,), (2, beams) float64
        Directions, lengths and ends of the beams, see ``beam_directions`` and ``scan_ends``.
    windows : (2, window rows, words) uint64
        Bits of the cells around the robot: those seen, and those in which beams ended.
    """

    directions: Array
    lengths: Array
    ends: Array
    windows: Array


@kernel(nrt=False)
def _meet_doors(world: WorldArrays, row: int, episode: int, beams: Beams, lengths: Array) -> None:
    """Shorten the beams that meet doors, and mark those that meet one that opens by itself."""
    doors, frame, marks = doors_of(world, episode), world.frames[episode], world.recognised[row]
    scale = 1.0 / frame[FRAME_RESOLUTION]
    for door in range(doors.shape[0]):
        if has_leaf(doors[door]):
            from_x, from_y, to_x, to_y = leaf_of(doors[door])
            cut_by_segment(
                beams,
                (from_x - frame[FRAME_X]) * scale,
                (from_y - frame[FRAME_Y]) * scale,
                (to_x - frame[FRAME_X]) * scale,
                (to_y - frame[FRAME_Y]) * scale,
                lengths,
                marks,
                DOOR_BEAM if doors[door, DOOR_KIND] == OPENS else 0,
            )


@kernel(nrt=False)
def _meet_people(world: WorldArrays, row: int, episode: int, beams: Beams, lengths: Array) -> None:
    """Shorten the beams that meet people, and note the gap to the nearest person of whom the laser sees a part."""
    walkers, frame = walkers_of(world, episode), world.frames[episode]
    scale, robots = 1.0 / frame[FRAME_RESOLUTION], world.poses.shape[0] // world.steps.shape[0]
    marks, own = world.recognised[row], world.bodies[row - episode * robots, RADIUS]
    nearest = np.inf
    is_above = world.sensor[row - episode * robots, LASER_HEIGHT] >= PERSON_HEIGHT_M
    for person in range(0 if is_above else walkers.shape[0]):
        x = (walkers[person, WALKER_X] - frame[FRAME_X]) * scale
        y = (walkers[person, WALKER_Y] - frame[FRAME_Y]) * scale
        radius = walkers[person, WALKER_RADIUS]
        if cut_by_disc(beams, x, y, radius * scale, lengths, marks, PERSON_BEAM):
            apart = math.hypot(x - beams.x, y - beams.y) / scale
            nearest = min(nearest, apart - radius - own)
    world.safety[row, PERSON_GAP] = nearest


@kernel(nrt=False)
def measure(
    world: WorldArrays, row: int, first: int, robots: int, directions: Array, ranges: Array, lengths: Array
) -> None:
    """Take the scan of one robot without noise.

    It fills ``ranges`` [m], inf for no return, and ``lengths`` of the beams [map cells].
    """
    robot, episode = row - first, first // robots
    sensor, frame, poses = world.sensor[robot], world.frames[episode], world.poses
    resolution = frame[FRAME_RESOLUTION]
    reach = sensor[RANGE_MAX] / resolution
    x, y, heading = (
        (poses[row, 0] - frame[FRAME_X]) / resolution,
        (poses[row, 1] - frame[FRAME_Y]) / resolution,
        poses[row, 2],
    )
    angle_first, increment = sensor[ANGLE_FIRST], sensor[ANGLE_INCREMENT]
    beam_directions(heading, beams_of(world, robot), directions)
    beams = Beams(x, y, heading, angle_first, increment, directions, reach)
    cast_scan(world.floor_rows[episode], beams, lengths)
    for other in range(robots):
        if other != robot and world.bodies[other, HEIGHT] > sensor[LASER_HEIGHT]:
            other_x, other_y = (
                (poses[first + other, 0] - frame[FRAME_X]) / resolution,
                (poses[first + other, 1] - frame[FRAME_Y]) / resolution,
            )
            radius = world.bodies[other, RADIUS] / resolution
            cut_by_disc(beams, other_x, other_y, radius, lengths)
    if world.recognised.shape[0] > 0:
        world.recognised[row, :] = 0
        # Blind beams must not detect people.
        blind_beams(world.faults[row], world.steps[episode], angle_first, increment, ranges, lengths)
    # Doors first: people behind one are not seen.
    if world.doors.shape[0] > 0 and sensor[LASER_HEIGHT] < LEAF_HEIGHT_M:
        _meet_doors(world, row, episode, beams, lengths)
    if world.walkers.shape[0] > 0:
        _meet_people(world, row, episode, beams, lengths)
    scale = 1.0 / sensor[MAP_RESOLUTION]
    longest = sensor[RANGE_MAX]
    for beam in range(lengths.shape[0]):
        met = lengths[beam] < reach
        true_range = np.float32(lengths[beam] * resolution * ROUND_UP)
        ranges[beam] = true_range if met else np.float32(np.inf)
        lengths[beam] = min(true_range, longest) * scale if met else longest * scale
    _lose_near(sensor[RANGE_MIN], ranges, lengths)
    blind_beams(world.faults[row], world.steps[episode], angle_first, increment, ranges, lengths)


@kernel(forceinline=True, nrt=False)
def _lose_near(range_min: float, ranges: Array, lengths: Array) -> None:
    """Make beams invalid whose range is too short to be measured: ``ranges`` nan, ``lengths`` 0."""
    low = np.float32(range_min)
    for beam in range(ranges.shape[0]):
        if ranges[beam] < low:
            ranges[beam], lengths[beam] = np.float32(np.nan), 0.0


@kernel(nrt=False)
def _add_noise(world: WorldArrays, row: int, first: int, robots: int) -> None:
    """Disturb a scan as the sensor does."""
    sensor, ranges = world.sensor[row - first], world.ranges[row]
    beams, episode = ranges.shape[0], first // robots
    noise = scratch_vector(beams, np.float32)
    fill_gaussian(stream_key(world.seeds[episode], row - first, world.steps[episode]), world.noise_table, noise)
    floor_deviation, share = np.float32(sensor[NOISE_FLOOR]), np.float32(sensor[NOISE_SHARE])
    low, high = np.float32(sensor[RANGE_MIN]), np.float32(sensor[RANGE_MAX] - RANGE_GAP)
    for beam in range(beams):
        true_range = ranges[beam]
        noisy = true_range + max(floor_deviation, share * true_range) * noise[beam]
        ranges[beam] = min(max(noisy, low), high) if true_range < np.float32(np.inf) else true_range


@kernel(nrt=False)
def sense(world: WorldArrays, row: int, first: int, robots: int, directions: Array, lengths: Array) -> None:
    """Take the scan of one robot: measured ranges, and ``lengths`` of true beams [cells].

    Lengths are in map cells.
    """
    measure(world, row, first, robots, directions, world.ranges[row], lengths)
    if is_noisy(world.sensor[row - first]):
        _add_noise(world, row, first, robots)


@kernel(inline="always")
def sense_robot(world: WorldArrays, row: int, first: int, robots: int, scratch: ScanScratch) -> None:
    """Take the scan of one robot, and keep its true ranges."""
    measure(world, row, first, robots, scratch.directions, world.true_ranges[row], scratch.lengths)
    world.ranges[row, :] = world.true_ranges[row]
    if is_noisy(world.sensor[row - first]):
        _add_noise(world, row, first, robots)


@kernel(inline="always")
def disturb_robot(world: WorldArrays, row: int, first: int, robots: int, scratch: ScanScratch) -> None:
    """Disturb true ranges of one robot that are not of ``measure`` as the sensor does."""
    sensor, faults = world.sensor[row - first], world.faults[row]
    step, ranges = world.steps[first // robots], world.true_ranges[row]
    _lose_near(sensor[RANGE_MIN], ranges, scratch.lengths)
    blind_beams(faults, step, sensor[ANGLE_FIRST], sensor[ANGLE_INCREMENT], ranges, scratch.lengths)
    world.ranges[row, :] = ranges
    if is_noisy(sensor):
        _add_noise(world, row, first, robots)


@kernel(inline="always")
def is_noisy(sensor: Array) -> bool:
    """Whether ranges carry noise."""
    return bool(sensor[NOISE_FLOOR] > 0.0 or sensor[NOISE_SHARE] > 0.0)


@kernel(inline="always")
def scan_scratch(world: WorldArrays) -> ScanScratch:
    """Return scratch arrays for the scans of a world.

    They are freed when the kernel that asks for them returns. Do not call this within a loop.
    """
    beams, longest = world.ranges.shape[1], 0.0
    for robot in range(world.sensor.shape[0]):
        longest = max(longest, world.sensor[robot, RANGE_MAX])
    reach = longest / world.sensor[0, MAP_RESOLUTION]
    # The windows of a laser that reaches far on a fine map are too large for the stack.
    windows = np.empty((2, window_rows(reach), window_words(reach)), np.uint64)
    return ScanScratch(
        scratch_grid(4, beams, np.float64),
        scratch_vector(beams, np.float64),
        scratch_grid(2, beams, np.float64),
        windows,
    )
