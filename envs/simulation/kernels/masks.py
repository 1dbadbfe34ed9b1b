"""Areas that robots have truly seen, in kernels: the area of the true beams, added to a mask."""

import math

import numpy as np

from lidarium.envs.simulation.coverage import mark_seen
from lidarium.envs.simulation.kernels.arrays import (
    ANGLE_INCREMENT,
    COUNTED_MASK,
    FRAME_X,
    FRAME_Y,
    FULL_CIRCLE,
    MAP_RESOLUTION,
    MASK_ROWS,
    MASK_WORDS,
    OWN_MASK,
    PERSON_GAP,
    RANGE_MAX,
    SCAN_STEPS,
    WorldArrays,
    beams_of,
)
from lidarium.envs.simulation.kernels.scanning import ScanScratch, is_noisy, measure
from lidarium.mapping.grids.scan_geometry import beam_directions
from lidarium.mapping.grids.scan_polygon import fill_scan_polygon, scan_ends
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.views import grid_at


@kernel(inline="always")
def score_robot(world: WorldArrays, row: int, first: int, robots: int, scratch: ScanScratch) -> None:
    """Add the area seen by a robot's true ranges to its mask."""
    scratch.windows[:] = np.uint64(0)
    beam_directions(world.poses[row, 2], beams_of(world, row - first), scratch.directions)
    true_lengths(world.true_ranges[row], world.sensor[row - first], scratch.lengths)
    score_area(world, row, first, robots, scratch)


@kernel(forceinline=True, nrt=False)
def true_lengths(ranges: Array, sensor: Array, lengths: Array) -> None:
    """Fill the lengths of beams [map cells] from true ranges [m]; 0 for invalid ones."""
    scale = 1.0 / sensor[MAP_RESOLUTION]
    for beam in range(lengths.shape[0]):
        value = ranges[beam]
        lengths[beam] = min(value, sensor[RANGE_MAX]) * scale if value == value else 0.0


@kernel(inline="always")
def window_corner(x: float, y: float, reach: float) -> tuple[int, int]:
    """Return the row and column of the map at which a scan's window begins [cells].

    The scan is from x, y; the column is a multiple of 64.
    """
    margin = int(reach) + 3
    return int(math.floor(y)) - margin, ((int(math.floor(x)) - margin) >> 6) << 6


@kernel(forceinline=True, nrt=False)
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

    Returns the box that holds bits, and its first row and word in the masks.
    """
    sensor, frame = world.sensor[row - first], world.frames[first // robots]
    scale = 1.0 / sensor[MAP_RESOLUTION]
    x, y = (world.poses[row, 0] - frame[FRAME_X]) * scale, (world.poses[row, 1] - frame[FRAME_Y]) * scale
    row_offset, column_offset = window_corner(x, y, sensor[RANGE_MAX] * scale)
    local_x, local_y = x - column_offset, y - row_offset
    scan_ends(lengths, directions, local_x, local_y, ends)
    box: tuple[int, int, int, int] = fill_scan_polygon(
        lengths, directions, ends, local_x, local_y, sensor[ANGLE_INCREMENT], sensor[FULL_CIRCLE] != 0.0, bits
    )
    return box, row_offset, column_offset >> 6


@kernel(nrt=False)
def score_area(
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
        grid_at(masks[OWN_MASK], masks[MASK_ROWS], masks[MASK_WORDS], np.uint64),
        grid_at(masks[COUNTED_MASK], masks[MASK_ROWS], masks[MASK_WORDS], np.uint64),
    )
    world.seen[row] += mark_seen(own, counted, bits, box, row_offset, word_offset, world.boxes[row])
    return box


@kernel
def footprint(
    world: WorldArrays, row: int, first: int, robots: int, bits: Array
) -> tuple[tuple[int, int, int, int], int, int]:
    """Fill the area that a robot's true beams see from its current pose.

    Nothing in the world changes.

    Parameters
    ----------
    bits : (window rows, words) uint64
        Zero on entry; of the shape of ``window_rows`` and ``window_words``.
    """
    sensor, beams = world.sensor[row - first], world.ranges.shape[1]
    directions, lengths, ends = np.empty((4, beams)), np.empty(beams), np.empty((2, beams))
    if is_noisy(sensor) or world.sensor[0, SCAN_STEPS] > 1.0:
        # Keep the people and doors that the robot recognised in its last scan.
        marks, gap = world.recognised[row : row + 1].copy(), np.inf
        if world.walkers.shape[0] > 0:
            gap = world.safety[row, PERSON_GAP]
        measure(world, row, first, robots, directions, np.empty(beams, np.float32), lengths)
        world.recognised[row : row + 1] = marks
        if world.walkers.shape[0] > 0:
            world.safety[row, PERSON_GAP] = gap
    else:
        # The sensor measured the true ranges from here: nothing has to be cast again.
        beam_directions(world.poses[row, 2], beams_of(world, row - first), directions)
        true_lengths(world.ranges[row], sensor, lengths)
    return _seen_area(world, row, first, robots, lengths, directions, ends, bits)  # type: ignore[no-any-return]
