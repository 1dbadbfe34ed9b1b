"""Kernels that count which cells of maps are right."""

import math

import numpy as np

from lidarium.envs.scoring.coverage import count_bits
from lidarium.envs.simulation.kernels.arrays import (
    MAP,
    MAP_COLUMNS,
    MAP_RESOLUTION,
    MAP_ROWS,
    OWN_FRAME,
    RANGE_MAX,
    TRUE_POSE,
    WorldArrays,
    world_at,
)
from lidarium.mapping.kernels.cell_blocks import negative_cells, positive_cells
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.views import int8_grid_at

KNOWABLE, VALID, COUNTED = range(3)
"""Places of the true masks, and of the counts made with them.

Counted are known cells within the first and the second, and free cells within the third.
"""


KNOWN, FREE = range(2)
"""Places of the bits of a map."""


SLACK = 4
"""Cells by which a map may change beyond the longest range.

A hit lies in the cell beyond its beam.
"""


@kernel
def _cells_beyond(world: WorldArrays, row: int, episode: int) -> tuple[int, int]:
    """Rows and columns by which a map on the floor's lattice begins before the masks."""
    frame, origin, resolution = world.frames[episode], world.origins[row], world.sensor[MAP_RESOLUTION]
    return int(round((frame[1] - origin[1]) / resolution)), int(round((frame[0] - origin[0]) / resolution))


@kernel
def _box(
    world: WorldArrays, row: int, episode: int, pose: Array, way: float, change: Array, shape: tuple[int, int]
) -> tuple[int, int, int, int]:
    """Return the rows and words that a robot's scans may have changed since a pose.

    They are row_low, row_high, word_low, word_high, since the robot stood at the pose.
    """
    resolution, frame = world.sensor[MAP_RESOLUTION], world.frames[episode]
    first_row, first_column = _cells_beyond(world, row, episode)
    if not world.flags[row] & TRUE_POSE:
        # Whoever does not know where he is may map what is far from there.
        return (
            max(change[0] - first_row, 0),
            min(change[1] - first_row, shape[0]),
            max(change[2] - first_column, 0) >> 6,
            min((change[3] - first_column + 63) >> 6, shape[1]),
        )
    reach = (world.sensor[RANGE_MAX] + world.travelled[row] - way) / resolution + SLACK
    x, y = (pose[0] - frame[0]) / resolution, (pose[1] - frame[1]) / resolution
    row_low, row_high = max(int(math.floor(y - reach)), 0), min(int(math.ceil(y + reach)), shape[0])
    column_low, column_high = (
        max(int(math.floor(x - reach)), 0),
        min(int(math.ceil(x + reach)), 64 * shape[1]),
    )
    row_low, row_high = max(row_low, change[0]), min(row_high, change[1])
    column_low, column_high = max(column_low, change[2]), min(column_high, change[3])
    return row_low, row_high, column_low >> 6, (column_high + 63) >> 6


