"""Counts of known and of right cells of the robots' maps, updated step by step.

Only cells in reach of a robot's positions since the last update are examined.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.simulation.coverage import count_bits, pack_bits
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
from lidarium.evaluation.truth.beliefs import held_maps, shares_one_map
from lidarium.evaluation.truth.true_map import Truth
from lidarium.mapping.grids.scan_integration import WORD
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.simd.cells import negative_cells, positive_cells
from lidarium.mapping.kernels.views import grid_at

KNOWABLE, VALID, COUNTED = range(3)
"""Places of the true masks, and of the counts made with them.

Counted are known cells within the first and the second, and free cells within the third.
"""


KNOWN, FREE = range(2)
"""Places of the bits of a map."""


class CountedMaps(NamedTuple):
    """The maps of a team as bits on the floor's lattice, and counts of them.

    Attributes
    ----------
    truth : (3, rows, words) uint64
        The true masks.
    bits : (robots + 1, rows, words, 2) uint64
        Cells that each robot's own map knows, and those of them that it has as free; the team's map comes last.
    disputed : (rows, words) uint64
        Cells of F that are free on one map, and not free on another.
    counts : (robots + 1, 3) int64
        Of the team, known cells within ``KNOWABLE`` and ``VALID``; free cells within ``COUNTED`` of the map
        that all robots share, else of each robot's.
    """

    truth: Array
    bits: Array
    disputed: Array
    counts: Array


class Team(NamedTuple):
    """Robots of one episode: first row, number, and whether they share one map."""

    first: int
    robots: int
    shares: bool


@kernel
def cells_beyond(world: WorldArrays, row: int, episode: int) -> tuple[int, int]:
    """Rows and columns by which a map on the floor's lattice begins before the masks."""
    frame, origin, resolution = world.frames[episode], world.origins[row], world.sensor[0, MAP_RESOLUTION]
    return int(round((frame[1] - origin[1]) / resolution)), int(round((frame[0] - origin[0]) / resolution))


