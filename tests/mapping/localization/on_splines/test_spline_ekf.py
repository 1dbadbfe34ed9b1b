"""The extended Kalman filter on a map of curves."""

import math

import numpy as np
import pytest
from polygon_scans import biased_odometry
from tracked_world import POSES, SCANS, follow, gap

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.localization.on_splines.spline_ekf import BODY, SplineEkf, SplineEkfSettings, _condensed
from lidarium.mapping.localization.on_splines.spline_matches import Measured


@pytest.mark.parametrize("bias", [-0.06, 0.06])
def test_the_filter_learns_what_wheels_tell_too_much(bias):
    localizer = SplineEkf()
    track = follow(localizer, biased_odometry(POSES, bias))
    assert localizer.scales[0] == pytest.approx(1.0 / (1.0 + bias), abs=0.02)
    assert gap(track[-1], POSES[-1])[0] < 0.05


def test_the_state_holds_a_pose_scales_and_landmarks_that_lie_apart():
    localizer = SplineEkf()
    follow(localizer, biased_odometry(POSES, 0.02)[:50], scans=SCANS[:50])
    count = len(localizer.landmarks)
    assert count >= 3
    covariance = localizer.state_covariance
    assert covariance.shape == (BODY + 2 * count,) * 2
    np.testing.assert_allclose(covariance, covariance.T, atol=1e-12)
    assert np.linalg.eigvalsh(covariance).min() > -1e-12
    gaps = np.linalg.norm(localizer.landmarks[:, None] - localizer.landmarks, axis=2) + 9.0 * np.eye(count)
    assert gaps.min() >= localizer.tracking.splines.association.point_distance


def test_condensed_measurements_say_the_same_of_the_pose():
    generator = np.random.default_rng(8)
    many = Measured(generator.normal(size=40), generator.normal(size=(40, 3)), generator.uniform(0.1, 2.0, 40))
    few = _condensed(many)
    assert len(few.misses) == 3
    for one, other in zip(few.information(), many.information(), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-10)
    assert _condensed(few) is few


def test_motion_is_predicted_with_its_spread():
    localizer = SplineEkf(SplineEkfSettings(distance_bias=0.0, turn_bias=0.0))
    localizer.reset(np.zeros(3), 0)
    pose = localizer._predict(Transform(1.0, 0.0, 0.0))
    assert pose == pytest.approx((1.0, 0.0, 0.0))
    along, across, turn = np.sqrt(np.diag(localizer.local_covariance))
    tracking = localizer.tracking
    assert along == pytest.approx(tracking.slip_per_metre)
    assert across == pytest.approx(tracking.turn_per_metre)
    assert turn == pytest.approx(math.sqrt(2.0) * tracking.turn_per_metre)


@pytest.mark.parametrize("wrong", [{"gate_sigmas": math.nan}, {"turn_bias": -1.0}])
def test_settings_that_make_no_sense_are_refused(wrong):
    with pytest.raises(ValueError, match="want"):
        SplineEkfSettings(**wrong)
