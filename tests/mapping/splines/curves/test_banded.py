"""Banded systems of equations."""

import numpy as np
import pytest

from lidarium.mapping.splines.curves.banded import factorize, solve


def banded(count, seed=0):
    """A positive definite matrix of three bands beside the diagonal, and its lower band."""
    generator = np.random.default_rng(seed)
    lower = np.tril(generator.normal(size=(count, count))) * (
        np.subtract.outer(range(count), range(count)) <= 3
    )
    matrix = lower @ lower.T + 0.1 * np.eye(count)
    band = np.zeros((count, 4))
    for i in range(count):
        for back in range(min(i, 3) + 1):
            band[i, back] = matrix[i, i - back]
    return matrix, band


@pytest.mark.parametrize("count", [1, 2, 4, 5, 40])
def test_solutions_are_those_of_the_dense_system(count):
    matrix, band = banded(count, count)
    right = np.random.default_rng(1).normal(size=(count, 2))
    expected = np.linalg.solve(matrix, right)
    assert factorize(band)
    solve(band, right)
    np.testing.assert_allclose(right, expected, rtol=1e-8, atol=1e-10)


def test_a_matrix_that_is_not_positive_definite_has_no_factor():
    _, band = banded(6)
    band[4, 0] = -1.0
    assert not factorize(band)
    singular = np.zeros((4, 4))
    singular[:, 0] = 1.0
    singular[1:, 1] = 1.0
    assert not factorize(singular)
