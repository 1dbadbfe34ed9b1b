"""Kernels that count which cells of maps are right."""

import math
from typing import NamedTuple

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
from lidarium.evaluation.truth.team_counts import (
    FREE,
    KNOWABLE,
    KNOWN,
    CountedMaps,
    Team,
    cells_beyond,
    recount_free,
    sum_up,
)
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.sign_blocks import negative_cells, positive_cells

SLACK = 4
"""Cells by which a map may change beyond the longest range.

A hit lies in the cell beyond its beam.
"""


class LastVisit(NamedTuple):
    """Where robots stood and what has changed since their maps were counted last.

    Attributes
    ----------
    poses, travelled : (robots, 3), (robots,) float64
        Where each robot stood [m, rad], and how far it had driven by then [m].
    changes : (robots, 4) int64
        What part of each map has changed since, of ``note_changes``.
    """

    poses: Array
    travelled: Array
    changes: Array


@kernel
def _box(
    world: WorldArrays, team: Team, robot: int, last: LastVisit, shape: tuple[int, int]
) -> tuple[int, int, int, int]:
    """Return the rows and words that scans may have changed since the last visit.

    They are row_low, row_high, word_low, word_high.
    """
    row, episode = team.first + robot, team.first // team.robots
    pose, change = last.poses[robot], last.changes[robot]
    resolution, frame = world.sensor[MAP_RESOLUTION], world.frames[episode]
    first_row, first_column = cells_beyond(world, row, episode)
    if not world.flags[row] & TRUE_POSE:
        # Whoever does not know where he is may map what is far from there.
        return (
            max(change[0] - first_row, 0),
            min(change[1] - first_row, shape[0]),
            max(change[2] - first_column, 0) >> 6,
            min((change[3] - first_column + 63) >> 6, shape[1]),
        )
    reach = (world.sensor[RANGE_MAX] + world.travelled[row] - last.travelled[robot]) / resolution + SLACK
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
def _count_aligned(
    world: WorldArrays, team: Team, robot: int, maps: CountedMaps, box: tuple[int, int, int, int]
) -> None:
    """Update the counts for a map on the floor's lattice.

    The update is in a box of rows and words.
    """
    truth, disputed, own, row = maps.truth, maps.disputed, maps.bits[robot], team.first + robot
    columns = world.belief_rows[row, MAP_COLUMNS]
    first_row, first_column = cells_beyond(world, row, team.first // team.robots)
    address = world.belief_rows[row, MAP] + first_row * columns + first_column
    for i in range(box[0], box[1]):
        for j in range(box[2], box[3]):
            if truth[KNOWABLE, i, j] == np.uint64(0):
                continue
            place = address + i * columns + 64 * j
            negative = negative_cells(place)
            known = negative | positive_cells(place)
            has_changed = negative != own[i, j, FREE] or known != own[i, j, KNOWN]
            own[i, j, KNOWN] = known
            if team.shares:
                own[i, j, FREE] = negative
            else:
                recount_free(maps, robot, i, j, negative)
            # What is disputed may be settled by another sum, though no map has changed its mind.
            if has_changed or (team.shares and disputed[i, j] != np.uint64(0)):
                sum_up(world, team, maps, i, j)


@kernel
def _count_turned(
    world: WorldArrays, team: Team, robot: int, maps: CountedMaps, signs: Array, change: Array
) -> None:
    """Update the counts for a map in a frame of its own.

    Each cell that has changed is transformed to the floor's lattice.

    ``signs`` (rows, words, 2) are the bits on the map's own lattice. As in `beliefs.maps_on_floor`, a cell of
    the floor is what the cell of the map says in which its centre lies.
    """
    row, truth = team.first + robot, maps.truth
    belief, start, origin, frame = (
        world.belief_rows[row],
        world.starts[row],
        world.origins[row],
        world.frames[team.first // team.robots],
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
                        own = maps.bits[robot, i, j >> 6]
                        own[KNOWN] = own[KNOWN] | cell if known & bit else own[KNOWN] & ~cell
                        free = own[FREE] | cell if negative & bit else own[FREE] & ~cell
                        recount_free(maps, robot, i, j >> 6, free)
                        sum_up(world, team, maps, i, j >> 6)


@kernel
def count_maps(
    table: Array, episode: int, shares: bool, maps: CountedMaps, signs: Array, last: LastVisit
) -> None:
    """Update the bits and counts of an episode's maps.

    Parameters
    ----------
    table : (28, 3) int64
        The world's arrays.
    episode : int
        Which episode.
    shares : bool
        Whether all robots hold the sum of the maps, which lie on one lattice then.
    maps : CountedMaps
        The maps on the floor's lattice; updated.
    signs : (robots, map rows, map words, 2) uint64
        Which cells maps in frames of their own know, and which of them they say are free, on their own
        lattices; not used for maps that lie on the floor's. Updated.
    last : LastVisit
        Of the last call; updated, and its changes are begun again.
    """
    world, poses, changes = world_at(table), last.poses, last.changes
    robots = poses.shape[0]
    first = episode * robots
    for robot in range(robots):
        row = first + robot
        if world.flags[row] & OWN_FRAME:
            team = Team(first, robots, False)
            _count_turned(world, team, robot, maps, signs[robot], changes[robot])
        else:
            team = Team(first, robots, shares)
            _count_aligned(world, team, robot, maps, _box(world, team, robot, last, maps.truth[0].shape))
        last.travelled[robot] = world.travelled[row]
        for axis in range(3):
            poses[robot, axis] = world.poses[row, axis]
        changes[robot, 0], changes[robot, 1] = world.belief_rows[row, MAP_ROWS], 0
        changes[robot, 2], changes[robot, 3] = world.belief_rows[row, MAP_COLUMNS], 0


@kernel
def note_changes(windows: Array, changes: Array) -> None:
    """Extend the windows of changes (robots, 4) by those of the maps.

    Planning begins the latter again whenever it takes a map in.
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
