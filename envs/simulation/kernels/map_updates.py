"""The map of a robot in kernels: a scan at the believed pose, without the hits on teammates.

It is the second stage of a robot's step. The first one senses and scores, after all bodies have moved. The
fused step runs both in one call; both forms call the same functions for each robot, so they agree to the bit.
If a robot's believed pose is the true one, its map has the floor's lattice and ranges carry no noise, the
area seen is computed once for the scorer and the map.
"""

import math

import numpy as np

from lidarium.envs.simulation.disturbances.odometry import RADIUS
from lidarium.envs.simulation.kernels.arrays import (
    ANGLE_FIRST,
    ANGLE_INCREMENT,
    FULL_CIRCLE,
    KNOWN_TEAMMATES,
    MAP,
    MAP_COLUMNS,
    MAP_RESOLUTION,
    MAP_ROWS,
    NOISE_FLOOR,
    NOISE_SHARE,
    OWN_FRAME,
    RANGE_MAX,
    SOME_TEAMMATES,
    TOUCHED,
    TOUCHED_ROWS,
    TRUE_POSE,
    WorldArrays,
    beams_of,
)
from lidarium.envs.simulation.kernels.masks import score_area, window_corner
from lidarium.envs.simulation.kernels.scanning import ScanScratch, is_noisy, sense
from lidarium.mapping.grids.pooled_maps import touched_words
from lidarium.mapping.grids.scan_geometry import beam_directions, beams_towards
from lidarium.mapping.grids.scan_integration import SeenScan, integrate_scan, settle_returns
from lidarium.mapping.grids.scan_polygon import fill_scan_polygon, scan_ends
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.views import grid_at, scratch_vector

TEAMMATE_MARGIN = 1.5
"""Distance within which a beam's end counts as a teammate's body [map cells].

It is measured to the body of the teammate.
"""


@kernel(nrt=False)
def _filter_teammates(
    world: WorldArrays, row: int, first: int, robots: int, x: float, y: float, ends: Array, is_hit: Array
) -> None:
    """Remove the hits on teammates whose believed poses are known.

    They are no part of the floor.
    """
    sensor, believed = world.sensor[row - first], world.believed
    beams = is_hit.shape[0]
    scale = 1.0 / sensor[MAP_RESOLUTION]
    reach = sensor[RANGE_MAX] * scale
    turn = 2.0 * math.pi / sensor[ANGLE_INCREMENT]
    knows_all = world.flags[row] & KNOWN_TEAMMATES != 0
    for other in range(first, first + robots):
        teammate = other - first
        if other == row or not (knows_all or world.contact[row, teammate] != 0):
            continue
        teammate_x = believed[other, 0] if knows_all else world.heard[row, 3 * teammate]
        teammate_y = believed[other, 1] if knows_all else world.heard[row, 3 * teammate + 1]
        gap_x, gap_y = (teammate_x - believed[row, 0]) * scale, (teammate_y - believed[row, 1]) * scale
        radius = world.bodies[other - first, RADIUS] * scale + TEAMMATE_MARGIN
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
def invalidate_teammates(world: WorldArrays, row: int, first: int, robots: int, ranges: Array) -> None:
    """Make the beams of a scan (beams,) invalid that met teammates.

    This holds as far as the robot knows their positions.
    """
    beams, sensor = ranges.shape[0], world.sensor[row - first]
    scale = 1.0 / sensor[MAP_RESOLUTION]
    directions, ends, is_hit = np.empty((4, beams)), np.empty((2, beams)), np.empty(beams, np.bool_)
    lengths = np.empty(beams)
    beam_directions(world.believed[row, 2], beams_of(world, row - first), directions)
    for beam in range(beams):
        is_hit[beam] = ranges[beam] <= sensor[RANGE_MAX]
        lengths[beam] = ranges[beam] * scale if is_hit[beam] else 0.0
    scan_ends(lengths, directions, 0.0, 0.0, ends)
    _filter_teammates(world, row, first, robots, 0.0, 0.0, ends, is_hit)
    for beam in range(beams):
        if not is_hit[beam] and ranges[beam] <= sensor[RANGE_MAX]:
            ranges[beam] = np.float32(np.nan)


