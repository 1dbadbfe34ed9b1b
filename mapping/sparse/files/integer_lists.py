"""A map in whole steps: the lists of integers that its file keeps."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class IntegerLists(NamedTuple):
    """Boxes, free codes and graph of a map, in whole steps.

    Attributes
    ----------
    boxes : (M, 6) int64
        Low corners, then sizes.
    free : (N, 3) int64
        Free codes.
    nodes : (P, 3) int64
        Nodes of the graph.
    edges : (E, 2) int64
        Numbers of the nodes at both ends, the lower one first, in order.
    """

    boxes: NDArray[np.int64]
    free: NDArray[np.int64]
    nodes: NDArray[np.int64]
    edges: NDArray[np.int64]


def coded_edges(edges: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return edges as differences of first nodes and distances to second ones."""
    return np.stack([np.diff(edges[:, 0], prepend=0), edges[:, 1] - edges[:, 0]], axis=1)


def decoded_edges(coded: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the edges that `coded_edges` was given."""
    first = np.cumsum(coded[:, 0])
    return np.stack([first, first + coded[:, 1]], axis=1)
