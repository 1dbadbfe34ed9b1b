"""Counts what the robots' maps know, in step with them: only what lies within reach of where a robot has been since is looked at."""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.coverage import count_bits, pack_bits
from lidarium.envs.exploration import ExplorationEnv
from lidarium.envs.simulation.arrays import OWN_FRAME, WorldArrays, world_at
from lidarium.envs.simulation.stages import MAP_RESOLUTION, RANGE_MAX
from lidarium.evaluation.beliefs import shares_one_map
from lidarium.evaluation.truth import Truth
from lidarium.mapping.cell_blocks import negative_cells, positive_cells
from lidarium.mapping.kernels import Array, int8_grid_at, kernel

KNOWABLE, VALID, COUNTED = range(3)
"""Places of the true masks, and of what is counted: known cells within the first and the second, free ones within the third."""

KNOWN, FREE = range(2)
"""Places of the bits of a map."""

SLACK = 4
"""Cells by which a map may change beyond the longest range: a hit lies in the cell beyond its beam, and lattices are not aligned."""


@kernel
def _looked_up(world: WorldArrays, row: int, episode: int, line: int, word: int, wanted: np.uint64) -> tuple[np.uint64, np.uint64]:
    """Say which wanted cells of a word of the floor's lattice are negative and which positive in a map of a frame of its own."""
    belief, start, origin, frame = world.maps[row], world.starts[row], world.origins[row], world.frames[episode]
    log_odds = int8_grid_at(belief[0], belief[1], belief[2])
    resolution = world.sensor[MAP_RESOLUTION]
    cosine, sine = math.cos(start[2]), math.sin(start[2])
    north = (line + 0.5) * resolution + frame[1] - start[1]
    negative, positive = np.uint64(0), np.uint64(0)
    while wanted != np.uint64(0):
        bit = wanted & (~wanted + np.uint64(1))
        wanted ^= bit
        east = (word * 64 + count_bits(bit - np.uint64(1)) + 0.5) * resolution + frame[0] - start[0]
        i = int(math.floor((cosine * north - sine * east - origin[1]) / resolution))
        j = int(math.floor((cosine * east + sine * north - origin[0]) / resolution))
        if 0 <= i < belief[1] and 0 <= j < belief[2]:
            value = log_odds[i, j]
            if value < 0:
                negative |= bit
            elif value > 0:
                positive |= bit
    return negative, positive


@kernel
def _box(
    world: WorldArrays, row: int, episode: int, pose: Array, way: float, change: Array, shape: tuple[int, int]
) -> tuple[int, int, int, int]:
    """Rows and words that a robot's scans may have changed since it stood at a pose: row_low, row_high, word_low, word_high."""
    resolution, frame = world.sensor[MAP_RESOLUTION], world.frames[episode]
    reach = (world.sensor[RANGE_MAX] + world.travelled[row] - way) / resolution + SLACK
    x, y = (pose[0] - frame[0]) / resolution, (pose[1] - frame[1]) / resolution
    row_low, row_high = max(int(math.floor(y - reach)), 0), min(int(math.ceil(y + reach)), shape[0])
    column_low, column_high = max(int(math.floor(x - reach)), 0), min(int(math.ceil(x + reach)), 64 * shape[1])
    if not world.flags[row] & OWN_FRAME:
        row_low, row_high = max(row_low, change[0]), min(row_high, change[1])
        column_low, column_high = max(column_low, change[2]), min(column_high, change[3])
    return row_low, row_high, column_low >> 6, (column_high + 63) >> 6


@kernel
def _free_of_sum(world: WorldArrays, first: int, robots: int, line: int, word: int, cells: np.uint64) -> np.uint64:
    """Say which of some cells of aligned maps have a negative sum."""
    free = np.uint64(0)
    while cells != np.uint64(0):
        bit = cells & (~cells + np.uint64(1))
        cells ^= bit
        column, total = word * 64 + count_bits(bit - np.uint64(1)), 0
        for row in range(first, first + robots):
            belief = world.maps[row]
            total += int8_grid_at(belief[0], belief[1], belief[2])[line, column]
        if total < 0:
            free |= bit
    return free


