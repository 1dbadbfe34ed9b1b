"""Bytes that LZF packed, as in compressed PCD files.

A byte below 32 says how many bytes follow as they are; another one, how long a piece of what is unpacked
already comes again, and from how far back. Source: M. Lehmann, LibLZF.
"""

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel

MOST_RATIO = 88
"""Unpacked bytes of a packed one: three packed bytes give at most 264."""


def unpacked(packed: bytes, size: int) -> NDArray[np.uint8]:
    """Return the bytes that LZF packed.

    Parameters
    ----------
    packed : bytes
        What is packed.
    size : int
        How many bytes it has unpacked.

    Returns
    -------
    (size,) uint8
        The bytes.

    Raises
    ------
    ValueError
        Where it is damaged, or does not have so many bytes.
    """
    if size > MOST_RATIO * len(packed):
        raise ValueError(
            f"{len(packed):,} packed bytes claim to be {size:,} unpacked, more than LZF can pack"
        )
    room = np.empty(size, np.uint8)
    written = _unpack(np.frombuffer(packed, np.uint8), room)
    if written != size:
        raise ValueError(f"its packed bytes are damaged, or not {size:,} when unpacked")
    return room


@kernel
def _unpack(packed: Array, room: Array) -> int:
    """Unpack bytes and return how many there are; -1 where they are damaged."""
    place, written = 0, 0
    while place < len(packed):
        control = int(packed[place])
        place += 1
        if control < 32:
            length = control + 1
            if place + length > len(packed) or written + length > len(room):
                return -1
            for _ in range(length):
                room[written] = packed[place]
                place += 1
                written += 1
            continue
        length = control >> 5
        if length == 7:
            if place >= len(packed):
                return -1
            length += int(packed[place])
            place += 1
        if place >= len(packed):
            return -1
        back = ((control & 31) << 8) + int(packed[place]) + 1
        place += 1
        length += 2
        if back > written or written + length > len(room):
            return -1
        for _ in range(length):
            room[written] = room[written - back]
            written += 1
    return written
