"""Dead reckoning moves the start as the wheels measure."""

import math

import numpy as np
import pytest

from lidarium.mapping.geometry.rigid import composed
from lidarium.mapping.localization.localizer import Sensing
from lidarium.mapping.localization.odometry import Odometry, compounded
from lidarium.mapping.localization.settings import OdometryUncertainty


def test_dead_reckoning_adds_motions_to_the_start():
    odometry = Odometry(OdometryUncertainty())
    odometry.reset(np.array([1.0, 2.0, math.pi / 2]), 0)
    ranges = np.zeros(0, np.float32)
    assert odometry.localize(Sensing(0.0, np.array([5.0, 5.0, 0.0]), ranges)).tolist() == [
        1.0,
        2.0,
        math.pi / 2,
    ]
    assert not odometry.covariance.any()
    assert odometry.localize(Sensing(1.0, np.array([6.0, 5.0, 0.0]), ranges)) == pytest.approx([1.0, 3.0, math.pi / 2])
    small = odometry.covariance
    assert odometry.localize(Sensing(2.0, np.full(3, np.nan), ranges)) == pytest.approx([1.0, 3.0, math.pi / 2])
    odometry.localize(Sensing(3.0, np.array([7.0, 5.0, 0.0]), ranges))
    assert np.trace(odometry.covariance) > np.trace(small) > 0.0
    assert odometry.take_correction() is None


def test_covariances_compound_as_errors_of_drawn_poses_do():
    generator = np.random.default_rng(4)
    pose, motion = np.array([1.0, -2.0, 0.8]), np.array([0.7, 0.3, -0.4])
    first, second = np.array([0.02, 0.01, 0.03]), np.array([0.01, 0.03, 0.02])
    starts = pose + generator.normal(size=(40_000, 3)) * first
    ends = composed(starts, motion + generator.normal(size=(40_000, 3)) * second)
    expected = np.cov(ends.T)
    found = compounded(pose, np.diag(first**2), motion, np.diag(second**2))
    np.testing.assert_allclose(found, expected, atol=0.03 * expected.max())


def test_a_robot_that_stands_still_is_known_as_before():
    odometry = Odometry()
    for k in range(5):
        odometry.localize(Sensing(float(k), np.array([3.0, 1.0, 2.0]), np.zeros(0, np.float32)))
    assert not odometry.covariance.any()
