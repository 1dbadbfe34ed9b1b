"""The two stages of a robot's step in kernels: its scan and the scorer.

Then its map.

Stage one senses, after all bodies have moved; stage two updates the robot's map at the pose that its
localizer believes. The fused step runs both in one call; both ways call the same functions for each robot, so
they agree to the bit. Where a robot's believed pose is the true one, its map has the floor's lattice and
ranges carry no noise, the area seen is computed once for the scorer and the map.
"""

import math
from typing import NamedTuple

import numpy as np

from lidarium.envs.scoring.coverage import mark_seen
from lidarium.envs.simulation.disturbances.faults import blind_beams
from lidarium.envs.simulation.disturbances.noise import fill_gaussian, stream_key
from lidarium.envs.simulation.disturbances.odometry import HEIGHT, RADIUS
from lidarium.envs.simulation.kernels.arrays import (
    ANGLE_FIRST,
    ANGLE_INCREMENT,
    COUNTED_MASK,
    FRAME_RESOLUTION,
    FRAME_X,
    FRAME_Y,
    FULL_CIRCLE,
    KNOWN_MATES,
    LASER_HEIGHT,
    MAP,
    MAP_COLUMNS,
    MAP_RESOLUTION,
    MAP_ROWS,
    MASK_ROWS,
    MASK_WORDS,
    NOISE_FLOOR,
    NOISE_SHARE,
    OWN_FRAME,
    OWN_MASK,
    RANGE_MAX,
    RANGE_MIN,
    SOME_MATES,
    TOUCHED,
    TOUCHED_ROWS,
    TRUE_POSE,
    WorldArrays,
)
from lidarium.envs.simulation.kernels.ray_casting import cast_scan, cut_by_disc
from lidarium.mapping.grids.noisy_returns import settle_returns
from lidarium.mapping.grids.occupancy import integrate_scan
from lidarium.mapping.grids.pooled_maps import touched_words
from lidarium.mapping.grids.scan_geometry import beam_directions, beams_towards
from lidarium.mapping.grids.scan_polygon import fill_scan_polygon, scan_ends, window_rows, window_words
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.views import int8_grid_at, scratch_grid, scratch_vector, word_grid_at

MATE_MARGIN = 1.5
"""Distance within which a beam's end counts as a teammate's body [map cells].

It is measured to the body of the teammate.
"""

RANGE_GAP = 1e-3
"""Least difference between the range of a hit and the longest range [m].

The longest range means no return in an observation.
"""

ROUND_UP = 1.0 + 1.2e-7
"""Factor by which ranges are rounded up to float32.

The end of a beam then lies in the cell that it met.
"""


class ScanScratch(NamedTuple):
    """What a scan is worked out in; one serves robot after robot.

    Attributes
    ----------
    directions, lengths, ends : (4, beams), (beams,), (2, beams) float64
        Of the beams, see ``beam_directions`` and ``scan_ends``.
    windows : (2, window rows, words) uint64
        Bits of the cells around the robot: those seen, and those in which beams ended.
    """

    directions: Array
    lengths: Array
    ends: Array
    windows: Array


