"""The particle filter learns its wheels and finds back."""

import math

import numpy as np
import pytest
from polygon_scans import biased_odometry, scan
from tracked_world import LASER, POSES, SCANS, WORLD_2, follow, gap

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.localization.localizer import Sensing
from lidarium.mapping.localization.on_splines.spline_filter import (
    SplineFilter,
    SplineFilterSettings,
    _MatchedFeatures,
    _ray_likelihoods,
    _weigh_features,
    _weigh_rays,
)


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


def test_a_laser_of_one_beam_leaves_the_pose_to_odometry():
    localizer = SplineFilter(geometry=ScanGeometry(beams=1))
    localizer.reset(np.zeros(3), 0)
    for k in range(5):
        pose = localizer.localize(Sensing(0.1 * k, np.array([0.1 * k, 0.0, 0.0]), np.array([2.0], np.float32)))
    assert pose[0] == pytest.approx(0.4, abs=0.1)


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
    "wrong",
    [{"particles": 0}, {"recovered_share": 2.0}, {"distance_bias": -0.1}, {"recovery_turn": math.nan}],
)
def test_settings_that_make_no_sense_are_refused(wrong):
    with pytest.raises(ValueError, match="want"):
        SplineFilterSettings(**wrong)


def test_weights_are_a_distribution_and_particles_stay_together():
    localizer = SplineFilter()
    follow(localizer, biased_odometry(POSES, 0.05)[:40], scans=SCANS[:40])
    assert localizer.weights.min() >= 0.0
    assert localizer.weights.sum() == pytest.approx(1.0)
    assert localizer.resamplings > 0
    assert len(localizer.particles) == localizer.settings.particles
    assert np.sqrt(np.diag(localizer.local_covariance)[:2]).max() < 0.05


SIGMA = 0.03


@pytest.fixture
def rng():
    return np.random.default_rng(4)


def drawn(rng, count=7):
    return rng.uniform([-1.0, -1.0, -math.pi], [1.0, 1.0, math.pi], (count, 3))


def test_features_weigh_by_their_distances_and_turns(rng):
    particles = drawn(rng)
    points = _MatchedFeatures(rng.normal(size=(4, 2)), rng.normal(size=(4, 2)), rng.uniform(0.1, 0.5, 4))
    lines = _MatchedFeatures(drawn(rng, 3), drawn(rng, 3), rng.uniform(0.1, 0.5, 3))
    found, expected = np.zeros(len(particles)), np.zeros(len(particles))
    _weigh_features(particles, points, lines, 0.2, found)
    for i, particle in enumerate(particles.tolist()):
        pose = Transform(*particle)
        for seen, known, sigma in zip(*points, strict=True):
            expected[i] -= 0.5 * (math.dist(pose.apply(seen[None])[0], known) / sigma) ** 2
        for seen, known, sigma in zip(*lines, strict=True):
            gap = pose.apply(seen[None, :2])[0] - known[:2]
            aside = gap[1] * math.cos(known[2]) - gap[0] * math.sin(known[2])
            turn = math.remainder(particle[2] + seen[2] - known[2], 2.0 * math.pi)
            expected[i] -= 0.5 * ((aside / sigma) ** 2 + (turn / 0.2) ** 2)
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_rays_weigh_by_the_distances_of_their_ends_from_pieces(rng):
    particles, rays = drawn(rng), rng.uniform(-1.0, 1.0, (5, 2))
    along = rng.uniform(0.0, math.pi, 5)
    pieces = np.column_stack([rng.uniform(-1, 1, (5, 2)), np.cos(along), np.sin(along), np.ones(5)])
    logarithms, fits = np.zeros(len(particles)), np.zeros(len(particles))
    _weigh_rays(particles, rays, pieces, _ray_likelihoods(SIGMA), 0.5, logarithms, fits)
    for i, particle in enumerate(particles.tolist()):
        ends = Transform(*particle).apply(rays) - pieces[:, :2]
        gaps = np.abs(ends[:, 1] * pieces[:, 2] - ends[:, 0] * pieces[:, 3])
        likelihoods = 0.95 * np.exp(-0.5 * (gaps / SIGMA) ** 2) + 0.05
        assert logarithms[i] == pytest.approx(0.5 * np.log(likelihoods).sum(), abs=0.05)
        assert fits[i] == pytest.approx(likelihoods.mean(), abs=0.01)


def test_a_ray_that_ends_on_its_curve_fits_and_one_that_ends_far_off_hardly_does():
    table = _ray_likelihoods(SIGMA)
    assert table[0, 1] == pytest.approx(1.0, abs=1e-3)
    assert table[-1, 1] == pytest.approx(0.05)
    assert (np.diff(table, axis=0) <= 0.0).all()
    np.testing.assert_allclose(table[:, 0], np.log(table[:, 1]), atol=1e-9)
