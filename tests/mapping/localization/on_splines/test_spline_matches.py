"""Matches of a scan with a map of curves."""

import math

import numpy as np
import pytest
from polygon_scans import distances_to, scan
from tracked_world import LASER, POSES, WORLD_2

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.localization.on_splines.spline_matches import (
    Matches,
    Measured,
    TrackingSettings,
    joined,
    match,
    measured_lines,
    measured_points,
    measured_rays,
)
from lidarium.mapping.splines.curve import CurveLookup
from lidarium.mapping.splines.features import observe, scan_points
from lidarium.mapping.splines.spline_map import SplineMap

HERE = Transform(*POSES[0].tolist())


def observed(pose):
    return observe(scan_points(scan(WORLD_2, (pose.x, pose.y, pose.theta), LASER), LASER))


@pytest.fixture(scope="module")
def known():
    """The map as it is after some scans from one place, and its curves around there."""
    spline_map, lookup = SplineMap(), CurveLookup(LASER.range_max, 0.3)
    for _ in range(4):
        spline_map.update(observed(HERE), HERE)
    lookup.renew(spline_map.curves, np.array([HERE.x, HERE.y]))
    return spline_map, lookup


def test_what_is_seen_again_lies_on_what_is_known(known):
    true = HERE @ Transform(0.05, -0.03, 0.02)
    found = match(observed(true), *known, true, 4, 2)
    assert found.features >= 4
    np.testing.assert_allclose(true.apply(found.points), found.known_points, atol=0.03)
    assert len(found.rays) > 20
    assert distances_to(WORLD_2, true.apply(found.rays)).max() < 0.02
    across = np.stack([-found.pieces[:, 3], found.pieces[:, 2]], axis=1)
    assert np.abs(((true.apply(found.rays) - found.pieces[:, :2]) * across).sum(axis=1)).max() < 0.05


def test_points_that_few_scans_have_seen_are_left_out(known):
    assert len(match(observed(HERE), *known, HERE, 4, 4).points) > 0
    assert len(match(observed(HERE), *known, HERE, 4, 5).points) == 0


def test_every_so_many_th_beam_is_a_ray(known):
    observation = observed(HERE)
    counts = [len(match(observation, *known, HERE, stride, 1).rays) for stride in (1, 5)]
    assert counts[1] == pytest.approx(counts[0] / 5, abs=2)


def test_a_blank_map_matches_nothing():
    blank, lookup = SplineMap(), CurveLookup(LASER.range_max, 0.3)
    lookup.renew([], np.zeros(2))
    found = match(observed(HERE), blank, lookup, HERE, 4, 1)
    assert (found.features, len(found.rays), found.pieces.shape) == (0, 0, (0, 5))


def test_features_far_from_where_they_are_known_are_not_matched(known):
    far = HERE @ Transform(1.7, 1.3, 0.8)
    assert len(match(observed(HERE), *known, far, 4, 1).points) == 0


@pytest.mark.parametrize("wrong", [{"curve_sigma": 0.0}, {"ray_stride": 0}, {"slip_per_metre": -1.0}])
def test_settings_that_make_no_sense_are_refused(wrong):
    (name,) = wrong
    with pytest.raises(ValueError, match=f"{name} of tracking is .* want"):
        TrackingSettings(**wrong)


TRACKING = TrackingSettings()
TRUE, NEAR = Transform(0.5, -0.3, 2.0), np.array([0.48, -0.29, 2.02])
KINDS = (measured_points, measured_lines, measured_rays)


def exact_matches():
    """What a robot at the true pose sees of points, lines and pieces, without any error."""
    generator = np.random.default_rng(5)
    points, places = generator.uniform(-3.0, 3.0, (6, 2)), generator.uniform(-3.0, 3.0, (5, 2))
    turns = generator.uniform(-3.0, 3.0, 5)
    along = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    lines, pieces = np.column_stack([places, turns]), np.column_stack([places, along, np.ones(5)])
    back = TRUE.inverse()
    seen = np.column_stack([back.apply(places + 0.4 * along), turns + back.theta])
    return Matches(
        back.apply(points),
        points,
        np.full(6, 0.01),
        seen,
        lines,
        np.full(5, 0.05),
        back.apply(places - 0.2 * along),
        pieces,
    )


@pytest.mark.parametrize("measure", KINDS)
def test_nothing_is_missed_at_the_true_pose(measure):
    found = measure(exact_matches(), np.array([TRUE.x, TRUE.y, TRUE.theta]), TRACKING)
    np.testing.assert_allclose(found.misses, 0.0, atol=1e-12)


@pytest.mark.parametrize("measure", KINDS)
def test_jacobians_are_the_differences_of_what_is_missed(measure):
    matches, step = exact_matches(), 1e-6
    found = measure(matches, NEAR, TRACKING)
    for column in range(3):
        move = step * np.eye(3)[column]
        above, below = (measure(matches, NEAR + sign * move, TRACKING).misses for sign in (1.0, -1.0))
        np.testing.assert_allclose(found.jacobian[:, column], (below - above) / (2.0 * step), atol=1e-6)


def test_all_together_lead_back_to_the_true_pose():
    pose = NEAR.copy()
    for _ in range(5):
        parts = [measure(exact_matches(), pose, TRACKING) for measure in KINDS]
        information, change = joined(parts).information()
        pose = pose + np.linalg.solve(information, change)
    assert pose == pytest.approx((TRUE.x, TRUE.y, TRUE.theta), abs=1e-9)


def test_variances_have_a_floor_and_rays_count_their_share():
    matches = exact_matches()
    assert (measured_points(matches, NEAR, TRACKING).variances == TRACKING.feature_sigma**2).all()
    lines = measured_lines(matches, NEAR, TRACKING).variances
    np.testing.assert_allclose(lines, np.repeat([0.05**2, TRACKING.line_angle_sigma**2], 5))
    rays = measured_rays(matches, NEAR, TRACKING).variances
    np.testing.assert_allclose(rays, TRACKING.curve_sigma**2 / TRACKING.ray_share)


def test_lines_miss_by_the_short_turn():
    matches = exact_matches()
    turned = measured_lines(matches, np.array([TRUE.x, TRUE.y, TRUE.theta + math.tau - 0.01]), TRACKING)
    np.testing.assert_allclose(turned.misses[5:], 0.01, atol=1e-9)


def test_what_misses_by_too_many_deviations_is_left_out():
    measured = Measured(np.array([0.1, -0.5, 0.29, 0.31]), np.arange(12.0).reshape(4, 3), np.full(4, 0.01))
    kept = measured.within(3.0)
    assert kept.misses.tolist() == [0.1, 0.29]
    np.testing.assert_array_equal(kept.jacobian, measured.jacobian[[0, 2]])
