"""The two stages of a step in kernels over arrays of episodes x robots: motion, scans and scorer; then maps.

Stage one moves the bodies and senses; stage two updates each robot's map at the pose that its localizer believes. The
fused step runs both in one call; both ways call the same function for each robot, so they agree to the bit. Where a
robot's believed pose is the true one, its map has the floor's lattice and ranges carry no noise, the area seen is
computed once for the scorer and the map.
"""

import math

import numba
import numpy as np

from lidarium.envs.coverage import mark_seen, share_news
from lidarium.envs.simulation.lidar import cast_scan, cut_by_disc
from lidarium.envs.simulation.motion import move_robots
from lidarium.envs.simulation.noise import fill_gaussian, stream_key
from lidarium.mapping.kernels import Array, int8_grid_at, kernel, word_grid_at
from lidarium.mapping.occupancy import integrate_scan
from lidarium.mapping.scan_polygon import fill_scan_polygon, scan_ends, window_rows, window_words
from lidarium.mapping.scans import beam_directions, beams_towards

ANGLE_FIRST, ANGLE_INCREMENT, FULL_CIRCLE, RANGE_MIN, RANGE_MAX, NOISE_FLOOR, NOISE_SHARE, LASER_HEIGHT, MAP_RESOLUTION, TIME_STEP = range(
    10
)
"""Places in the array of sensor numbers."""

MATE_MARGIN = 1.5
"""A beam that ends within this of a teammate's body is taken to have met it [map cells]."""

RANGE_GAP = 1e-3
"""A hit tells at least this much less than the longest range [m], which in an observation means no return."""

ROUND_UP = 1.0 + 1.2e-7
"""Ranges are rounded up to float32, so that the end of a beam lies in the cell that it met."""


@kernel
def _sense_robot(
    row: int,
    first: int,
    robots: int,
    floor: Array,
    frame: Array,
    bodies: Array,
    poses: Array,
    sensor: Array,
    unit_vectors: Array,
    seed: int,
    step: int,
    noise_table: Array,
    directions: Array,
    ranges: Array,
    lengths: Array,
) -> None:
    """Take the scan of one robot: ``ranges`` as the sensor tells, ``lengths`` of the true beams [map cells]."""
    robot = row - first
    resolution = frame[2]
    reach = sensor[RANGE_MAX] / resolution
    x, y, heading = (poses[row, 0] - frame[0]) / resolution, (poses[row, 1] - frame[1]) / resolution, poses[row, 2]
    beam_directions(heading, unit_vectors, directions)
    cast_scan(floor, x, y, heading, sensor[ANGLE_FIRST], sensor[ANGLE_INCREMENT], directions, reach, lengths)
    for other in range(robots):
        if other != robot and bodies[other, 5] > sensor[LASER_HEIGHT]:
            other_x, other_y = (poses[first + other, 0] - frame[0]) / resolution, (poses[first + other, 1] - frame[1]) / resolution
            radius = bodies[other, 0] / resolution
            cut_by_disc(x, y, heading, sensor[ANGLE_FIRST], sensor[ANGLE_INCREMENT], directions, other_x, other_y, radius, reach, lengths)
    beams = lengths.shape[0]
    scale = 1.0 / sensor[MAP_RESOLUTION]
    longest = sensor[RANGE_MAX]
    for beam in range(beams):
        met = lengths[beam] < reach
        true_range = np.float32(lengths[beam] * resolution * ROUND_UP)
        ranges[beam] = true_range if met else np.float32(np.inf)
        lengths[beam] = min(true_range, longest) * scale if met else longest * scale
    if sensor[NOISE_FLOOR] > 0.0 or sensor[NOISE_SHARE] > 0.0:
        noise = np.empty(beams, np.float32)
        fill_gaussian(stream_key(seed, robot, step), noise_table, noise)
        floor_deviation, share = np.float32(sensor[NOISE_FLOOR]), np.float32(sensor[NOISE_SHARE])
        low, high = np.float32(sensor[RANGE_MIN]), np.float32(longest - RANGE_GAP)
        for beam in range(beams):
            true_range = ranges[beam]
            noisy = true_range + max(floor_deviation, share * true_range) * noise[beam]
            ranges[beam] = min(max(noisy, low), high) if true_range < np.float32(np.inf) else true_range


