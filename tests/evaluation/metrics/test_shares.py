"""Shares of cells."""

import numpy as np

from lidarium.evaluation.metrics.shares import share


def test_cells_that_are_not_0_count():
    assert share(np.array([[0, 2], [-1, 0]]), np.array([[1, 1], [1, 1]])) == 0.5
    assert share(np.zeros((2, 2), bool), np.ones((2, 2), bool)) == 0.0


def test_of_nothing_all_is_there_unless_something_else_is_asked_for():
    nothing = np.zeros((2, 2), bool)
    assert share(nothing, nothing) == 1.0
    assert share(nothing, nothing, empty=0.0) == 0.0
