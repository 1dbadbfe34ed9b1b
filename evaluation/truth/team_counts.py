"""Kernels that update the bits and counts of a team's map."""

from typing import NamedTuple

import numpy as np

from lidarium.envs.simulation.coverage import count_bits
from lidarium.envs.simulation.kernels.arrays import MAP_RESOLUTION, WorldArrays
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.views import grid_at

KNOWABLE, VALID, COUNTED = range(3)
"""Places of the true masks, and of the counts made with them.

Counted are known cells within the first and the second, and free cells within the third.
"""


KNOWN, FREE = range(2)
"""Places of the bits of a map."""


class CountedMaps(NamedTuple):
    """The maps of a team as bits on the floor's lattice, and what is counted of them.

    Attributes
    ----------
    truth : (3, rows, words) uint64
        The true masks.
    bits : (robots + 1, rows, words, 2) uint64
        Which cells each robot's own map knows, and which of them it says are free; those of the team at the
        end.
    disputed : (rows, words) uint64
        Cells of F of which one map says that they are free, and another that they are not.
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
    frame, origin, resolution = world.frames[episode], world.origins[row], world.sensor[MAP_RESOLUTION]
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
            log_odds = grid_at(belief[0], belief[1], belief[2], np.int8)
            total += log_odds[line + first_row, column + first_column]
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
            counts[robots, kind] += count_bits(known & truth[kind, i, j]) - count_bits(
                old & truth[kind, i, j]
            )
        bits[robots, i, j, KNOWN] = known
    if team.shares:
        disputed[i, j] = free & occupied & truth[COUNTED, i, j]
        free &= ~occupied
        if disputed[i, j] != np.uint64(0):
            free |= _free_of_sum(world, team, i, j, disputed[i, j])
        recount_free(maps, robots, i, j, free)