@kernel
def _filter_mates(
    row: int, first: int, robots: int, bodies: Array, believed: Array, sensor: Array, x: float, y: float, ends: Array, is_hit: Array
) -> None:
    """Take out the hits on teammates, whose believed poses are known: they are no part of the floor."""
    robot = row - first
    beams = is_hit.shape[0]
    scale = 1.0 / sensor[MAP_RESOLUTION]
    reach = sensor[RANGE_MAX] * scale
    turn = 2.0 * math.pi / sensor[ANGLE_INCREMENT]
    for other in range(robots):
        if other == robot:
            continue
        gap_x = (believed[first + other, 0] - believed[row, 0]) * scale
        gap_y = (believed[first + other, 1] - believed[row, 1]) * scale
        radius = bodies[other, 0] * scale + MATE_MARGIN
        if gap_x * gap_x + gap_y * gap_y > (reach + radius) ** 2:
            continue
        begin, count = beams_towards(gap_x, gap_y, radius, believed[row, 2], sensor[ANGLE_FIRST], sensor[ANGLE_INCREMENT])
        for lap in range(2):
            low = max(int(math.floor(begin - lap * turn)) - 1, 0)
            high = min(int(math.floor(begin - lap * turn + count)) + 2, beams - 1)
            for beam in range(low, high + 1):
                end_x, end_y = ends[0, beam] - x - gap_x, ends[1, beam] - y - gap_y
                if end_x * end_x + end_y * end_y <= radius * radius:
                    is_hit[beam] = False


@kernel
def _update_map(
    row: int,
    first: int,
    robots: int,
    bodies: Array,
    believed: Array,
    sensor: Array,
    flags: Array,
    ranges: Array,
    directions: Array,
    lengths: Array,
    ends: Array,
    belief: Array,
    origin: Array,
    window: Array,
    increments: Array,
    bits: Array,
    box: tuple[int, int, int, int],
    is_filled: bool,
) -> None:
    """Update one robot's map from its scan; ``bits``, ``ends`` and ``box`` hold the seen area already where ``is_filled``."""
    beams = ranges.shape[0]
    scale = 1.0 / sensor[MAP_RESOLUTION]
    reach = sensor[RANGE_MAX] * scale
    x, y = (believed[row, 0] - origin[0]) * scale, (believed[row, 1] - origin[1]) * scale
    is_hit = np.empty(beams, np.bool_)
    for beam in range(beams):
        is_hit[beam] = ranges[beam] <= sensor[RANGE_MAX]
    margin = int(reach) + 3
    row_offset = int(math.floor(y)) - margin
    column_offset = ((int(math.floor(x)) - margin) >> 6) << 6
    local_x, local_y = x - column_offset, y - row_offset
    if not is_filled:
        for beam in range(beams):
            value = ranges[beam]
            lengths[beam] = min(value * scale, reach) if value == value else 0.0
        scan_ends(lengths, directions, local_x, local_y, ends)
        box = fill_scan_polygon(lengths, directions, ends, local_x, local_y, sensor[ANGLE_INCREMENT], sensor[FULL_CIRCLE] != 0.0, bits)
    if flags[row] & 2:
        _filter_mates(row, first, robots, bodies, believed, sensor, local_x, local_y, ends, is_hit)
    log_odds = int8_grid_at(belief[0], belief[1], belief[2])
    integrate_scan(log_odds, bits, box, ends, is_hit, row_offset, column_offset, increments, np.zeros_like(bits))
    # A hit may lie one cell beyond the seen area.
    window[0] = max(min(window[0], box[0] + row_offset - 1), 0)
    window[1] = min(max(window[1], box[1] + row_offset + 1), belief[1])
    window[2] = max(min(window[2], 64 * box[2] + column_offset - 1), 0)
    window[3] = min(max(window[3], 64 * box[3] + column_offset + 1), belief[2])


