"""Columns of whole numbers as few bytes, deflated.

Numbers are mostly below 256. The lowest bytes of each column make a block of their own, so that each has
codes for its own numbers; the upper bytes of all columns, mostly zero, follow in one block.
"""

import zlib
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

BYTES = 4
"""Of a number."""


def column_blocks(lists: Sequence[NDArray[np.int64]]) -> list[bytes]:
    """Return the columns of lists (N, C) of numbers from 0 to below 2^32, as blocks of bytes."""
    lowest, upper = [], []
    for numbers in lists:
        for column in numbers.T:
            planes = column.astype("<u4").view(np.uint8).reshape(-1, BYTES).T
            lowest.append(planes[0].tobytes())
            upper.append(planes[1:].tobytes())
    return [*lowest, b"".join(upper)]


def lists_of_columns(content: bytes, counts: Sequence[int], widths: Sequence[int]) -> list[NDArray[np.int64]]:
    """Return the lists (count, width) whose blocks, joined, are the content.

    Raises
    ------
    ValueError
        Where the content is longer or shorter than these.
    """
    sizes = [count * width for count, width in zip(counts, widths, strict=True)]
    whole = np.frombuffer(content, np.uint8)
    lowest, upper = np.split(whole, [sum(sizes)])
    ends = np.cumsum(sizes)[:-1]
    lists = []
    for low, high, count, width in zip(
        np.split(lowest, ends), np.split(upper, (BYTES - 1) * ends), counts, widths, strict=True
    ):
        planes = np.concatenate([low.reshape(width, 1, count), high.reshape(width, BYTES - 1, count)], axis=1)
        numbers = np.ascontiguousarray(planes.transpose(0, 2, 1)).view("<u4").reshape(width, count)
        lists.append(numbers.T.astype(np.int64))
    return lists


def deflated(blocks: Sequence[bytes]) -> bytes:
    """Return blocks as one stream of zlib, in which each has codes of its own."""
    packing = zlib.compressobj(9, strategy=zlib.Z_FILTERED)
    parts = [packing.compress(block) + packing.flush(zlib.Z_BLOCK) for block in blocks]
    return b"".join(parts) + packing.flush()
