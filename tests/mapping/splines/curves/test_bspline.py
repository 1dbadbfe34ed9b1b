import math

import numpy as np
import pytest

from lidarium.mapping.splines.curves.bspline import Spline


def straight(length=2.0, count=5):
    inner = np.linspace(0.0, length, count - 2)
    knots = np.concatenate([np.zeros(3), inner, np.full(3, length)])
    points = (knots[1 : count + 1] + knots[2 : count + 2] + knots[3 : count + 3]) / 3.0
    return Spline(knots, np.stack([points, np.zeros(count)], axis=1))


def test_derivatives_are_limits_of_differences():
    spline = Spline(
        np.array([0, 0, 0, 0, 0.7, 1.5, 2, 2, 2, 2.0]),
        np.array([(0, 0), (1, 2), (2, -1), (3, 1), (4, 0), (5, 2.0)]),
    )
    at, step = np.linspace(0.1, 1.9, 37), 1e-6
    differences = (spline.evaluate(at + step) - spline.evaluate(at - step)) / (2.0 * step)
    np.testing.assert_allclose(spline.derivative(at), differences, atol=1e-7)


def test_parameters_beyond_the_ends_give_the_ends():
    spline = straight()
    np.testing.assert_allclose(spline.evaluate([-1.0, 3.0]), [(0.0, 0.0), (2.0, 0.0)])


@pytest.mark.parametrize(
    ("knots", "points"),
    [
        ([0, 0, 0, 0, 1, 1, 1, 1], [(0, 0)] * 3),
        ([0, 0, 0, 0, 1, 1, 1], [(0, 0)] * 4),
        ([0, 0, 0, 0, 1, 1, 1, 0.5], [(0, 0)] * 4),
        ([0, 0, 0, 0, 0, 0, 0, 0], [(0, 0)] * 4),
        ([0, 0, 0, 0, 1, 1, 1, 1], [(0, math.nan)] * 4),
    ],
)
def test_what_is_no_curve_is_refused(knots, points):
    with pytest.raises(ValueError, match=r"want|finite"):
        Spline(np.array(knots, np.float64), np.array(points, np.float64))
