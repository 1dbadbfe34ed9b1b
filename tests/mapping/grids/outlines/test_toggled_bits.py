"""Bits that a straight edge toggles."""

import numpy as np
import pytest

from lidarium.mapping.grids.outlines.toggled_bits import row_of, toggle_bit, toggle_edge

ROWS, WIDTH = 24, 128


def bits_of(words):
    return np.unpackbits(words.view(np.uint8), bitorder="little").reshape(ROWS, WIDTH).astype(bool)


def toggled(*edges):
    words = np.zeros((ROWS, WIDTH // 64), np.uint64)
    for from_x, from_y, to_x, to_y in edges:
        toggle_edge(words.ctypes.data, WIDTH, from_x, from_y, to_x, to_y, row_of(from_y), row_of(to_y))
    return bits_of(words)


def test_a_bit_is_toggled_back_and_forth():
    words = np.zeros((ROWS, WIDTH // 64), np.uint64)
    for expected in (True, False):
        toggle_bit(words.ctypes.data, 3 * WIDTH + 70)
        assert bits_of(words)[3, 70] == expected
        assert bits_of(words).sum() == expected


def test_an_edge_toggles_the_first_cell_centre_to_its_right_in_each_row_that_it_crosses():
    generator = np.random.default_rng(2)
    for from_x, from_y, to_x, to_y in generator.uniform((1, 0, 1, 0), (120, 23, 120, 23), (80, 4)).tolist():
        found = toggled((from_x, from_y, to_x, to_y))
        expected = np.zeros_like(found)
        for row in range(ROWS):
            middle = row + 0.5
            if min(from_y, to_y) < middle <= max(from_y, to_y):
                x = from_x + (middle - from_y) * (to_x - from_x) / (to_y - from_y)
                expected[row, int(np.ceil(x - 0.5))] = True
        np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize(
    "corners", [[(10, 3), (90, 5), (40, 20)], [(5.5, 2.5), (60.5, 2.5), (60.5, 15), (5.5, 15)]]
)
def test_edges_of_a_polygon_toggle_its_inside_row_by_row(corners):
    # A cell whose centre lies on an edge is not right of it.
    edges = [(*a, *b) for a, b in zip(corners, [*corners[1:], corners[0]], strict=True) if a[1] != b[1]]
    inside = np.logical_xor.accumulate(toggled(*edges), axis=1)
    for row in range(ROWS):
        for column in range(WIDTH):
            x, y = column + 0.5, row + 0.5
            met = [edge for edge in edges if min(edge[1], edge[3]) < y <= max(edge[1], edge[3])]
            crossed = [ax + (y - ay) * (bx - ax) / (by - ay) < x for ax, ay, bx, by in met]
            assert inside[row, column] == (sum(crossed) % 2 == 1)


def test_corners_count_once_and_flat_edges_toggle_nothing():
    assert row_of(3.49) == 3
    assert row_of(3.5) == 4
    assert not toggled((3.0, 4.6, 90.0, 5.4)).any()
