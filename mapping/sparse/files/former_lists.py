"""Lists of files of version 1: differences in Morton order, byte by byte of each column."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.sparse.files.integer_columns import BYTES
from lidarium.mapping.sparse.files.integer_lists import IntegerLists, decoded_edges

WIDTHS = (6, 3, 3, 2)
"""Columns of boxes, free codes, nodes and edges."""


def former_lists(content: bytes, counts: Sequence[int]) -> IntegerLists:
    """Return the lists of a file of version 1, of so many boxes, free codes, nodes and edges."""
    lists, start = [], 0
    for count, width in zip(counts, WIDTHS, strict=True):
        planes = np.frombuffer(content, np.uint8, BYTES * count * width, start).reshape(width, BYTES, count)
        coded = np.ascontiguousarray(planes.transpose(0, 2, 1)).view("<u4").reshape(width, count)
        lists.append(_signed(coded.T.astype(np.int64)))
        start += BYTES * count * width
    boxes, free, nodes, edges = lists
    boxes[:, :3] = np.cumsum(boxes[:, :3], axis=0)
    return IntegerLists(boxes, np.cumsum(free, axis=0), np.cumsum(nodes, axis=0), decoded_edges(edges))


def _signed(coded: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return numbers whose lowest bit is their sign."""
    return np.asarray((coded >> 1) ^ -(coded & 1))
