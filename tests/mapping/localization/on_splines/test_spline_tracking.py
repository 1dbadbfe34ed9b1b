import copy
import math
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from polygon_scans import biased_odometry
from tracked_world import LASER, POSES, SCANS, follow, gap

from lidarium.mapping.files.spline_files import write_spline_map
from lidarium.mapping.geometry.rigid import Transform, composed
from lidarium.mapping.localization.localizer import Localizer, Sensing
from lidarium.mapping.localization.on_splines.spline_ekf import SplineEkf
from lidarium.mapping.localization.on_splines.spline_filter import SplineFilter, SplineFilterSettings
from lidarium.mapping.localization.on_splines.spline_matches import TrackingSettings
from lidarium.mapping.localization.on_splines.spline_tracking import driven, steps_of

KINDS = (SplineFilter, SplineEkf)


@pytest.mark.parametrize("kind", KINDS)
def test_a_bias_of_five_percent_is_corrected_to_less_than_five_centimetres(kind):
    odometry = biased_odometry(POSES, 0.05, seed=1, slip=0.02)
    track = follow(kind(), odometry)
    alone = Transform(*POSES[0]).apply(odometry[:, :2])
    error = np.sqrt(((track - POSES)[:, :2] ** 2).sum(axis=1).mean())
    assert error < 0.03
    assert gap(track[-1], POSES[-1]) < (0.05, math.radians(1.0))
    assert np.sqrt(((alone - POSES[:, :2]) ** 2).sum(axis=1).mean()) > 3.0 * error


@pytest.mark.parametrize("kind", KINDS)
def test_the_same_seed_gives_the_same_poses_to_the_bit(kind):
    odometry = biased_odometry(POSES, 0.05)[:30]
    first, second = (follow(kind(), odometry, seed=3, scans=SCANS[:30]) for _ in range(2))
    np.testing.assert_array_equal(first, second)


@pytest.mark.parametrize("kind", KINDS)
def test_copies_go_on_alike(kind):
    odometry = biased_odometry(POSES, 0.05)
    localizer = kind()
    follow(localizer, odometry[:20], scans=SCANS[:20])
    copies = [copy.deepcopy(localizer), pickle.loads(pickle.dumps(localizer))]
    later = [Sensing(0.1 * k, odometry[k], SCANS[k]) for k in range(20, 26)]
    expected = [localizer.localize(sensing) for sensing in later]
    for copied in copies:
        np.testing.assert_array_equal([copied.localize(sensing) for sensing in later], expected)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("value", [np.nan, np.inf, 0.01])
def test_a_scan_that_shows_nothing_leaves_the_pose_to_odometry(kind, value):
    blind = [np.full(LASER.beams, value, np.float32)] * 20
    localizer = kind()
    track = follow(localizer, biased_odometry(POSES, 0.0)[:20], scans=blind)
    assert gap(track[-1], POSES[19])[0] < 0.05
    assert localizer.map.curves == []
    assert localizer.covariance[0, 0] > 0.0


@pytest.mark.parametrize("kind", KINDS)
def test_a_single_blind_scan_among_others_does_no_harm(kind):
    scans = [np.full(LASER.beams, np.nan, np.float32) if k % 7 == 3 else ranges for k, ranges in enumerate(SCANS)]
    track = follow(kind(), biased_odometry(POSES, 0.05), scans=scans)
    assert gap(track[-1], POSES[-1])[0] < 0.06


@pytest.mark.parametrize("kind", KINDS)
def test_covariance_is_that_of_a_pose_and_grows_while_blind(kind):
    localizer = kind()
    odometry = biased_odometry(POSES, 0.05)
    follow(localizer, odometry[:30], scans=SCANS[:30])
    seeing = localizer.covariance
    np.testing.assert_allclose(seeing, seeing.T, atol=1e-12)
    assert (np.linalg.eigvalsh(seeing) > -1e-12).all()
    for k in range(30, 50):
        localizer.localize(Sensing(0.1 * k, odometry[k], np.full(LASER.beams, np.inf, np.float32)))
    assert np.trace(localizer.covariance) > 2.0 * np.trace(seeing)


