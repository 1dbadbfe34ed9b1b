"""Small matrices against numpy's linear algebra."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lidarium.mapping.geometry.small_matrices import eigenvalues, inverse, product, pseudo_inverse, solved, squared


def drawn(seed, count):
    """Return a general and a symmetric positive matrix, and a vector."""
    generator = np.random.default_rng(seed)
    scales = 10.0 ** generator.uniform(-3.0, 3.0, count)
    general = generator.standard_normal((count, count)) * scales
    return general, general @ general.T + np.diag(scales**2), generator.standard_normal(count)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(1, 4))
def test_they_are_what_numpy_finds(seed, count):
    general, symmetric, vector = drawn(seed, count)
    condition = np.linalg.cond(symmetric)
    assert product(symmetric, inverse(symmetric)) == pytest.approx(np.eye(count), abs=1e-13 * condition)
    assert symmetric @ solved(symmetric, vector[:, None])[:, 0] == pytest.approx(vector, abs=1e-13 * condition)
    assert product(general, symmetric, general.T) == pytest.approx(
        general @ symmetric @ general.T, rel=1e-9, abs=1e-12 * np.abs(general).max() ** 2 * np.abs(symmetric).max()
    )
    assert product(general, vector) == pytest.approx(general @ vector, rel=1e-9, abs=1e-12 * np.abs(general).max())
    assert squared(symmetric, vector) == pytest.approx(vector @ symmetric @ vector, rel=1e-9)
    values = np.linalg.eigvalsh(symmetric)
    assert eigenvalues(symmetric) == pytest.approx(values, rel=1e-9, abs=1e-13 * values[-1])


def test_a_singular_matrix_has_a_pseudo_inverse():
    along = np.array([[3.0], [4.0], [0.0]])
    assert pseudo_inverse(along @ along.T) == pytest.approx(np.linalg.pinv(along @ along.T), abs=1e-15)
    assert pseudo_inverse(np.zeros((3, 3))) == pytest.approx(np.zeros((3, 3)))
    assert pseudo_inverse(np.diag([2.0, 0.0, 4.0])) == pytest.approx(np.diag([0.5, 0.0, 0.25]))


def test_rows_are_exchanged_where_the_diagonal_is_zero():
    assert inverse([[0.0, 2.0], [4.0, 0.0]]) == pytest.approx(np.array([[0.0, 0.25], [0.5, 0.0]]))
