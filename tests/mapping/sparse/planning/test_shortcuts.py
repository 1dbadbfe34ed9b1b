"""What can be driven straight is driven straight."""

import math
from itertools import pairwise

import numpy as np
import pytest

from lidarium.mapping.sparse.planning.shortcuts import path_length, shortened
from lidarium.mapping.sparse.swept_body import SweptBody, index_boxes, is_free

BODY = SweptBody(radius=0.2, height=1.0)
WALL = np.array([[[1.9, -5.0, 0.0], [2.1, 1.0, 2.0]]])
NOTHING = np.empty((0, 2, 3))


def path_of(*points):
    return np.array([(x, y, 0.0) for x, y in points])


def test_the_length_is_that_of_the_segments():
    assert path_length(path_of((0.0, 0.0), (3.0, 4.0), (3.0, 5.0))) == pytest.approx(6.0)
    assert path_length(path_of((1.0, 1.0))) == 0.0


def test_a_path_in_the_open_becomes_straight():
    steps = path_of(*((0.1 * k, math.sin(k)) for k in range(60)))
    found = shortened(index_boxes(NOTHING), steps, BODY.numbers)
    np.testing.assert_array_equal(found, steps[[0, -1]])


def test_a_detour_around_a_wall_becomes_tight_and_stays_free():
    index = index_boxes(WALL)
    detour = path_of((0.0, 0.0), (0.0, 2.0), (0.5, 3.5), (2.0, 4.0), (3.5, 3.5), (4.0, 2.0), (4.0, 0.0))
    found = shortened(index, detour, BODY.numbers)
    np.testing.assert_array_equal(found[[0, -1]], detour[[0, -1]])
    assert all(is_free(index, a, b, BODY.numbers) for a, b in pairwise(found))
    # The shortest goes round the two corners of the wall at the radius of the body.
    at_corner = math.hypot(1.9 - 0.0, 1.0)
    least = 2.0 * math.sqrt(at_corner**2 - 0.2**2) + 0.2
    assert least < path_length(found) < 0.65 * path_length(detour)


def test_a_path_of_one_or_two_points_stays():
    index = index_boxes(WALL)
    for path in (path_of((0.0, 0.0)), path_of((0.0, 0.0), (1.0, 0.0))):
        np.testing.assert_array_equal(shortened(index, path, BODY.numbers), path)
