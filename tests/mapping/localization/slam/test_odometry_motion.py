"""Motion between sensings by odometry, or by the last motion."""

import numpy as np
import pytest

from lidarium.mapping.geometry.rigid import composed
from lidarium.mapping.localization.dead_reckoning.localizer import Sensing
from lidarium.mapping.localization.matching.settings.slam import SlamSettings
from lidarium.mapping.localization.slam.odometry_motion import OdometryMotion

STEP = np.array([0.3, 0.0, 0.1])


def sensing(time_s, odometry):
    return Sensing(time_s, np.asarray(odometry, float), np.zeros(0, np.float32))


def test_a_motion_is_what_odometry_measured_in_the_robots_frame():
    motion = OdometryMotion(SlamSettings())
    start = np.array([5.0, -1.0, 2.0])
    first, period = motion.take(sensing(1.0, start))
    assert (first.tolist(), period) == ([0.0] * 3, 0.0)
    assert not motion.has_moved
    step, period = motion.take(sensing(1.25, composed(start, STEP)))
    np.testing.assert_allclose(step, STEP, atol=1e-12)
    assert period == 0.25
    assert motion.has_moved


def test_without_odometry_the_last_motion_goes_on():
    motion = OdometryMotion(SlamSettings(uses_odometry=False))
    motion.take(sensing(0.0, np.zeros(3)))
    motion.velocity = np.array([0.1, 0.0, 0.2])
    step, _ = motion.take(sensing(0.1, (9.0, 9.0, 9.0)))
    assert step is motion.velocity
    assert not motion.has_moved


@pytest.mark.parametrize("broken", [np.nan, np.inf])
def test_odometry_that_is_no_number_is_no_motion(broken):
    motion = OdometryMotion(SlamSettings())
    motion.take(sensing(0.0, np.zeros(3)))
    for time_s, odometry in ((0.1, np.full(3, broken)), (0.2, STEP)):
        step, _ = motion.take(sensing(time_s, odometry))
        assert step.tolist() == [0.0] * 3
    assert not motion.has_moved


def test_uncertainty_grows_since_the_last_match_and_begins_again():
    motion = OdometryMotion(SlamSettings())
    at_rest, pose = np.trace(motion.growth()), np.zeros(3)
    spreads = []
    for k in range(4):
        motion.take(sensing(0.1 * k, pose))
        spreads.append(np.trace(motion.growth()))
        pose = composed(pose, STEP)
    assert spreads[0] == at_rest
    assert (np.diff(spreads) > 0.0).all()
    motion.begin_interval()
    assert np.trace(motion.growth()) == at_rest
    assert not motion.has_moved


def test_wheels_that_tell_too_little_are_corrected_once_matches_show_it():
    motion, pose = OdometryMotion(SlamSettings()), np.zeros(3)
    motion.take(sensing(0.0, pose))
    for k in range(60):
        pose = composed(pose, np.array([0.3, 0.0, 0.0]))
        expected, _ = motion.take(sensing(0.1 * k, pose))
        error = np.array([0.3 * 1.05 - expected[0], 0.0, 0.0])
        motion.learn(error, 1e6 * np.eye(3), np.linalg.inv(motion.growth()))
        motion.begin_interval()
    step, _ = motion.take(sensing(9.0, composed(pose, np.array([0.3, 0.0, 0.0]))))
    assert step[0] == pytest.approx(0.3 * 1.05, rel=0.01)