@kernel(nrt=False)
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

    If ``is_filled``, its ends and first window already hold the seen area, of this ``box``; a window that is not
    filled is zero.
    """
    directions, lengths, ends, bits = scratch.directions, scratch.lengths, scratch.ends, scratch.windows[0]
    sensor, believed, origin = world.sensor[row - first], world.believed[row], world.origins[row]
    ranges, belief = world.ranges[row], world.belief_rows[row]
    beams = ranges.shape[0]
    scale = 1.0 / sensor[MAP_RESOLUTION]
    reach = sensor[RANGE_MAX] * scale
    x, y = (believed[0] - origin[0]) * scale, (believed[1] - origin[1]) * scale
    if not (0.0 <= x < belief[MAP_COLUMNS] and 0.0 <= y < belief[MAP_ROWS]):
        # A robot that believes to be outside its map is lost.
        world.failed[row] = 1
        return
    is_hit = scratch_vector(beams, np.bool_)
    for beam in range(beams):
        is_hit[beam] = ranges[beam] <= sensor[RANGE_MAX]
    log_odds = grid_at(belief[MAP], belief[MAP_ROWS], belief[MAP_COLUMNS], np.int8)
    row_offset, column_offset = window_corner(x, y, reach)
    local_x, local_y = x - column_offset, y - row_offset
    if not is_filled:
        for beam in range(beams):
            value = ranges[beam]
            lengths[beam] = min(value * scale, reach) if value == value else 0.0
        if is_noisy(sensor):
            deviation, share = sensor[NOISE_FLOOR] * scale, sensor[NOISE_SHARE]
            noise = (deviation, share)
            settle_returns(log_odds, x, y, lengths, directions, is_hit, noise, world.increments[0])
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
    if world.flags[row] & (KNOWN_TEAMMATES | SOME_TEAMMATES):
        _filter_teammates(world, row, first, robots, local_x, local_y, ends, is_hit)
    if world.recognised.shape[0] > 0:
        # Doors that open by themselves are no part of the map: robots recognise them, and wait before them.
        for beam in range(beams):
            if world.recognised[row, beam] != 0:
                is_hit[beam] = False
    touched = grid_at(belief[TOUCHED], belief[TOUCHED_ROWS], touched_words(belief[MAP_COLUMNS]), np.uint64)
    seen = SeenScan(bits, scratch.windows[1], box, ends, is_hit, row_offset, column_offset)
    integrate_scan(log_odds, seen, world.increments, touched)
    # A hit may lie one cell beyond the seen area.
    window = world.windows[row]
    window[0] = max(min(window[0], box[0] + row_offset - 1), 0)
    window[1] = min(max(window[1], box[1] + row_offset + 1), belief[MAP_ROWS])
    window[2] = max(min(window[2], 64 * box[2] + column_offset - 1), 0)
    window[3] = min(max(window[3], 64 * box[3] + column_offset + 1), belief[MAP_COLUMNS])


@kernel(inline="always")
def perceive_robot(world: WorldArrays, row: int, first: int, robots: int, scratch: ScanScratch) -> None:
    """Run stage two alone: update one robot's map from its ranges.

    The ranges are taken at its believed pose.
    """
    scratch.windows[:] = np.uint64(0)
    beam_directions(world.believed[row, 2], beams_of(world, row - first), scratch.directions)
    _update_map(world, row, first, robots, scratch, (0, 0, 0, 0), False)


@kernel(inline="always")
def sense_and_perceive(
    world: WorldArrays, row: int, first: int, robots: int, perceives: bool, scratch: ScanScratch
) -> None:
    """Run both stages for one robot (or the first alone, unless ``perceives``).

    ``first`` is the first row of its episode.
    """
    scratch.windows[:] = np.uint64(0)
    sense(world, row, first, robots, scratch.directions, scratch.lengths)
    box = score_area(world, row, first, robots, scratch)
    if not perceives:
        return
    is_exact = not is_noisy(world.sensor[row - first])
    is_same = is_exact and world.flags[row] & (TRUE_POSE | OWN_FRAME) == TRUE_POSE
    if not is_same:
        scratch.windows[0] = np.uint64(0)
        if world.believed[row, 2] != world.poses[row, 2]:
            beam_directions(world.believed[row, 2], beams_of(world, row - first), scratch.directions)
    _update_map(world, row, first, robots, scratch, box, is_same)