@kernel(borrowing=True)
def _measure(
    world: WorldArrays, row: int, first: int, robots: int, directions: Array, ranges: Array, lengths: Array
) -> None:
    """Take the scan of one robot without noise.

    It fills ``ranges`` [m], inf for no return, and ``lengths`` of the beams [map cells].
    """
    robot, episode = row - first, first // robots
    sensor, frame, poses = world.sensor, world.frames[episode], world.poses
    resolution = frame[FRAME_RESOLUTION]
    reach = sensor[RANGE_MAX] / resolution
    x, y, heading = (
        (poses[row, 0] - frame[FRAME_X]) / resolution,
        (poses[row, 1] - frame[FRAME_Y]) / resolution,
        poses[row, 2],
    )
    angle_first, increment = sensor[ANGLE_FIRST], sensor[ANGLE_INCREMENT]
    beam_directions(heading, world.unit_vectors, directions)
    cast_scan(world.floor_rows[episode], x, y, heading, angle_first, increment, directions, reach, lengths)
    for other in range(robots):
        if other != robot and world.bodies[other, HEIGHT] > sensor[LASER_HEIGHT]:
            other_x, other_y = (
                (poses[first + other, 0] - frame[FRAME_X]) / resolution,
                (poses[first + other, 1] - frame[FRAME_Y]) / resolution,
            )
            radius = world.bodies[other, RADIUS] / resolution
            cut_by_disc(
                x, y, heading, angle_first, increment, directions, other_x, other_y, radius, reach, lengths
            )
    scale = 1.0 / sensor[MAP_RESOLUTION]
    longest = sensor[RANGE_MAX]
    for beam in range(lengths.shape[0]):
        met = lengths[beam] < reach
        true_range = np.float32(lengths[beam] * resolution * ROUND_UP)
        ranges[beam] = true_range if met else np.float32(np.inf)
        lengths[beam] = min(true_range, longest) * scale if met else longest * scale
    blind_beams(world.faults[row], world.steps[episode], angle_first, increment, ranges, lengths)


@kernel(borrowing=True)
def _add_noise(world: WorldArrays, row: int, first: int, robots: int) -> None:
    """Disturb a scan as the sensor does."""
    sensor, ranges = world.sensor, world.ranges[row]
    beams, episode = ranges.shape[0], first // robots
    noise = scratch_vector(beams, np.float32)
    fill_gaussian(
        stream_key(world.seeds[episode], row - first, world.steps[episode]), world.noise_table, noise
    )
    floor_deviation, share = np.float32(sensor[NOISE_FLOOR]), np.float32(sensor[NOISE_SHARE])
    low, high = np.float32(sensor[RANGE_MIN]), np.float32(sensor[RANGE_MAX] - RANGE_GAP)
    for beam in range(beams):
        true_range = ranges[beam]
        noisy = true_range + max(floor_deviation, share * true_range) * noise[beam]
        ranges[beam] = min(max(noisy, low), high) if true_range < np.float32(np.inf) else true_range


@kernel(borrowing=True)
def _sense(world: WorldArrays, row: int, first: int, robots: int, directions: Array, lengths: Array) -> None:
    """Take the scan of one robot: measured ranges, and ``lengths`` of true beams [cells].

    Lengths are in map cells.
    """
    _measure(world, row, first, robots, directions, world.ranges[row], lengths)
    if _is_noisy(world.sensor):
        _add_noise(world, row, first, robots)


@kernel(spliced=True)
def sense_robot(world: WorldArrays, row: int, first: int, robots: int, scratch: ScanScratch) -> None:
    """Take the scan of one robot, and keep its true ranges."""
    _measure(world, row, first, robots, scratch.directions, world.true_ranges[row], scratch.lengths)
    world.ranges[row, :] = world.true_ranges[row]
    if _is_noisy(world.sensor):
        _add_noise(world, row, first, robots)


@kernel(spliced=True)
def score_robot(world: WorldArrays, row: int, first: int, robots: int, scratch: ScanScratch) -> None:
    """Add what a robot's true ranges see to its mask."""
    scratch.windows[:] = np.uint64(0)
    beam_directions(world.poses[row, 2], world.unit_vectors, scratch.directions)
    true_lengths(world.true_ranges[row], world.sensor, scratch.lengths)
    _score(world, row, first, robots, scratch)


@kernel(inline=True, borrowing=True)
def true_lengths(ranges: Array, sensor: Array, lengths: Array) -> None:
    """Fill the lengths of beams [map cells] from true ranges [m]; 0 for invalid ones."""
    scale = 1.0 / sensor[MAP_RESOLUTION]
    for beam in range(lengths.shape[0]):
        value = ranges[beam]
        lengths[beam] = min(value, sensor[RANGE_MAX]) * scale if value == value else 0.0


@kernel(spliced=True)
def _is_noisy(sensor: Array) -> bool:
    return bool(sensor[NOISE_FLOOR] > 0.0 or sensor[NOISE_SHARE] > 0.0)


