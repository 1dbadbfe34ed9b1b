"""Lists of files of version 1."""

import numpy as np

from lidarium.mapping.sparse.files.former_lists import former_lists


def planes(numbers):
    """The bytes of a list of version 1: signed numbers (count, width), byte by byte of each column."""
    numbers = np.asarray(numbers, np.int64)
    coded = np.where(numbers < 0, -2 * numbers - 1, 2 * numbers).astype("<u4")
    return (
        np.ascontiguousarray(coded.T).view(np.uint8).reshape(*coded.T.shape, 4).transpose(0, 2, 1).tobytes()
    )


def test_differences_become_boxes_codes_nodes_and_edges():
    content = (
        planes([[5, -3, 0, 2, 2, 9], [-7, 4, 1, 0, 300, 1]])
        + planes([[1, 2, 3], [-1, -1, -1], [0, 0, 70_000]])
        + planes([[4, 4, 4]])
        + planes([[0, 1], [0, 2], [3, 1]])
    )
    found = former_lists(content, (2, 3, 1, 3))
    # Low corners are sums of differences, sizes are as they are.
    assert found.boxes.tolist() == [[5, -3, 0, 2, 2, 9], [-2, 1, 1, 0, 300, 1]]
    assert found.free.tolist() == [[1, 2, 3], [0, 1, 2], [0, 1, 70_002]]
    assert found.nodes.tolist() == [[4, 4, 4]]
    assert found.edges.tolist() == [[0, 1], [0, 2], [3, 4]]


def test_lists_may_be_empty():
    found = former_lists(b"", (0, 0, 0, 0))
    assert [part.shape for part in found] == [(0, 6), (0, 3), (0, 3), (0, 2)]