@kernel(inline=True)
def _sum_up(
    world: WorldArrays, first: int, robots: int, shares: bool, truth: Array, bits: Array, disputed: Array, counts: Array, i: int, j: int
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
            counts[robots, kind] += count_bits(known & truth[kind, i, j]) - count_bits(old & truth[kind, i, j])
        bits[robots, i, j, KNOWN] = known
    if shares:
        disputed[i, j] = free & occupied & truth[COUNTED, i, j]
        free &= ~occupied
        if disputed[i, j] != np.uint64(0):
            free |= _free_of_sum(world, first, robots, i, j, disputed[i, j])
        _recount_free(truth, bits, counts, robots, i, j, free)


@kernel(inline=True)
def _recount_free(truth: Array, bits: Array, counts: Array, who: int, i: int, j: int, free: np.uint64) -> None:
    """Put new bits of free cells in place of the old ones, and change the count by the difference."""
    old = bits[who, i, j, FREE]
    if free != old:
        counts[who, COUNTED] += count_bits(free & truth[COUNTED, i, j]) - count_bits(old & truth[COUNTED, i, j])
        bits[who, i, j, FREE] = free


@kernel
def _take_in(
    table: Array,
    episode: int,
    robots: int,
    shares: bool,
    truth: Array,
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
    episode, robots : int
        Which episode, and the size of its team.
    shares : bool
        Whether all robots hold the sum of the maps, which lie on one lattice then.
    truth : (3, rows, words) uint64
        The true masks.
    bits : (robots + 1, rows, words, 2) uint64
        Which cells each robot's own map knows, and which of them it says are free; those of the team at the end. Updated.
    disputed : (rows, words) uint64
        Cells of F of which one map says that they are free, and another that they are not. Updated.
    counts : (robots + 1, 3) int64
        Of the team, known cells within ``KNOWABLE`` and ``VALID``; free cells within ``COUNTED`` of the map that all robots share, else
        of each robot's. Updated.
    poses, ways : (robots, 3) float64 and (robots,) float64
        Where each robot stood at the last call, and how far it had driven by then. Updated.
    changes : (robots, 4) int64
        What part of each map has changed since, of ``note_changes``. Begun anew.
    """
    world = world_at(table)
    first = episode * robots
    for robot in range(robots):
        row, own = first + robot, bits[robot]
        row_low, row_high, word_low, word_high = _box(world, row, episode, poses[robot], ways[robot], changes[robot], truth[0].shape)
        address, columns, is_own_frame = world.maps[row, 0], world.maps[row, 2], world.flags[row] & OWN_FRAME != 0
        for i in range(row_low, row_high):
            for j in range(word_low, word_high):
                wanted = truth[KNOWABLE, i, j]
                if wanted == np.uint64(0):
                    continue
                if is_own_frame:
                    negative, positive = _looked_up(world, row, episode, i, j, wanted)
                else:
                    place = address + i * columns + 64 * j
                    negative, positive = negative_cells(place), positive_cells(place)
                has_changed = negative != own[i, j, FREE] or (negative | positive) != own[i, j, KNOWN]
                own[i, j, KNOWN] = negative | positive
                if shares:
                    own[i, j, FREE] = negative
                else:
                    _recount_free(truth, bits, counts, robot, i, j, negative)
                # What is disputed may be settled by another sum, though no map has changed its mind.
                if has_changed or (shares and disputed[i, j] != np.uint64(0)):
                    _sum_up(world, first, robots, shares, truth, bits, disputed, counts, i, j)
    for robot in range(robots):
        ways[robot] = world.travelled[first + robot]
        for axis in range(3):
            poses[robot, axis] = world.poses[first + robot, axis]
        changes[robot, 0], changes[robot, 1] = world.maps[first + robot, 1], 0
        changes[robot, 2], changes[robot, 3] = world.maps[first + robot, 2], 0


@kernel
def _note_changes(windows: Array, changes: Array) -> None:
    """Extend what has changed (robots, 4) by windows, which planning begins anew whenever it takes a map in."""
    for row in range(changes.shape[0]):
        changes[row, 0], changes[row, 1] = min(changes[row, 0], windows[row, 0]), max(changes[row, 1], windows[row, 1])
        changes[row, 2], changes[row, 3] = min(changes[row, 2], windows[row, 2]), max(changes[row, 3], windows[row, 3])


class MapTally:
    """What the maps of an episode know, counted in step with them.

    Parameters
    ----------
    env : ExplorationEnv
        The environment after its reset.
    truth : Truth
        What is true of its floor.

    Attributes
    ----------
    counts : (robots + 1, 3) int64
        In the last row the cells within those that can be known, and within F and its surface, that the team's map knows. Cells of F
        that are free: in the last row by the sum of the maps where all robots share it, else by each robot's own map in its row.
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
        self._bits, self._disputed = np.zeros((robots + 1, rows, words, 2), np.uint64), np.zeros((rows, words), np.uint64)
        self.counts = np.zeros((robots + 1, 3), np.int64)
        self._poses, self._ways = world.poses.copy(), world.travelled.copy()
        self._changes = world.windows.copy()
        self.shares = shares_one_map(env)

    def note_step(self, env: ExplorationEnv) -> None:
        """Note where maps have changed; wanted after every step."""
        _note_changes(env.world.windows, self._changes)

    def take_in(self, env: ExplorationEnv) -> None:
        """Bring the counts up to date."""
        world = env.world
        _take_in(
            world.table, 0, env.settings.robots, self.shares, self._truth, self._bits, self._disputed, self.counts, self._poses,
            self._ways, self._changes,
        )  # fmt: skip

    @property
    def known_shares(self) -> NDArray[np.float64]:
        """``C_known`` of each robot's own map when the maps were taken in last, shape (robots,)."""
        known = np.bitwise_count(self._bits[:-1, :, :, KNOWN] & self._truth[KNOWABLE]).sum(axis=(1, 2), dtype=np.int64)
        return np.asarray(known / max(int(self.sizes[KNOWABLE]), 1))
