"""Least-squares fits with as many control points as they need."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import make_lsq_spline

from lidarium.mapping.splines.curves.basis import basis_matrix
from lidarium.mapping.splines.curves.fitting import averaged_knots, fit_bspline
from lidarium.mapping.splines.curves.settings import FitSettings


def test_a_straight_wall_has_four_control_points_on_a_line():
    points = np.stack(
        [np.linspace(0.0, 5.0, 300), 0.01 * np.random.default_rng(1).standard_normal(300)], axis=1
    )
    spline = fit_bspline(points, sigmas=np.full(300, 0.01)).spline
    assert len(spline.control_points) == 4
    np.testing.assert_allclose(spline.curvature([0.5, 2.0, 4.5]), 0.0, atol=1e-9)
    assert np.abs(spline.sample(0.1)[:, 1]).max() < 0.005


def test_a_bend_at_the_end_of_a_long_wall_is_not_cut_short():
    straight = np.stack([np.linspace(0.0, 4.0, 400), np.zeros(400)], axis=1)
    angles = np.linspace(0.0, math.pi / 2.0, 50)
    bend = np.stack([4.0 + 0.3 * np.sin(angles), 0.3 - 0.3 * np.cos(angles)], axis=1)
    points = np.concatenate([straight, bend]) + 0.01 * np.random.default_rng(2).standard_normal((450, 2))
    spline = fit_bspline(points, sigmas=np.full(450, 0.01)).spline
    assert spline.closest(bend)[1].max() < 0.025


@given(st.integers(8, 40), st.integers(0, 1000))
def test_the_fit_is_that_of_scipy_where_nothing_stiffens_it(points, seed):
    generator = np.random.default_rng(seed)
    way = np.cumsum(
        np.stack([generator.uniform(0.1, 0.3, points), generator.uniform(-0.1, 0.1, points)], axis=1), axis=0
    )
    rough = FitSettings(is_sparse=False, spacing=1.0, finest_spacing=1.0, rms=100.0, stiffness=0.0)
    spline = fit_bspline(way, rough).spline
    parameters = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))])
    scale = spline.domain[1] / parameters[-1]
    expected = make_lsq_spline(parameters * scale, way, spline.knots, 3)
    np.testing.assert_allclose(spline.control_points, expected.c, atol=1e-7)


def test_every_span_has_points():
    parameters = np.sort(np.random.default_rng(3).uniform(0.0, 3.0, 30))
    knots = averaged_knots(parameters, 12)
    matrix = basis_matrix(knots, parameters)
    assert np.linalg.matrix_rank(matrix) == 12