@pytest.mark.parametrize("kind", KINDS)
def test_localizers_keep_the_protocol(kind):
    localizer: Localizer = kind()
    localizer.reset(np.array([1.0, 2.0, 4.0]), 0)
    first = localizer.localize(Sensing(0.0, np.array([7.0, 8.0, 9.0]), SCANS[0]))
    np.testing.assert_allclose(first, (1.0, 2.0, 4.0 - math.tau), atol=1e-9)
    assert localizer.covariance.shape == (3, 3)
    assert localizer.take_correction() is None


@pytest.mark.parametrize("kind", KINDS)
def test_what_cannot_be_sensed_is_refused(kind):
    localizer = kind()
    localizer.reset(np.zeros(3), 0)
    localizer.localize(Sensing(1.0, np.zeros(3), SCANS[0]))
    localizer.localize(Sensing(1.0, np.zeros(3), SCANS[0]))  # logs have equal stamps
    with pytest.raises(ValueError, match=r"sensed at 0\.5 s, earlier than the last at 1\.0 s"):
        localizer.localize(Sensing(0.5, np.zeros(3), SCANS[0]))
    with pytest.raises(ValueError, match="odometry"):
        localizer.localize(Sensing(2.0, np.array([0.0, np.nan, 0.0]), SCANS[0]))
    with pytest.raises(ValueError, match="beams"):
        localizer.localize(Sensing(3.0, np.zeros(3), np.ones(3, np.float32)))
    with pytest.raises(ValueError, match="pose"):
        localizer.reset(np.array([0.0, np.inf, 0.0]), 0)


def test_backing_up_is_not_two_half_turns():
    first, distance, second = steps_of(Transform(-0.2, 0.01, 0.05))
    assert abs(first) < 0.1
    assert distance == pytest.approx(-math.hypot(0.2, 0.01))
    assert first + second == pytest.approx(0.05)
    assert steps_of(Transform(0.0, 0.0, 0.3)) == (0.0, 0.0, 0.3)


@given(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
def test_steps_lead_where_the_motion_leads(x, y, turn, heading):
    pose, motion = np.array([1.0, -2.0, heading]), Transform(x, y, turn)
    found = driven(pose[None], np.array([steps_of(motion)]))[0]
    expected = composed(pose, np.array([x, y, turn]))
    # Motions of less than a millimetre have no direction.
    assert math.dist(found[:2], expected[:2]) < 2.1e-3
    assert abs(math.remainder(found[2] - expected[2], 2.0 * math.pi)) < 1e-9


SPREAD = {"start_distance": 0.05, "start_turn": math.radians(1.0)}


@pytest.mark.parametrize(("spread", "wrong"), [(SPREAD, [0.06, -0.04, 0.0]), ({}, [0.0, -0.15, 0.0])])
@pytest.mark.parametrize("kind", KINDS)
def test_a_map_of_an_earlier_run_corrects_a_wrong_start(kind, spread, wrong, tmp_path):
    odometry = biased_odometry(POSES, 0.0)
    earlier = kind()
    follow(earlier, odometry)
    write_spline_map(tmp_path / "map.npz", earlier.map)
    tracking = TrackingSettings(start_map=str(tmp_path / "map.npz"))
    localizer = kind(kind.Settings(tracking=tracking, **spread))
    assert localizer.map.length == pytest.approx(earlier.map.length, rel=0.05)
    wrong = POSES[0] + wrong
    localizer.reset(wrong, 0)
    found = [localizer.localize(Sensing(0.1 * k, odometry[k], SCANS[k])) for k in range(20)]
    assert gap(found[-1], POSES[19])[0] < 0.03
    blank = kind(kind.Settings(**spread))
    blank.reset(wrong, 0)
    alone = [blank.localize(Sensing(0.1 * k, odometry[k], SCANS[k])) for k in range(20)]
    assert gap(alone[-1], POSES[19])[0] > 0.05  # nothing says where it began


def test_a_start_map_that_is_none_is_named(tmp_path):
    (tmp_path / "map.npz").write_bytes(b"no map")
    with pytest.raises(ValueError, match=r"map\.npz is not a spline map"):
        SplineFilter(SplineFilterSettings(tracking=TrackingSettings(start_map=str(tmp_path / "map.npz"))))
