"""Basis functions of cubic B-splines."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from lidarium.mapping.splines.curves.basis import ORDER, basis_matrix
from lidarium.mapping.splines.curves.bspline import Spline


@st.composite
def splines(draw, least=4, most=12):
    count = draw(st.integers(least, most))
    gaps = draw(st.lists(st.floats(0.05, 2.0), min_size=count - 3, max_size=count - 3))
    ends = np.concatenate([[0.0], np.cumsum(gaps)])
    knots = np.concatenate([np.zeros(3), ends, np.full(3, ends[-1])])
    coordinates = st.floats(-5.0, 5.0)
    points = draw(st.lists(st.tuples(coordinates, coordinates), min_size=count, max_size=count))
    return Spline(knots, np.array(points))


def within(spline, shares):
    first, last = spline.domain
    return np.clip(first + np.asarray(shares) * (last - first), first, last)


SHARES = st.lists(st.floats(0.0, 1.0), min_size=1, max_size=20)


@given(splines(), SHARES)
def test_curve_and_derivatives_are_those_of_scipy(spline, shares):
    at = np.append(within(spline, shares), spline.knots[3:-3])
    reference = BSpline(spline.knots, spline.control_points, 3)
    # The second derivative jumps at knots where they are double; within the domain of these they are single.
    for order, mine in enumerate((spline.evaluate(at), spline.derivative(at), spline.derivative(at, 2))):
        expected = reference(at, nu=order)
        np.testing.assert_allclose(mine, expected, rtol=1e-11, atol=1e-12 * max(1.0, np.abs(expected).max()))


@given(splines(), SHARES)
def test_basis_sums_to_one_and_is_local(spline, shares):
    at = np.append(within(spline, shares), spline.knots[3:-3])
    matrix = basis_matrix(spline.knots, at)
    np.testing.assert_allclose(matrix.sum(axis=1), 1.0, atol=1e-13)
    assert (matrix >= -1e-15).all()
    assert (np.count_nonzero(matrix, axis=1) <= ORDER).all()
    np.testing.assert_allclose(matrix, BSpline.design_matrix(at, spline.knots, 3).toarray(), atol=1e-12)
