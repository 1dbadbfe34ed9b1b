"""Points that a map has already."""

import numpy as np

from lidarium.mapping.sparse.mapper.explained_points import are_covered


def test_points_on_the_border_of_a_box_are_covered():
    boxes = np.array([[[0.0, 0, 0], [1, 1, 1]], [[3.0, 3, 0], [3, 3, 0]]])
    points = np.array([[0.0, 0, 0], [1, 1, 1], [3, 3, 0], [1.0001, 1, 1], [3, 3, 0.1], [-5, 0, 0], [0, 9, 0]])
    assert are_covered(points, boxes).tolist() == [True, True, True, False, False, False, False]
    assert not are_covered(points, np.empty((0, 2, 3))).any()
