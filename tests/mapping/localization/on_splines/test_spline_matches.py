"""Matches of a scan with a map of curves."""

import numpy as np
import pytest
from polygon_scans import distances_to, scan
from tracked_world import LASER, POSES, WORLD_2

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.localization.on_splines.spline_matches import match
from lidarium.mapping.splines.curve_lookup import CurveLookup
from lidarium.mapping.splines.features import observe
from lidarium.mapping.splines.scan_points import scan_points
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