@kernel
def _free_of_sum(world: WorldArrays, team: Team, line: int, word: int, cells: np.uint64) -> np.uint64:
    """Return which of some cells of aligned maps have a negative sum."""
    free = np.uint64(0)
    while cells != np.uint64(0):
        bit = cells & (~cells + np.uint64(1))
        cells ^= bit
        column, total = word * 64 + count_bits(bit - np.uint64(1)), 0
        for row in range(team.first, team.first + team.robots):
            belief = world.belief_rows[row]
            first_row, first_column = cells_beyond(world, row, team.first // team.robots)
            total += grid_at(belief[0], belief[1], belief[2], np.int8)[line + first_row, column + first_column]
        if total < 0:
            free |= bit
    return free


@kernel(forceinline=True)
def recount_free(maps: CountedMaps, who: int, i: int, j: int, free: np.uint64) -> None:
    """Replace old bits of free cells by new ones, and update the count.

    The count changes by the difference.
    """
    old, counted = maps.bits[who, i, j, FREE], maps.truth[COUNTED, i, j]
    if free != old:
        maps.counts[who, COUNTED] += count_bits(free & counted) - count_bits(old & counted)
        maps.bits[who, i, j, FREE] = free


@kernel(forceinline=True)
def sum_up(world: WorldArrays, team: Team, maps: CountedMaps, i: int, j: int) -> None:
    """Update a word of the team's map, and the counts by the difference."""
    truth, bits, disputed, counts, robots = maps.truth, maps.bits, maps.disputed, maps.counts, team.robots
    known, free, occupied = np.uint64(0), np.uint64(0), np.uint64(0)
    for robot in range(robots):
        known |= bits[robot, i, j, KNOWN]
        free |= bits[robot, i, j, FREE]
        occupied |= bits[robot, i, j, KNOWN] & ~bits[robot, i, j, FREE]
    old = bits[robots, i, j, KNOWN]
    if known != old:
        for kind in (KNOWABLE, VALID):
            counts[robots, kind] += count_bits(known & truth[kind, i, j]) - count_bits(old & truth[kind, i, j])
        bits[robots, i, j, KNOWN] = known
    if team.shares:
        disputed[i, j] = free & occupied & truth[COUNTED, i, j]
        free &= ~occupied
        if disputed[i, j] != np.uint64(0):
            free |= _free_of_sum(world, team, i, j, disputed[i, j])
        recount_free(maps, robots, i, j, free)


SLACK = 4
"""Cells by which a map may change beyond the longest range.

A hit lies in the cell beyond its beam.
"""


class _LastVisit(NamedTuple):
    """Positions of robots and changes of their maps since the last count.

    Attributes
    ----------
    poses, travelled : (robots, 3), (robots,) float64
        True pose of each robot [m, rad], and length of its path by then [m].
    changes : (robots, 4) int64
        Changed part of each map, of ``note_changes``.
    """

    poses: Array
    travelled: Array
    changes: Array


@kernel
def _box(
    world: WorldArrays, team: Team, robot: int, last: _LastVisit, shape: tuple[int, int]
) -> tuple[int, int, int, int]:
    """Return the rows and words that scans may have changed since the last visit.

    They are row_low, row_high, word_low, word_high.
    """
    row, episode = team.first + robot, team.first // team.robots
    pose, change = last.poses[robot], last.changes[robot]
    resolution, frame = world.sensor[0, MAP_RESOLUTION], world.frames[episode]
    first_row, first_column = cells_beyond(world, row, episode)
    if not world.flags[row] & TRUE_POSE:
        # A robot with a wrong believed pose may map cells that are far away.
        return (
            max(change[0] - first_row, 0),
            min(change[1] - first_row, shape[0]),
            max(change[2] - first_column, 0) >> 6,
            min((change[3] - first_column + 63) >> 6, shape[1]),
        )
    reach = (world.sensor[robot, RANGE_MAX] + world.travelled[row] - last.travelled[robot]) / resolution + SLACK
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
            # A disputed cell may be settled by another sum, though no map has changed it.
            if has_changed or (team.shares and disputed[i, j] != np.uint64(0)):
                sum_up(world, team, maps, i, j)


@kernel
def _count_turned(world: WorldArrays, team: Team, robot: int, maps: CountedMaps, signs: Array, change: Array) -> None:
    """Update the counts for a map in a frame of its own.

    Each cell that has changed is transformed to the floor's lattice.

    ``signs`` (rows, words, 2) are the bits on the map's own lattice. As in `beliefs.maps_on_floor`, a cell of the
    floor has the value of the map's cell that contains its centre.
    """
    row, truth = team.first + robot, maps.truth
    belief, start, origin, frame = (
        world.belief_rows[row],
        world.starts[row],
        world.origins[row],
        world.frames[team.first // team.robots],
    )
    resolution = world.sensor[0, MAP_RESOLUTION]
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
def _count_maps(table: Array, episode: int, shares: bool, maps: CountedMaps, signs: Array, last: _LastVisit) -> None:
    """Update the bits and counts of an episode's maps.

    Parameters
    ----------
    table : (28, 3) int64
        The world's arrays.
    signs : (robots, map rows, map words, 2) uint64
        Which cells maps in frames of their own know, and which of them they say are free, on their own
        lattices; not used for maps that lie on the floor's. Updated.
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


class MapTally:
    """Counts of the maps of an episode, updated with them.

    Attributes
    ----------
    counts : (robots + 1, 3) int64
        In the last row the cells within those that can be known, and within F and its surface, that the
        team's map knows. Cells of F that are free: in the last row by the sum of the maps if all robots
        share it, else by each robot's own map in its row.
    shares : bool
        Whether all robots share the sum of the maps.
    sizes : (3,) int64
        All cells that can be known, of F and its surface, and of F.
    """

    def __init__(self, env: ExplorationEnv, truth: Truth) -> None:
        world, robots = env.world, env.settings.robots
        self._truth = np.stack([pack_bits(mask) for mask in (truth.knowable, truth.valid, truth.counted)])
        self.sizes = np.bitwise_count(self._truth).sum(axis=(1, 2), dtype=np.int64)
        rows, words = self._truth.shape[1:]
        self.counts = np.zeros((robots + 1, 3), np.int64)
        self._maps = CountedMaps(
            self._truth,
            np.zeros((robots + 1, rows, words, 2), np.uint64),
            np.zeros((rows, words), np.uint64),
            self.counts,
        )
        self._last = _LastVisit(world.poses.copy(), world.travelled.copy(), env.beliefs.windows.copy())
        map_rows, map_columns = (0, 0) if env.settings.known_starts else env.beliefs.log_odds[0].shape
        self._signs = np.zeros((robots, map_rows, map_columns // WORD, 2), np.uint64)
        self.shares = shares_one_map(env)

    def note_step(self, env: ExplorationEnv) -> None:
        """Record changes of the maps; call this after every step."""
        note_changes(env.beliefs.windows, self._last.changes)

    def take_in(self, env: ExplorationEnv) -> None:
        """Update the counts."""
        _count_maps(env.simulation.table, 0, self.shares, self._maps, self._signs, self._last)
        if env.perception.hears:
            for robot, held in enumerate(held_maps(env)):
                self.counts[robot, COUNTED] = int(np.bitwise_count(pack_bits(held < 0) & self._truth[COUNTED]).sum())

    @property
    def known_shares(self) -> NDArray[np.float64]:
        """Return ``C_known`` of each robot's own map at the last update, (robots,).

        The last update is when the maps were taken in last.
        """
        known = np.bitwise_count(self._maps.bits[:-1, :, :, KNOWN] & self._truth[KNOWABLE]).sum(
            axis=(1, 2), dtype=np.int64
        )
        return np.asarray(known / max(int(self.sizes[KNOWABLE]), 1))
