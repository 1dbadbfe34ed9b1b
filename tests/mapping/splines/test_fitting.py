import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import make_lsq_spline

from lidarium.mapping.splines.bspline import _basis_matrix
from lidarium.mapping.splines.fitting import _averaged_knots, _factorize, _solve, fit_bspline
from lidarium.mapping.splines.settings import FitSettings


def arc(radius=1.0, angle=2.0, points=200, noise=0.0, seed=0):
    angles = np.linspace(0.0, angle, points)
    return radius * np.stack([np.cos(angles), np.sin(angles)], axis=1) + noise * np.random.default_rng(
        seed
    ).standard_normal((points, 2))


def test_a_noisy_arc_is_met_to_better_than_its_noise():
    fit = fit_bspline(arc(noise=0.01), sigmas=np.full(200, 0.01))
    assert np.sqrt(np.mean((np.linalg.norm(fit.spline.sample(0.01), axis=1) - 1.0) ** 2)) < 0.01
    assert fit.spline.length() == pytest.approx(2.0, abs=0.05)


def test_knots_run_along_the_curve_in_metres():
    fit = fit_bspline(arc(radius=2.0, noise=0.005), sigmas=np.full(200, 0.005))
    assert fit.spline.domain[1] - fit.spline.domain[0] == pytest.approx(fit.spline.length(), rel=1e-9)


def test_covariance_is_the_inverse_of_the_normal_matrix_and_shrinks_with_more_points():
    few, many = (fit_bspline(arc(points=count), sigmas=np.full(count, 0.01)).covariance for count in (50, 200))
    assert (np.linalg.eigvalsh(few) > 0.0).all()
    np.testing.assert_allclose(np.diag(many), np.diag(few) / 4.0, rtol=0.15)


def test_finer_knots_follow_what_coarse_ones_do_not():
    x = np.linspace(0.0, 2.0, 400)
    wave = np.stack([x, 0.1 * np.sin(12.0 * x)], axis=1)
    coarse = fit_bspline(wave, FitSettings(is_sparse=False, finest_spacing=0.25))
    fine = fit_bspline(wave)
    assert fine.rms <= 0.02 < coarse.rms or fine.rms <= coarse.rms
    assert len(fine.spline.control_points) <= 2.0 / 0.08 + 3


@pytest.mark.parametrize("points", [np.zeros((3, 2)), np.zeros((5, 2)), np.zeros((4, 3)), np.full((5, 2), np.nan)])
def test_points_that_make_no_curve_are_refused(points):
    with pytest.raises(ValueError, match="want"):
        fit_bspline(points)


def test_four_points_make_a_curve():
    fit = fit_bspline([(0, 0), (1, 0.5), (2, 0), (3, 1)])
    assert fit.rms < 0.2


def banded(count, seed=0):
    """A positive definite matrix of three bands beside the diagonal, and its lower band."""
    generator = np.random.default_rng(seed)
    lower = np.tril(generator.normal(size=(count, count))) * (np.subtract.outer(range(count), range(count)) <= 3)
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
    assert _factorize(band)
    _solve(band, right)
    np.testing.assert_allclose(right, expected, rtol=1e-8, atol=1e-10)


def test_a_matrix_that_is_not_positive_definite_has_no_factor():
    _, band = banded(6)
    band[4, 0] = -1.0
    assert not _factorize(band)
    singular = np.zeros((4, 4))
    singular[:, 0] = 1.0
    singular[1:, 1] = 1.0
    assert not _factorize(singular)


def test_a_straight_wall_has_four_control_points_on_a_line():
    points = np.stack([np.linspace(0.0, 5.0, 300), 0.01 * np.random.default_rng(1).standard_normal(300)], axis=1)
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
    knots = _averaged_knots(parameters, 12)
    matrix = _basis_matrix(knots, parameters)
    assert np.linalg.matrix_rank(matrix) == 12
