"""Footprints of a team: what its robots see, and how much several see at once.

The robots see it from where they stand.
"""

import numpy as np

from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.simulation.coverage import count_bits
from lidarium.envs.simulation.kernels.arrays import (
    COUNTED_MASK,
    ENDED,
    MAP_RESOLUTION,
    MASK_ROWS,
    MASK_WORDS,
    RANGE_MAX,
    WorldArrays,
    world_at,
)
from lidarium.envs.simulation.kernels.masks import footprint
from lidarium.mapping.grids.scan_polygon import window_rows, window_words
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.views import grid_at


@kernel
def _is_any_pair_near(world: WorldArrays, first: int, robots: int) -> bool:
    """Whether the footprints of two robots at work may meet."""
    reach = 2.0 * world.sensor[RANGE_MAX] + 4.0 * world.sensor[MAP_RESOLUTION]
    for row in range(first, first + robots):
        for other in range(row + 1, first + robots):
            gap_x, gap_y = (
                world.poses[row, 0] - world.poses[other, 0],
                world.poses[row, 1] - world.poses[other, 1],
            )
            if (
                not (world.flags[row] | world.flags[other]) & ENDED
                and gap_x * gap_x + gap_y * gap_y < reach * reach
            ):
                return True
    return False


@kernel
def _count_footprints(table: Array, episode: int, windows: Array) -> tuple[int, int]:
    """Count the cells of F that a robot or more, and two or more, see now.

    Ended robots see nothing.

    Where no two footprints can meet, the first count is not needed and is 0. ``windows`` (robots, window
    rows, words) uint64 is scratch memory, all zero before and after.
    """
    world, robots = world_at(table), windows.shape[0]
    first = episode * robots
    if not _is_any_pair_near(world, first, robots):
        return 0, 0
    # Of each window the rows and words of the masks that may hold bits, and where it begins.
    boxes, spans, corners = (
        np.zeros((robots, 4), np.int64),
        np.zeros((robots, 4), np.int64),
        np.zeros((robots, 2), np.int64),
    )
    once, twice = 0, 0
    for robot in range(robots):
        row = first + robot
        if world.flags[row] & ENDED:
            continue
        masks = world.mask_rows[row]
        counted = grid_at(masks[COUNTED_MASK], masks[MASK_ROWS], masks[MASK_WORDS], np.uint64)
        box, row_offset, word_offset = footprint(world, row, first, robots, windows[robot])
        spans[robot, 0], spans[robot, 1], spans[robot, 2], spans[robot, 3] = box
        corners[robot, 0], corners[robot, 1] = row_offset, word_offset
        boxes[robot, 0], boxes[robot, 1] = (
            max(box[0] + row_offset, 0),
            min(box[1] + row_offset, masks[MASK_ROWS]),
        )
        boxes[robot, 2], boxes[robot, 3] = (
            max(box[2] + word_offset, 0),
            min(box[3] + word_offset, masks[MASK_WORDS]),
        )
        for i in range(boxes[robot, 0], boxes[robot, 1]):
            for j in range(boxes[robot, 2], boxes[robot, 3]):
                seen = windows[robot, i - row_offset, j - word_offset] & counted[i, j]
                if seen == np.uint64(0):
                    continue
                by_one, by_two = np.uint64(0), np.uint64(0)
                for other in range(robot):
                    if boxes[other, 0] <= i < boxes[other, 1] and boxes[other, 2] <= j < boxes[other, 3]:
                        bits = windows[other, i - corners[other, 0], j - corners[other, 1]]
                        by_two |= by_one & bits
                        by_one |= bits
                once += count_bits(seen & ~by_one)
                twice += count_bits(seen & by_one & ~by_two)
    for robot in range(robots):
        windows[robot, spans[robot, 0] : spans[robot, 1], spans[robot, 2] : spans[robot, 3]] = 0
    return once, twice


class Footprints:
    """What the robots of a team see from where they stand.

    Parameters
    ----------
    env : ExplorationEnv
        The environment.
    """

    def __init__(self, env: ExplorationEnv) -> None:
        reach = env.settings.lidar.range_max / env.settings.occupancy.resolution
        self._windows = np.zeros((env.settings.robots, window_rows(reach), window_words(reach)), np.uint64)

    def count(self, env: ExplorationEnv) -> tuple[int, int]:
        """Return how many cells of F a robot or more, and two or more, see now.

        (0, 0) where no two footprints can meet.
        """
        once, twice = _count_footprints(env.simulation.table, 0, self._windows)
        return int(once), int(twice)
