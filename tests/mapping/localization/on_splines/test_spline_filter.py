"""The particle filter learns its wheels and finds back."""

import math

import numpy as np
import pytest
from polygon_scans import biased_odometry, scan
from tracked_world import LASER, POSES, SCANS, WORLD_2, follow, gap

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.localization.dead_reckoning.localizer import Sensing
from lidarium.mapping.localization.on_splines.spline_filter import SplineFilter, SplineFilterSettings


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
        pose = localizer.localize(
            Sensing(0.1 * k, np.array([0.1 * k, 0.0, 0.0]), np.array([2.0], np.float32))
        )
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
