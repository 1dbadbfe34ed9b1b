import copy
import math
import pickle

import numpy as np
import pytest
from polygon_scans import biased_odometry, ring, scan

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.localization.dead_reckoning.localizer import Localizer, Sensing
from lidarium.mapping.localization.on_splines.spline_ekf import SplineEkf, SplineEkfSettings
from lidarium.mapping.localization.on_splines.spline_filter import SplineFilter, SplineFilterSettings
from lidarium.mapping.localization.on_splines.tracking_settings import TrackingSettings

LASER = ScanGeometry()
WORLD_2 = np.vstack(
    [
        ring((-1.5, -1.5), (4.5, -1.5), (4.5, 4.5), (-1.5, 4.5)),
        ring((-0.7, 2.2), (2.0, 2.2), (2.0, -0.5), (2.3, -0.5), (2.3, 2.5), (-0.7, 2.5)),
    ]
)
KINDS = (SplineFilter, SplineEkf)


def way_round(steps=90):
    """A way from the start of the world with an L past its right side."""
    corners = np.array([(0.0, 0.0), (1.6, -1.0), (2.8, -0.9), (3.3, 1.0), (3.0, 3.5)])
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
    along = np.linspace(0.0, lengths[-1], steps)
    places = np.stack([np.interp(along, lengths, corners[:, k]) for k in (0, 1)], axis=1)
    headings = np.unwrap(np.arctan2(*np.gradient(places, axis=0).T[::-1]))
    kernel = np.ones(9) / 9.0
    smooth = np.convolve(np.pad(headings, 4, mode="edge"), kernel, mode="valid")
    return np.column_stack([places, smooth])


POSES = way_round()
SCANS = [scan(WORLD_2, pose, LASER, noise=0.01, seed=k) for k, pose in enumerate(POSES)]


def follow(localizer, odometry, seed=0, scans=SCANS):
    localizer.reset(POSES[0], seed)
    return np.array(
        [localizer.localize(Sensing(0.1 * k, odometry[k], ranges)) for k, ranges in enumerate(scans)]
    )


def gap(first, second):
    return float(np.hypot(*(first - second)[:2])), abs(math.remainder(float(first[2] - second[2]), math.tau))


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


@pytest.mark.parametrize("bias", [-0.08, 0.08])
def test_particles_learn_what_wheels_tell_too_much(bias):
    localizer = SplineFilter()
    follow(localizer, biased_odometry(POSES, bias))
    of_way, _ = localizer.weights @ localizer.scales
    assert of_way == pytest.approx(1.0 / (1.0 + bias), abs=0.03)


def test_what_is_learned_of_the_wheels_carries_a_robot_that_sees_nothing_more():
    odometry, nothing = biased_odometry(POSES, 0.08), np.full(LASER.beams, np.inf, np.float32)
    seen = [*SCANS[:60], *[nothing] * 30]
    untaught = SplineFilterSettings(distance_bias=0.0, turn_bias=0.0, bias_wander=0.0)
    taught, told = (follow(SplineFilter(settings), odometry, scans=seen)[-1] for settings in (None, untaught))
    assert gap(taught, POSES[-1])[0] < 0.7 * gap(told, POSES[-1])[0]


def test_another_seed_draws_other_particles():
    odometry = biased_odometry(POSES, 0.05)[:10]
    first, second = (follow(SplineFilter(), odometry, seed=seed, scans=SCANS[:10]) for seed in (0, 1))
    assert (first != second).any()


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
    scans = [
        np.full(LASER.beams, np.nan, np.float32) if k % 7 == 3 else ranges for k, ranges in enumerate(SCANS)
    ]
    track = follow(kind(), biased_odometry(POSES, 0.05), scans=scans)
    assert gap(track[-1], POSES[-1])[0] < 0.06


def test_a_laser_of_one_beam_leaves_the_pose_to_odometry():
    localizer = SplineFilter(geometry=ScanGeometry(beams=1))
    localizer.reset(np.zeros(3), 0)
    for k in range(5):
        pose = localizer.localize(
            Sensing(0.1 * k, np.array([0.1 * k, 0.0, 0.0]), np.array([2.0], np.float32))
        )
    assert pose[0] == pytest.approx(0.4, abs=0.1)


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
    with pytest.raises(ValueError, match="not later"):
        localizer.localize(Sensing(1.0, np.zeros(3), SCANS[0]))
    with pytest.raises(ValueError, match="odometry"):
        localizer.localize(Sensing(2.0, np.array([0.0, np.nan, 0.0]), SCANS[0]))
    with pytest.raises(ValueError, match="beams"):
        localizer.localize(Sensing(3.0, np.zeros(3), np.ones(3, np.float32)))
    with pytest.raises(ValueError, match="pose"):
        localizer.reset(np.array([0.0, np.inf, 0.0]), 0)


@pytest.mark.parametrize("seed", range(3))
def test_particles_that_were_led_astray_find_back(seed):
    localizer = SplineFilter(SplineFilterSettings(particles=400))
    localizer.reset(POSES[0], seed)
    still = np.zeros(3)
    for k in range(3):
        localizer.localize(Sensing(0.1 * k, still, SCANS[0]))
    astray = Transform(0.0, 0.0, -POSES[0][2]).apply(np.array([[0.15, 0.15]]))[0]
    localizer.particles[:, :2] += astray
    localizer.local = localizer.local + np.array([*astray, 0.0])
    for k in range(3, 60):
        turned = POSES[0] + np.array([0.0, 0.0, 0.02 * (k % 2)])
        ranges = scan(WORLD_2, turned, LASER, 0.01, seed=k)
        pose = localizer.localize(Sensing(0.1 * k, np.array([0.0, 0.0, 0.02 * (k % 2)]), ranges))
    assert gap(pose, turned)[0] < 0.02


@pytest.mark.parametrize(
    "make",
    [
        lambda: TrackingSettings(curve_sigma=0.0),
        lambda: TrackingSettings(ray_stride=0),
        lambda: TrackingSettings(slip_per_metre=-1.0),
        lambda: SplineFilterSettings(particles=0),
        lambda: SplineFilterSettings(recovered_share=2.0),
        lambda: SplineFilterSettings(distance_bias=-0.1),
        lambda: SplineEkfSettings(gate_sigmas=math.nan),
    ],
)
def test_settings_that_make_no_sense_are_refused(make):
    with pytest.raises(ValueError, match="want"):
        make()