@kernel(spliced=True)
def _window_corner(x: float, y: float, reach: float) -> tuple[int, int]:
    """Return the row and column of the map at which a scan's window begins [cells].

    The scan is from x, y; the column is a multiple of 64.
    """
    margin = int(reach) + 3
    return int(math.floor(y)) - margin, ((int(math.floor(x)) - margin) >> 6) << 6


@kernel(inline=True, borrowing=True)
def _seen_area(
    world: WorldArrays,
    row: int,
    first: int,
    robots: int,
    lengths: Array,
    directions: Array,
    ends: Array,
    bits: Array,
) -> tuple[tuple[int, int, int, int], int, int]:
    """Fill the area that the true beams have seen.

    Returns the box that holds bits, and the row and word of the masks where it begins.
    """
    sensor, frame = world.sensor, world.frames[first // robots]
    scale = 1.0 / sensor[MAP_RESOLUTION]
    x, y = (world.poses[row, 0] - frame[FRAME_X]) * scale, (world.poses[row, 1] - frame[FRAME_Y]) * scale
    row_offset, column_offset = _window_corner(x, y, sensor[RANGE_MAX] * scale)
    local_x, local_y = x - column_offset, y - row_offset
    scan_ends(lengths, directions, local_x, local_y, ends)
    box: tuple[int, int, int, int] = fill_scan_polygon(
        lengths, directions, ends, local_x, local_y, sensor[ANGLE_INCREMENT], sensor[FULL_CIRCLE] != 0.0, bits
    )
    return box, row_offset, column_offset >> 6


@kernel(borrowing=True)
def _score(
    world: WorldArrays, row: int, first: int, robots: int, scratch: ScanScratch
) -> tuple[int, int, int, int]:
    """Fill the area that the true beams have seen and add it to the robot's mask.

    Returns the box that holds bits.
    """
    box: tuple[int, int, int, int]
    bits = scratch.windows[0]
    box, row_offset, word_offset = _seen_area(
        world, row, first, robots, scratch.lengths, scratch.directions, scratch.ends, bits
    )
    masks = world.mask_rows[row]
    own, counted = (
        word_grid_at(masks[OWN_MASK], masks[MASK_ROWS], masks[MASK_WORDS]),
        word_grid_at(masks[COUNTED_MASK], masks[MASK_ROWS], masks[MASK_WORDS]),
    )
    world.seen[row] += mark_seen(own, counted, bits, box, row_offset, word_offset, world.boxes[row])
    return box


@kernel
def footprint(
    world: WorldArrays, row: int, first: int, robots: int, bits: Array
) -> tuple[tuple[int, int, int, int], int, int]:
    """Fill the area that a robot's true beams see from where it stands now.

    Nothing in the world changes.

    Parameters
    ----------
    world : WorldArrays
        The world after a step.
    row, first, robots : int
        The robot's row, the first row of its episode, and the size of its team.
    bits : (window rows, words) uint64
        Zero on entry; of the shape of ``window_rows`` and ``window_words``.

    Returns
    -------
    box : tuple of int
        row_low, row_high, word_low, word_high of the window that may hold bits, high ends exclusive.
    row_offset, word_offset : int
        Place of the window in the scorer's masks.
    """
    sensor, beams = world.sensor, world.ranges.shape[1]
    directions, lengths, ends = np.empty((4, beams)), np.empty(beams), np.empty((2, beams))
    if _is_noisy(sensor):
        _measure(world, row, first, robots, directions, np.empty(beams, np.float32), lengths)
    else:
        # The sensor told the true ranges: nothing has to be cast again.
        beam_directions(world.poses[row, 2], world.unit_vectors, directions)
        true_lengths(world.ranges[row], sensor, lengths)
    return _seen_area(world, row, first, robots, lengths, directions, ends, bits)  # type: ignore[no-any-return]


@kernel(borrowing=True)
def _filter_mates(
    world: WorldArrays, row: int, first: int, robots: int, x: float, y: float, ends: Array, is_hit: Array
) -> None:
    """Remove the hits on teammates whose believed poses are known.

    They are no part of the floor.
    """
    sensor, believed = world.sensor, world.believed
    beams = is_hit.shape[0]
    scale = 1.0 / sensor[MAP_RESOLUTION]
    reach = sensor[RANGE_MAX] * scale
    turn = 2.0 * math.pi / sensor[ANGLE_INCREMENT]
    knows_all = world.flags[row] & KNOWN_MATES != 0
    for other in range(first, first + robots):
        mate = other - first
        if other == row or not (knows_all or world.contact[row, mate] != 0):
            continue
        mate_x = believed[other, 0] if knows_all else world.heard[row, 3 * mate]
        mate_y = believed[other, 1] if knows_all else world.heard[row, 3 * mate + 1]
        gap_x, gap_y = (mate_x - believed[row, 0]) * scale, (mate_y - believed[row, 1]) * scale
        radius = world.bodies[other - first, RADIUS] * scale + MATE_MARGIN
        if gap_x * gap_x + gap_y * gap_y > (reach + radius) ** 2:
            continue
        begin, count = beams_towards(
            gap_x, gap_y, radius, believed[row, 2], sensor[ANGLE_FIRST], sensor[ANGLE_INCREMENT]
        )
        for lap in range(2):
            low = max(int(math.floor(begin - lap * turn)) - 1, 0)
            high = min(int(math.floor(begin - lap * turn + count)) + 2, beams - 1)
            for beam in range(low, high + 1):
                end_x, end_y = ends[0, beam] - x - gap_x, ends[1, beam] - y - gap_y
                if end_x * end_x + end_y * end_y <= radius * radius:
                    is_hit[beam] = False


@kernel
def invalidate_mates(world: WorldArrays, row: int, first: int, robots: int, ranges: Array) -> None:
    """Make the beams of a scan (beams,) invalid that met teammates.

    This holds as far as the robot knows where they are.
    """
    beams, scale = ranges.shape[0], 1.0 / world.sensor[MAP_RESOLUTION]
    directions, ends, is_hit = np.empty((4, beams)), np.empty((2, beams)), np.empty(beams, np.bool_)
    lengths = np.empty(beams)
    beam_directions(world.believed[row, 2], world.unit_vectors, directions)
    for beam in range(beams):
        is_hit[beam] = ranges[beam] <= world.sensor[RANGE_MAX]
        lengths[beam] = ranges[beam] * scale if is_hit[beam] else 0.0
    scan_ends(lengths, directions, 0.0, 0.0, ends)
    _filter_mates(world, row, first, robots, 0.0, 0.0, ends, is_hit)
    for beam in range(beams):
        if not is_hit[beam] and ranges[beam] <= world.sensor[RANGE_MAX]:
            ranges[beam] = np.float32(np.nan)


@kernel(borrowing=True)
def _update_map(
    world: WorldArrays,
    row: int,
    first: int,
    robots: int,
    scratch: ScanScratch,
    box: tuple[int, int, int, int],
    is_filled: bool,
) -> None:
    """Update one robot's map from its scan, whose beams' directions ``scratch`` holds.

    Where ``is_filled``, its ends and first window hold the seen area, of this ``box``, already; whatever
    window is not filled is zero.
    """
    directions, lengths, ends, bits = scratch.directions, scratch.lengths, scratch.ends, scratch.windows[0]
    sensor, believed, origin = world.sensor, world.believed[row], world.origins[row]
    ranges, belief = world.ranges[row], world.belief_rows[row]
    beams = ranges.shape[0]
    scale = 1.0 / sensor[MAP_RESOLUTION]
    reach = sensor[RANGE_MAX] * scale
    x, y = (believed[0] - origin[0]) * scale, (believed[1] - origin[1]) * scale
    if not (0.0 <= x < belief[MAP_COLUMNS] and 0.0 <= y < belief[MAP_ROWS]):
        # Whoever takes himself to be beyond his map is lost.
        world.failed[row] = 1
        return
    is_hit = scratch_vector(beams, np.bool_)
    for beam in range(beams):
        is_hit[beam] = ranges[beam] <= sensor[RANGE_MAX]
    log_odds = int8_grid_at(belief[MAP], belief[MAP_ROWS], belief[MAP_COLUMNS])
    row_offset, column_offset = _window_corner(x, y, reach)
    local_x, local_y = x - column_offset, y - row_offset
    if not is_filled:
        for beam in range(beams):
            value = ranges[beam]
            lengths[beam] = min(value * scale, reach) if value == value else 0.0
        if _is_noisy(sensor):
            deviation, share = sensor[NOISE_FLOOR] * scale, sensor[NOISE_SHARE]
            settle_returns(log_odds, x, y, lengths, directions, is_hit, deviation, share, world.increments[0])
        scan_ends(lengths, directions, local_x, local_y, ends)
        box = fill_scan_polygon(
            lengths,
            directions,
            ends,
            local_x,
            local_y,
            sensor[ANGLE_INCREMENT],
            sensor[FULL_CIRCLE] != 0.0,
            bits,
        )
    if world.flags[row] & (KNOWN_MATES | SOME_MATES):
        _filter_mates(world, row, first, robots, local_x, local_y, ends, is_hit)
    touched = word_grid_at(belief[TOUCHED], belief[TOUCHED_ROWS], touched_words(belief[MAP_COLUMNS]))
    integrate_scan(
        log_odds,
        bits,
        box,
        ends,
        is_hit,
        row_offset,
        column_offset,
        world.increments,
        scratch.windows[1],
        touched,
    )
    # A hit may lie one cell beyond the seen area.
    window = world.windows[row]
    window[0] = max(min(window[0], box[0] + row_offset - 1), 0)
    window[1] = min(max(window[1], box[1] + row_offset + 1), belief[MAP_ROWS])
    window[2] = max(min(window[2], 64 * box[2] + column_offset - 1), 0)
    window[3] = min(max(window[3], 64 * box[3] + column_offset + 1), belief[MAP_COLUMNS])


@kernel(spliced=True)
def scan_scratch(world: WorldArrays) -> ScanScratch:
    """Return scratch arrays for the scans of a world.

    They are freed when the kernel that asks for them returns. Do not call this within a loop.
    """
    beams, reach = world.ranges.shape[1], world.sensor[RANGE_MAX] / world.sensor[MAP_RESOLUTION]
    # The windows of a laser that reaches far on a fine map are too large for the stack.
    windows = np.empty((2, window_rows(reach), window_words(reach)), np.uint64)
    return ScanScratch(
        scratch_grid(4, beams, np.float64),
        scratch_vector(beams, np.float64),
        scratch_grid(2, beams, np.float64),
        windows,
    )


@kernel(spliced=True)
def perceive_robot(world: WorldArrays, row: int, first: int, robots: int, scratch: ScanScratch) -> None:
    """Run stage two alone: update one robot's map from its ranges.

    The ranges are taken at its believed pose.
    """
    scratch.windows[:] = np.uint64(0)
    beam_directions(world.believed[row, 2], world.unit_vectors, scratch.directions)
    _update_map(world, row, first, robots, scratch, (0, 0, 0, 0), False)


@kernel(spliced=True)
def sense_and_perceive(
    world: WorldArrays, row: int, first: int, robots: int, perceives: bool, scratch: ScanScratch
) -> None:
    """Run both stages for one robot (or the first alone, where not ``perceives``).

    ``first`` is the first row of its episode.
    """
    scratch.windows[:] = np.uint64(0)
    _sense(world, row, first, robots, scratch.directions, scratch.lengths)
    box = _score(world, row, first, robots, scratch)
    if not perceives:
        return
    is_same = world.flags[row] & (TRUE_POSE | OWN_FRAME) == TRUE_POSE and not _is_noisy(world.sensor)
    if not is_same:
        scratch.windows[0] = np.uint64(0)
        if world.believed[row, 2] != world.poses[row, 2]:
            beam_directions(world.believed[row, 2], world.unit_vectors, scratch.directions)
    _update_map(world, row, first, robots, scratch, box, is_same)