@kernel
def _perceive_robot(
    row: int,
    first: int,
    robots: int,
    bodies: Array,
    believed: Array,
    sensor: Array,
    unit_vectors: Array,
    flags: Array,
    ranges: Array,
    belief: Array,
    origin: Array,
    window: Array,
    increments: Array,
) -> None:
    """Stage two alone: update one robot's map from its ranges at its believed pose."""
    beams = ranges.shape[0]
    directions, lengths, ends = np.empty((4, beams)), np.empty(beams), np.empty((2, beams))
    beam_directions(believed[row, 2], unit_vectors, directions)
    reach = sensor[RANGE_MAX] / sensor[MAP_RESOLUTION]
    bits = np.zeros((window_rows(reach), window_words(reach)), np.uint64)
    _update_map(
        row, first, robots, bodies, believed, sensor, flags, ranges, directions, lengths, ends, belief, origin, window, increments,
        bits, (0, 0, 0, 0), False,
    )  # fmt: skip


@kernel
def _score_robot(
    row: int,
    poses: Array,
    frame: Array,
    sensor: Array,
    lengths: Array,
    directions: Array,
    ends: Array,
    masks: Array,
    bits: Array,
    news: Array,
    entries: Array,
    seen: Array,
) -> tuple[int, int, int, int]:
    """Fill the area that the true beams have seen and add it to the robot's mask; returns the box that holds bits."""
    scale = 1.0 / sensor[MAP_RESOLUTION]
    reach = sensor[RANGE_MAX] * scale
    x, y = (poses[row, 0] - frame[0]) * scale, (poses[row, 1] - frame[1]) * scale
    margin = int(reach) + 3
    row_offset = int(math.floor(y)) - margin
    column_offset = ((int(math.floor(x)) - margin) >> 6) << 6
    local_x, local_y = x - column_offset, y - row_offset
    scan_ends(lengths, directions, local_x, local_y, ends)
    box: tuple[int, int, int, int] = fill_scan_polygon(
        lengths, directions, ends, local_x, local_y, sensor[ANGLE_INCREMENT], sensor[FULL_CIRCLE] != 0.0, bits
    )
    own = word_grid_at(masks[0], masks[3], masks[4])
    team = word_grid_at(masks[1], masks[3], masks[4])
    counted = word_grid_at(masks[2], masks[3], masks[4])
    new_own, count = mark_seen(own, team, counted, bits, box, row_offset, column_offset >> 6, news)
    seen[row] += new_own
    entries[row] = count
    return box


@kernel
def _sense_and_perceive(
    row: int,
    first: int,
    robots: int,
    floor: Array,
    frame: Array,
    bodies: Array,
    poses: Array,
    believed: Array,
    sensor: Array,
    unit_vectors: Array,
    seed: int,
    step: int,
    noise_table: Array,
    flags: Array,
    ranges: Array,
    belief: Array,
    origin: Array,
    window: Array,
    increments: Array,
    masks: Array,
    news: Array,
    entries: Array,
    seen: Array,
    perceives: bool,
) -> None:
    """Both stages for one robot (or the first alone, where not ``perceives``)."""
    beams = ranges.shape[0]
    directions, lengths, ends = np.empty((4, beams)), np.empty(beams), np.empty((2, beams))
    _sense_robot(
        row, first, robots, floor, frame, bodies, poses, sensor, unit_vectors, seed, step, noise_table, directions, ranges, lengths
    )
    reach = sensor[RANGE_MAX] / sensor[MAP_RESOLUTION]
    bits = np.zeros((window_rows(reach), window_words(reach)), np.uint64)
    box = _score_robot(row, poses, frame, sensor, lengths, directions, ends, masks, bits, news, entries, seen)
    if not perceives:
        return
    is_noisy = sensor[NOISE_FLOOR] > 0.0 or sensor[NOISE_SHARE] > 0.0
    is_same = flags[row] & 9 == 1 and not is_noisy
    if not is_same:
        bits = np.zeros_like(bits)
        if believed[row, 2] != poses[row, 2]:
            beam_directions(believed[row, 2], unit_vectors, directions)
    _update_map(
        row, first, robots, bodies, believed, sensor, flags, ranges, directions, lengths, ends, belief, origin, window, increments,
        bits, box, is_same,
    )  # fmt: skip


