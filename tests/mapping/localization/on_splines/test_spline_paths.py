"""Localizers on spline maps over long ways: closures, corrections, spreads that hold."""

import math

import numpy as np
import pytest
from driven_rooms import GEOMETRY, RING_ROUND, driven, ring
from polygon_scans import distances_to, scan

from lidarium.mapping.geometry.rigid import composed
from lidarium.mapping.localization.localizer import Sensing
from lidarium.mapping.localization.on_splines.spline_ekf import SplineEkf
from lidarium.mapping.localization.on_splines.spline_filter import SplineFilter, SplineFilterSettings
from lidarium.mapping.localization.on_splines.spline_matches import TrackingSettings
from lidarium.mapping.splines.settings import PointSettings, SplineSettings

KINDS = (SplineFilter, SplineEkf)
WITHIN_95 = 7.815
WALLS = ring() - np.tile(RING_ROUND[0], 2)
"""As seen from where the robot begins."""


@pytest.fixture(scope="module")
def ring_run():
    return driven(ring(), RING_ROUND, drift=(0.05, 0.01))


@pytest.fixture(scope="module", params=KINDS)
def followed(request, ring_run):
    localizer = request.param(geometry=GEOMETRY)
    localizer.reset(ring_run.truth[0], 0)
    poses, covariances, corrections = [], [], []
    for sensing in ring_run.sensings:
        poses.append(localizer.localize(sensing))
        covariances.append(localizer.covariance)
        correction = localizer.take_correction()
        if correction is not None:
            corrections.append(correction)
            assert localizer.take_correction() is None
    localizer.finish()
    return localizer, np.array(poses), np.array(covariances), corrections


def test_a_loop_is_closed_and_the_past_corrected(ring_run, followed):
    localizer, poses, _, corrections = followed
    assert np.hypot(*(poses - ring_run.truth)[:, :2].T).max() < 0.3
    assert corrections
    times = np.array([sensing.time_s for sensing in ring_run.sensings])
    scans = localizer.key_scans
    truth = ring_run.truth[np.searchsorted(times, scans.times_s - 1e-6)]
    assert np.hypot(*(scans.poses - truth)[:, :2].T).max() < 0.15


def test_local_maps_are_joined_without_doubled_walls(followed):
    localizer, *_ = followed
    whole = localizer.map
    assert np.quantile(distances_to(WALLS, whole.sample()), 0.9) < 0.15
    length = np.hypot(*(WALLS[:, 2:] - WALLS[:, :2]).T).sum()
    assert 0.6 * length < whole.length < 1.3 * length


def test_true_poses_lie_within_the_spread(ring_run, followed):
    _, poses, covariances, _ = followed
    errors = poses - ring_run.truth
    errors[:, 2] = np.arctan2(np.sin(errors[:, 2]), np.cos(errors[:, 2]))
    squares = (errors * np.linalg.solve(covariances, errors[..., None])[..., 0]).sum(axis=1)
    assert (squares <= WITHIN_95).mean() > 0.8
    # A spread that holds all and says nothing would be wider than this.
    assert np.sqrt(covariances[:, 0, 0]).max() < 0.5


def test_a_laser_ahead_of_the_middle_gives_poses_of_the_middle(ring_run):
    ahead = np.array([0.2, 0.0, 0.0])
    points = PointSettings(laser_x=0.2)
    settings = SplineFilterSettings(tracking=TrackingSettings(splines=SplineSettings(points=points)))
    localizer = SplineFilter(settings, GEOMETRY)
    localizer.reset(ring_run.truth[0], 0)
    for k, (pose, sensing) in enumerate(zip(ring_run.truth[:250], ring_run.sensings, strict=False)):
        ranges = scan(WALLS, composed(pose, ahead), GEOMETRY, noise=0.01, seed=k)
        found = localizer.localize(Sensing(sensing.time_s, sensing.odometry, ranges))
    assert math.dist(found[:2], pose[:2]) < 0.2
    scans = localizer.key_scans
    np.testing.assert_allclose(scans.poses[0], composed(ring_run.truth[0], ahead), atol=1e-9)
