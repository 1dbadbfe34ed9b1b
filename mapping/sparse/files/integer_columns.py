"""Columns of whole numbers as few bytes.

Signs are in the lowest bit, then comes byte by byte of a column. Small numbers leave their upper bytes
zero; those stand together and cost nothing once deflated.
"""

import numpy as np
from numpy.typing import NDArray

BYTES = 4
"""Of a number."""

_MORTON_BITS = 21


def pack_columns(columns: NDArray[np.int64]) -> bytes:
    """Return columns (N, C) of numbers, of at most 30 bits each, as 4 N C bytes."""
    marked = ((columns << 1) ^ (columns >> 63)).astype("<u4")
    planes = np.ascontiguousarray(marked.T).view(np.uint8).reshape(columns.shape[1], -1, BYTES)
    return np.ascontiguousarray(planes.transpose(0, 2, 1)).tobytes()


def unpack_columns(content: bytes, count: int, width: int) -> NDArray[np.int64]:
    """Return the columns (count, width) that `pack_columns` made bytes of."""
    planes = np.frombuffer(content, np.uint8, count * width * BYTES).reshape(width, BYTES, count)
    marked = (
        np.ascontiguousarray(planes.transpose(0, 2, 1)).view("<u4").reshape(width, count).T.astype(np.int64)
    )
    return np.asarray((marked >> 1) ^ -(marked & 1))


def differences(columns: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return how each row (N, C) differs from the one before, the first one from zero."""
    return np.diff(columns, axis=0, prepend=0)


def morton_order(places: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the order of places (N, 3) along a curve that stays near, (N,)."""
    if len(places) == 0:
        return np.empty(0, np.int64)
    apart = places - places.min(axis=0)
    coarse = max(int(apart.max()).bit_length() - _MORTON_BITS, 0)
    keys = np.zeros(len(places), np.int64)
    for axis in range(3):
        spread = apart[:, axis] >> coarse
        for shift, mask in (
            (32, 0x1F00000000FFFF),
            (16, 0x1F0000FF0000FF),
            (8, 0x100F00F00F00F00F),
            (4, 0x10C30C30C30C30C3),
            (2, 0x1249249249249249),
        ):
            spread = (spread | (spread << shift)) & mask
        keys |= spread << axis
    return np.lexsort((places[:, 2], places[:, 1], places[:, 0], keys))
