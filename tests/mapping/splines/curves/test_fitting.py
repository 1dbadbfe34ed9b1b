import numpy as np
import pytest

from lidarium.mapping.splines.curves.fitting import fit_bspline
from lidarium.mapping.splines.curves.settings import FitSettings


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
    few, many = (
        fit_bspline(arc(points=count), sigmas=np.full(count, 0.01)).covariance for count in (50, 200)
    )
    assert (np.linalg.eigvalsh(few) > 0.0).all()
    np.testing.assert_allclose(np.diag(many), np.diag(few) / 4.0, rtol=0.15)


def test_finer_knots_follow_what_coarse_ones_do_not():
    x = np.linspace(0.0, 2.0, 400)
    wave = np.stack([x, 0.1 * np.sin(12.0 * x)], axis=1)
    coarse = fit_bspline(wave, FitSettings(is_sparse=False, finest_spacing=0.25))
    fine = fit_bspline(wave)
    assert fine.rms <= 0.02 < coarse.rms or fine.rms <= coarse.rms
    assert len(fine.spline.control_points) <= 2.0 / 0.08 + 3


@pytest.mark.parametrize(
    "points", [np.zeros((3, 2)), np.zeros((5, 2)), np.zeros((4, 3)), np.full((5, 2), np.nan)]
)
def test_points_that_make_no_curve_are_refused(points):
    with pytest.raises(ValueError, match="want"):
        fit_bspline(points)


def test_four_points_make_a_curve():
    fit = fit_bspline([(0, 0), (1, 0.5), (2, 0), (3, 1)])
    assert fit.rms < 0.2
