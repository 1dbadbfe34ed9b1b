"""Messages between robots: poses, and blocks of maps that differ."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.onboard.radio.messages import Status
from lidarium.mapping.kernels.compilation import Array, kernel

BLOCK = 64
"""Cells of a block of a map."""

POSE_BYTES = 32
"""A message with a pose: x, y, theta and the time, 8 bytes each."""

HEADER_BYTES, BLOCK_BYTES = 32, 4 + BLOCK
"""A message with a part of a map: sender, whose map, when, and how many blocks.

Each block is its number and a byte for each cell.
"""

STATUS_BYTES = 80
"""Bytes of the status that a robot sends with its map.

The status is pose, target and three figures, 8 bytes each, and the robot's states.
"""


@kernel
def _differing_blocks(source: Array, target: Array, low: int, high: int, found: Array) -> int:
    """Fill ``found`` with the differing blocks of two maps; return their count.

    Blocks are numbered, over rows ``low`` to ``high``.
    """
    columns, count = source.shape[1], 0
    words = columns // 64
    for row in range(low, high):
        for word in range(words):
            for column in range(64 * word, 64 * word + 64):
                if source[row, column] != target[row, column]:
                    found[count] = row * words + word
                    count += 1
                    break
    return count


@dataclass(frozen=True, slots=True)
class Message:
    """Something that is being sent: a pose, or blocks of a map where there are any.

    Attributes
    ----------
    arrives : int
        The step at which it is there.
    receiver, source : int
        Who gets it, and whom it is about.
    step : int
        The step at which it was true.
    pose : (3,) float64 or None
        x, y, theta as the source believed [m, rad].
    has_ended : bool
        Whether the source had ended.
    blocks, cells : (blocks,) int64, (blocks, 64) int8
        Blocks of the source's map.
    status : Status or None
        What the source reported of itself with its map.
    """

    arrives: int
    receiver: int
    source: int
    step: int
    pose: NDArray[np.float64] | None
    has_ended: bool
    blocks: NDArray[np.int64]
    cells: NDArray[np.int8]
    status: Status | None = None


NO_BLOCKS, NO_CELLS = np.zeros(0, np.int64), np.zeros((0, BLOCK), np.int8)


def differing_blocks(
    held: NDArray[np.int8], copy: NDArray[np.int8]
) -> tuple[NDArray[np.int64], NDArray[np.int8]]:
    """Return the blocks in which a map differs from an older copy.

    Their numbers (blocks,) and their cells (blocks, 64).
    """
    # A correction of the past may have emptied rows that the receiver still holds.
    used = np.flatnonzero(held.view(np.uint64).any(axis=1) | copy.view(np.uint64).any(axis=1))
    low, high = (int(used[0]), int(used[-1]) + 1) if len(used) else (0, 0)
    found = np.empty((high - low) * (held.shape[1] // BLOCK), np.int64)
    blocks = found[: _differing_blocks(held, copy, low, high, found)].copy()
    return blocks, held.reshape(-1, BLOCK)[blocks]
