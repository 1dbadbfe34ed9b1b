"""Motion between sensings by odometry, or by the last motion."""

import math

import numpy as np
import pytest
from driven_rooms import GEOMETRY, cast
from hypothesis import given, settings
from hypothesis import strategies as st

from lidarium.mapping.geometry.rigid import composed, relative
from lidarium.mapping.localization.localizer import Sensing
from lidarium.mapping.localization.settings import OdometryUncertainty, SlamSettings
from lidarium.mapping.localization.slam.localizer import Slam
from lidarium.mapping.localization.slam.odometry_motion import OdometryCalibration, OdometryMotion

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


def test_where_odometry_is_unknown_the_last_motion_goes_on():
    motion, pose = OdometryMotion(SlamSettings()), np.zeros(3)
    motion.take(sensing(0.0, pose))
    known, _ = motion.take(sensing(0.1, STEP))
    assert motion.is_measured
    for time_s, odometry in ((0.2, np.full(3, np.nan)), (0.3, composed(STEP, STEP))):
        step, _ = motion.take(sensing(time_s, odometry))
        np.testing.assert_array_equal(step, known)
        assert not motion.is_measured
    motion.begin_interval()
    motion.take(sensing(0.4, composed(STEP, STEP)))
    assert motion.is_measured


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


SURE = np.diag([1e5, 1e5, 1e6])
NOTHING_KNOWN = np.zeros((3, 3))


def drive(calibration, errors, steps=400, seed=0, told=SURE):
    """Let a robot whose wheels err drive about, with matches that tell the truth as far as ``told`` says."""
    generator = np.random.default_rng(seed)
    for _ in range(steps):
        motion = np.array([generator.uniform(-0.05, 0.2), 0.0, generator.normal(0.0, 0.1)])
        truth = OdometryCalibration(OdometryUncertainty())
        truth.errors = np.asarray(errors)
        went = truth.corrected(motion)
        expected = calibration.corrected(motion)
        prior = np.linalg.inv(calibration.uncertainty(motion[0], motion[2]))
        # A match lies between what points say and what was expected.
        share = np.linalg.inv(told + prior) @ told
        calibration.learn(motion[0], motion[2], share @ relative(expected, went), told, prior)
    return calibration


shares = st.floats(-0.12, 0.12)


@settings(max_examples=15)
@given(along=shares, turn=shares, drift=st.floats(-0.06, 0.06))
def test_errors_of_wheels_are_learned_from_matches(along, turn, drift):
    errors = np.array([along, turn, drift])
    learned = drive(OdometryCalibration(OdometryUncertainty()), errors)
    assert learned.errors == pytest.approx(errors, abs=0.01)


def test_what_matches_do_not_tell_is_not_learned():
    along_nothing = np.diag([0.0, 1e5, 1e6])
    learned = drive(OdometryCalibration(OdometryUncertainty()), [0.08, 0.0, 0.0], told=along_nothing)
    assert learned.errors[0] == 0.0
    assert learned.covariance[0, 0] == pytest.approx(0.01, rel=1e-6)


def test_what_was_learned_makes_motion_surer_and_fades_again():
    calibration = OdometryCalibration(OdometryUncertainty(fading=0.01))
    before = calibration.uncertainty(1.0, 0.0)
    drive(calibration, [0.05, 0.0, 0.0])
    learned = calibration.uncertainty(1.0, 0.0)
    for _ in range(300):
        calibration.learn(1.0, 0.0, np.zeros(3), NOTHING_KNOWN, np.eye(3))
    forgotten = calibration.uncertainty(1.0, 0.0)
    assert learned[0, 0] < 0.3 * before[0, 0]
    assert learned[0, 0] < forgotten[0, 0] < 1.5 * before[0, 0]


def test_corrections_stay_within_their_bounds():
    learned = drive(OdometryCalibration(OdometryUncertainty(most_deviations=0.5)), [0.2, -0.2, 0.2])
    assert learned.errors == pytest.approx([0.05, -0.05, 0.025])
    untaught = drive(OdometryCalibration(OdometryUncertainty(most_deviations=0.0)), [0.2, -0.2, 0.2])
    assert untaught.errors.tolist() == [0.0, 0.0, 0.0]


@given(distance=st.floats(-0.3, 0.3), turn=st.floats(-0.5, 0.5))
def test_wheels_that_do_not_err_are_not_corrected(distance, turn):
    motion = np.array([distance, 0.0, turn])
    assert OdometryCalibration(OdometryUncertainty()).corrected(motion).tolist() == motion.tolist()


def test_a_robot_that_knows_its_wheels_keeps_its_way_along_a_bare_corridor():
    """Doors show the way at first; then 12 m of two bare walls follow, and wheels tell 6 % too little all
    the time."""
    door = [(x, 1.0, x, 1.6) for x in (1.0, 1.9, 4.0, 4.9, 6.5, 7.4)] + [
        (1.0, 1.6, 1.9, 1.6),
        (4.0, 1.6, 4.9, 1.6),
        (6.5, 1.6, 7.4, 1.6),
    ]
    wall = [(-3.0, -1.0, 40.0, -1.0), (-3.0, -1.0, -3.0, 1.0)]
    ends = (-3.0, 1.0, 1.9, 4.0, 4.9, 6.5, 7.4, 40.0)
    sides = [(ends[k], 1.0, ends[k + 1], 1.0) for k in (0, 2, 4, 6)]
    segments = np.array([*door, *wall, *sides])
    slam = Slam(SlamSettings(), GEOMETRY)
    slam.reset(np.zeros(3), 0)
    pose, odometry = np.zeros(3), np.zeros(3)
    before = 0.0
    for step in range(int(21.0 / 0.05)):
        told = slam.localize(Sensing(0.1 * step, odometry, cast(segments, pose)))
        if pose[0] < 9.0:
            before = abs(told[0] - pose[0])
        motion = np.array([0.05, 0.0, 0.0])
        pose, odometry = composed(pose, motion), composed(odometry, motion * [0.94, 1.0, 1.0])
    assert pose[0] - odometry[0] > 1.2
    assert before < 0.05
    assert abs(told[0] - pose[0]) < 0.3
    assert math.isfinite(told[2])