@kernel
def _free_of_sum(
    world: WorldArrays, first: int, robots: int, line: int, word: int, cells: np.uint64
) -> np.uint64:
    """Say which of some cells of aligned maps have a negative sum."""
    free = np.uint64(0)
    while cells != np.uint64(0):
        bit = cells & (~cells + np.uint64(1))
        cells ^= bit
        column, total = word * 64 + count_bits(bit - np.uint64(1)), 0
        for row in range(first, first + robots):
            belief = world.belief_rows[row]
            first_row, first_column = _cells_beyond(world, row, first // robots)
            total += int8_grid_at(belief[0], belief[1], belief[2])[line + first_row, column + first_column]
        if total < 0:
            free |= bit
    return free


@kernel(inline=True)
def _recount_free(
    truth: Array, bits: Array, counts: Array, who: int, i: int, j: int, free: np.uint64
) -> None:
    """Replace old bits of free cells by new ones, and update the count.

    The count changes by the difference.
    """
    old = bits[who, i, j, FREE]
    if free != old:
        counts[who, COUNTED] += count_bits(free & truth[COUNTED, i, j]) - count_bits(
            old & truth[COUNTED, i, j]
        )
        bits[who, i, j, FREE] = free


@kernel(inline=True)
def _sum_up(
    world: WorldArrays,
    first: int,
    robots: int,
    shares: bool,
    truth: Array,
    bits: Array,
    disputed: Array,
    counts: Array,
    i: int,
    j: int,
) -> None:
    """Bring a word of the team's map up to date, and the counts by the difference."""
    known, free, occupied = np.uint64(0), np.uint64(0), np.uint64(0)
    for robot in range(robots):
        known |= bits[robot, i, j, KNOWN]
        free |= bits[robot, i, j, FREE]
        occupied |= bits[robot, i, j, KNOWN] & ~bits[robot, i, j, FREE]
    old = bits[robots, i, j, KNOWN]
    if known != old:
        for kind in (KNOWABLE, VALID):
            counts[robots, kind] += count_bits(known & truth[kind, i, j]) - count_bits(
                old & truth[kind, i, j]
            )
        bits[robots, i, j, KNOWN] = known
    if shares:
        disputed[i, j] = free & occupied & truth[COUNTED, i, j]
        free &= ~occupied
        if disputed[i, j] != np.uint64(0):
            free |= _free_of_sum(world, first, robots, i, j, disputed[i, j])
        _recount_free(truth, bits, counts, robots, i, j, free)


@kernel
def _take_in_aligned(
    world: WorldArrays,
    first: int,
    robot: int,
    robots: int,
    shares: bool,
    truth: Array,
    bits: Array,
    disputed: Array,
    counts: Array,
    box: tuple[int, int, int, int],
) -> None:
    """Update the counts for a map on the floor's lattice.

    The update is in a box of rows and words.
    """
    own, columns = bits[robot], world.belief_rows[first + robot, MAP_COLUMNS]
    first_row, first_column = _cells_beyond(world, first + robot, first // robots)
    address = world.belief_rows[first + robot, MAP] + first_row * columns + first_column
    for i in range(box[0], box[1]):
        for j in range(box[2], box[3]):
            if truth[KNOWABLE, i, j] == np.uint64(0):
                continue
            place = address + i * columns + 64 * j
            negative = negative_cells(place)
            known = negative | positive_cells(place)
            has_changed = negative != own[i, j, FREE] or known != own[i, j, KNOWN]
            own[i, j, KNOWN] = known
            if shares:
                own[i, j, FREE] = negative
            else:
                _recount_free(truth, bits, counts, robot, i, j, negative)
            # What is disputed may be settled by another sum, though no map has changed its mind.
            if has_changed or (shares and disputed[i, j] != np.uint64(0)):
                _sum_up(world, first, robots, shares, truth, bits, disputed, counts, i, j)


@kernel
def _take_in_turned(
    world: WorldArrays,
    first: int,
    robot: int,
    robots: int,
    truth: Array,
    signs: Array,
    bits: Array,
    disputed: Array,
    counts: Array,
    change: Array,
) -> None:
    """Update the counts for a map in a frame of its own.

    Each cell that has changed is transformed to the floor's lattice.

    ``signs`` (rows, words, 2) are the bits on the map's own lattice. As in `beliefs.maps_on_floor`, a cell of
    the floor is what the cell of the map says in which its centre lies.
    """
    row = first + robot
    belief, start, origin, frame = (
        world.belief_rows[row],
        world.starts[row],
        world.origins[row],
        world.frames[first // robots],
    )
    resolution = world.sensor[MAP_RESOLUTION]
    cosine, sine = math.cos(start[2]), math.sin(start[2])
    for line in range(max(change[0], 0), min(change[1], belief[1])):
        for word in range(max(change[2], 0) >> 6, (min(change[3], belief[2]) + 63) >> 6):
            place = belief[0] + line * belief[2] + 64 * word
            negative = negative_cells(place)
            known = negative | positive_cells(place)
            changed = (known ^ signs[line, word, KNOWN]) | (negative ^ signs[line, word, FREE])
            signs[line, word, KNOWN], signs[line, word, FREE] = known, negative
            while changed != np.uint64(0):
                bit = changed & (~changed + np.uint64(1))
                changed ^= bit
                column = word * 64 + count_bits(bit - np.uint64(1))
                own_x, own_y = (column + 0.5) * resolution + origin[0], (line + 0.5) * resolution + origin[1]
                near_i = int(math.floor((sine * own_x + cosine * own_y + start[1] - frame[1]) / resolution))
                near_j = int(math.floor((cosine * own_x - sine * own_y + start[0] - frame[0]) / resolution))
                # The centres within a turned cell are no further than this from the cell that holds its own
                # centre.
                for i in range(max(near_i - 1, 0), min(near_i + 2, truth.shape[1])):
                    for j in range(max(near_j - 1, 0), min(near_j + 2, 64 * truth.shape[2])):
                        east, north = (
                            (j + 0.5) * resolution + frame[0] - start[0],
                            (i + 0.5) * resolution + frame[1] - start[1],
                        )
                        if int(math.floor((cosine * east + sine * north - origin[0]) / resolution)) != column:
                            continue
                        if int(math.floor((cosine * north - sine * east - origin[1]) / resolution)) != line:
                            continue
                        cell = np.uint64(1) << np.uint64(j & 63)
                        own = bits[robot, i, j >> 6]
                        own[KNOWN] = own[KNOWN] | cell if known & bit else own[KNOWN] & ~cell
                        free = own[FREE] | cell if negative & bit else own[FREE] & ~cell
                        _recount_free(truth, bits, counts, robot, i, j >> 6, free)
                        _sum_up(world, first, robots, False, truth, bits, disputed, counts, i, j >> 6)


@kernel
def count_maps(
    table: Array,
    episode: int,
    shares: bool,
    truth: Array,
    signs: Array,
    bits: Array,
    disputed: Array,
    counts: Array,
    poses: Array,
    ways: Array,
    changes: Array,
) -> None:
    """Bring the bits and counts of an episode's maps up to date.

    Parameters
    ----------
    table : (28, 3) int64
        The world's arrays.
    episode : int
        Which episode.
    shares : bool
        Whether all robots hold the sum of the maps, which lie on one lattice then.
    truth : (3, rows, words) uint64
        The true masks.
    signs : (robots, map rows, map words, 2) uint64
        Which cells maps in frames of their own know, and which of them they say are free, on their own
        lattices; not used for maps that lie on the floor's. Updated.
    bits : (robots + 1, rows, words, 2) uint64
        The same of each robot's own map on the floor's lattice; those of the team at the end. Updated.
    disputed : (rows, words) uint64
        Cells of F of which one map says that they are free, and another that they are not. Updated.
    counts : (robots + 1, 3) int64
        Of the team, known cells within ``KNOWABLE`` and ``VALID``; free cells within ``COUNTED`` of the map
        that all robots share, else of each robot's. Updated.
    poses, ways : (robots, 3) float64 and (robots,) float64
        Where each robot stood at the last call, and how far it had driven by then. Updated.
    changes : (robots, 4) int64
        What part of each map has changed since, of ``note_changes``. Begun anew.
    """
    world, robots = world_at(table), poses.shape[0]
    first = episode * robots
    for robot in range(robots):
        row = first + robot
        if world.flags[row] & OWN_FRAME:
            _take_in_turned(
                world, first, robot, robots, truth, signs[robot], bits, disputed, counts, changes[robot]
            )
        else:
            box = _box(world, row, episode, poses[robot], ways[robot], changes[robot], truth[0].shape)
            _take_in_aligned(world, first, robot, robots, shares, truth, bits, disputed, counts, box)
        ways[robot] = world.travelled[row]
        for axis in range(3):
            poses[robot, axis] = world.poses[row, axis]
        changes[robot, 0], changes[robot, 1] = world.belief_rows[row, MAP_ROWS], 0
        changes[robot, 2], changes[robot, 3] = world.belief_rows[row, MAP_COLUMNS], 0


@kernel
def note_changes(windows: Array, changes: Array) -> None:
    """Extend the windows of changes (robots, 4) by those of the maps.

    Planning begins the latter anew whenever it takes a map in.
    """
    for row in range(changes.shape[0]):
        changes[row, 0], changes[row, 1] = (
            min(changes[row, 0], windows[row, 0]),
            max(changes[row, 1], windows[row, 1]),
        )
        changes[row, 2], changes[row, 3] = (
            min(changes[row, 2], windows[row, 2]),
            max(changes[row, 3], windows[row, 3]),
        )