@kernel
def _believe_truth(pose: Array, start: Array, is_relative: bool, believed: Array) -> None:
    """Localize perfectly: in the floor's axes, or in the frame of the start."""
    if not is_relative:
        believed[0], believed[1], believed[2] = pose[0], pose[1], pose[2]
        return
    cosine, sine = math.cos(start[2]), math.sin(start[2])
    gap_x, gap_y = pose[0] - start[0], pose[1] - start[1]
    believed[0], believed[1] = cosine * gap_x + sine * gap_y, cosine * gap_y - sine * gap_x
    angle = pose[2] - start[2]
    believed[2] = angle - 2.0 * math.pi * math.ceil((angle - math.pi) / (2.0 * math.pi))


def _step(
    robots: int,
    floors: Array,
    frames: Array,
    bodies: Array,
    moves: Array,
    poses: Array,
    velocities: Array,
    starts: Array,
    believed: Array,
    commands: Array,
    sensor: Array,
    unit_vectors: Array,
    seeds: Array,
    steps: Array,
    noise_table: Array,
    flags: Array,
    ranges: Array,
    beliefs: Array,
    origins: Array,
    windows: Array,
    increments: Array,
    masks: Array,
    news: Array,
    entries: Array,
    seen: Array,
    gains: Array,
    team_seen: Array,
    bumpers: Array,
    contacts: Array,
    travelled: Array,
    collisions: Array,
    moves_bodies: bool,
    perceives: bool,
) -> None:
    """Move, sense, score and (where ``perceives``) map, for all episodes.

    ``flags`` of a row: 1 where the localizer knows the true pose, 2 where teammates' poses are known, 4 where the robot has
    ended (its body stands there, its sensors are off), 8 where the robot believes in the frame of its own start.
    """
    episodes = floors.shape[0]
    if moves_bodies:
        for episode in range(episodes):
            first, last = episode * robots, (episode + 1) * robots
            table = floors[episode]
            move_robots(
                table[8], table[9], table[1], table[2], frames[episode], bodies, moves[first:last], poses[first:last],
                velocities[first:last], commands[first:last], sensor[TIME_STEP], bumpers[first:last], contacts[first:last],
                travelled[first:last], collisions[first:last],
            )  # fmt: skip
    for row in range(episodes * robots):
        if flags[row] & 1:
            _believe_truth(poses[row], starts[row], flags[row] & 8 != 0, believed[row])
    for row in numba.prange(episodes * robots):
        episode = row // robots
        if flags[row] & 4:
            entries[row] = 0
            continue
        _sense_and_perceive(
            row, episode * robots, robots, floors[episode], frames[episode], bodies, poses, believed, sensor, unit_vectors, seeds[episode],
            steps[episode], noise_table, flags, ranges[row], beliefs[row], origins[row], windows[row], increments, masks[row],
            news[row], entries, seen, perceives,
        )  # fmt: skip
    for episode in range(episodes):
        first = episode * robots
        team = word_grid_at(masks[first, 1], masks[first, 3], masks[first, 4])
        team_seen[episode] += share_news(masks[:, 0], team, news, entries, first, robots, gains)


def _perceive(
    robots: int,
    bodies: Array,
    believed: Array,
    sensor: Array,
    unit_vectors: Array,
    flags: Array,
    ranges: Array,
    beliefs: Array,
    origins: Array,
    windows: Array,
    increments: Array,
) -> None:
    """Stage two for all rows."""
    for row in numba.prange(ranges.shape[0]):
        if flags[row] & 4:
            continue
        _perceive_robot(
            row, (row // robots) * robots, robots, bodies, believed, sensor, unit_vectors, flags, ranges[row], beliefs[row], origins[row],
            windows[row], increments,
        )  # fmt: skip


step_serial = kernel(_step)
step_parallel = kernel(parallel=True)(_step)
perceive_serial = kernel(_perceive)
perceive_parallel = kernel(parallel=True)(_perceive)
