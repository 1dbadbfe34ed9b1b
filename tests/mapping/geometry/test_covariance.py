"""Covariances of poses, as seen from other frames."""

import math

import numpy as np

from lidarium.mapping.geometry.covariance import turned
from lidarium.mapping.geometry.rigid import Transform


def test_a_quarter_turn_exchanges_the_axes():
    found = turned(np.diag([1.0, 4.0, 9.0]), math.pi / 2.0)
    np.testing.assert_allclose(found, np.diag([4.0, 1.0, 9.0]), atol=1e-12)


def test_drawn_errors_have_the_turned_covariance():
    generator = np.random.default_rng(1)
    factor = generator.normal(size=(3, 3))
    errors = generator.normal(size=(100_000, 3)) @ factor.T
    elsewhere = np.column_stack([Transform(theta=0.7).apply(errors[:, :2]), errors[:, 2]])
    expected = np.cov(elsewhere.T)
    np.testing.assert_allclose(turned(factor @ factor.T, 0.7), expected, atol=0.03 * np.abs(expected).max())


def test_turning_back_undoes_a_turn():
    matrix = np.array([[2.0, 0.3, 0.1], [0.3, 1.0, -0.2], [0.1, -0.2, 0.5]])
    np.testing.assert_allclose(turned(turned(matrix, 1.1), -1.1), matrix)
