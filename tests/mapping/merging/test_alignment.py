import math

import numpy as np
import pytest
from drawn_maps import RESOLUTION, SPREAD, about_middle, apartment, moved
from hypothesis import given, settings
from hypothesis import strategies as st

from lidarium.mapping.geometry.rigid import Transform, wrapped
from lidarium.mapping.merging.alignment import AlignmentSettings, _propose, _sweep_rotation, find_inliers
from lidarium.mapping.merging.corners import Corners, detect_corners
from lidarium.mapping.merging.correspondence import METHODS, CorrespondenceSettings, Matches, match_corners
from lidarium.mapping.merging.described_map import describe_map

POSES = st.builds(Transform, st.floats(-5, 5), st.floats(-5, 5), st.floats(-3.1, 3.1))


def close(first, second, distance=1e-9, angle=1e-9):
    d, a = first.difference(second)
    return d <= distance and a <= angle


def corners_at(points, angles):
    points = np.asarray(points, float)
    return Corners(
        np.floor(points / RESOLUTION).astype(np.int64),
        points,
        np.asarray(angles, float),
        np.full(len(points), 5),
    )


def scattered(count, seed=0):
    generator = np.random.default_rng(seed)
    return generator.uniform(0.0, 10.0, (count, 2)), generator.uniform(-3.0, 3.0, count)


def seen_from(b_points, b_angles, a_from_b):
    return corners_at(a_from_b.apply(b_points), np.asarray(b_angles) + a_from_b.theta), corners_at(b_points, b_angles)


def paired(first, second):
    rotation = [wrapped(turn) for turn in (first.angles - second.angles).tolist()]
    count = len(first)
    return Matches(np.arange(count), np.arange(count), np.ones(count), np.array(rotation))


@settings(max_examples=20)
@given(POSES)
def test_every_exact_match_proposes_the_true_transform(pose):
    first, second = seen_from(*scattered(8), pose)
    for x, y, theta in _propose(first, second, paired(first, second)).tolist():
        assert close(Transform(x, y, theta), pose, 1e-7, 1e-7)


def test_the_transform_maps_b_into_a():
    first, second = seen_from(*scattered(6), Transform(1.0, -2.0, math.radians(30.0)))
    np.testing.assert_allclose(_propose(first, second, paired(first, second))[0], (1.0, -2.0, math.radians(30.0)))


def test_the_true_transform_wins_among_sixty_percent_wrong_matches():
    pose = Transform(2.0, 1.0, 0.7)
    first, second = seen_from(*scattered(30), pose)
    generator = np.random.default_rng(1)
    partner = np.arange(30)
    partner[:18] = np.roll(generator.permutation(18), 1)
    rotation = np.array([wrapped(turn) for turn in (first.angles - second.angles[partner]).tolist()])
    matches = Matches(np.arange(30), partner, np.ones(30), rotation)
    proposals, is_inlier = find_inliers(first, second, matches, RESOLUTION, AlignmentSettings())
    counts = is_inlier.sum(axis=1)
    assert counts.max() == 12
    assert close(Transform(*proposals[counts.argmax()].tolist()), pose, 1e-6, 1e-6)


def test_a_corner_takes_part_in_one_inlier_only():
    first, second = seen_from([(1, 1), (1.02, 1.0), (4, 4)], [0, 0, 0], Transform())
    pairs = [(0, 0), (0, 1), (1, 0), (1, 1), (2, 2)]
    matches = Matches(np.array([p[0] for p in pairs]), np.array([p[1] for p in pairs]), np.ones(5), np.zeros(5))
    _, is_inlier = find_inliers(first, second, matches, RESOLUTION, AlignmentSettings())
    assert is_inlier.sum(axis=1).max() == 3


def test_the_ratio_rule_is_loose_far_from_the_corner_and_tight_near_it():
    # 256 cells out, 20 cells of error pass; one cell out, one cell does not.
    far, near = 256.0 * RESOLUTION, 1.0 * RESOLUTION
    settings_ = AlignmentSettings(inlier_rule="ratio")
    for place, error, agrees in ((far, 20.0, True), (far, 23.0, False), (near, 1.0, False)):
        first = corners_at([(5.0, 5.0), (place + error * RESOLUTION, place)], [0, 0])
        second = corners_at([(5.0, 5.0), (place, place)], [0, 0])
        _, is_inlier = find_inliers(first, second, paired(first, second), RESOLUTION, settings_)
        assert bool(is_inlier[0, 1]) is agrees


def test_the_sweep_repairs_a_rotation_within_seven_degrees():
    points, _ = scattered(9)
    pose = Transform(1.0, 2.0, 0.5)
    swept = _sweep_rotation(pose.apply(points), points, Transform(1.0, 2.0, 0.5 + math.radians(5.0)))
    assert close(swept, pose, 0.05, math.radians(0.26))


@pytest.mark.parametrize("method", METHODS)
def test_each_method_matches_corners_of_a_turned_map(method):
    pose = about_middle(math.pi / 2.0, apartment(), (SPREAD, SPREAD))
    a, b = describe_map(moved(apartment(), pose), RESOLUTION), describe_map(apartment(), RESOLUTION)
    matches = match_corners(a.corners, b.corners, a.descriptors, b.descriptors, CorrespondenceSettings(method=method))
    gaps = np.linalg.norm(pose.apply(b.corners.points[matches.second]) - a.corners.points[matches.first], axis=1)
    is_right = gaps < 0.1
    assert is_right.sum() >= 0.7 * min(len(a.corners), len(b.corners))
    if method == "descriptors":
        assert is_right.mean() > 0.3
        np.testing.assert_allclose(matches.rotation[is_right], math.pi / 2.0, atol=0.11)


def test_nothing_matches_where_there_are_no_corners():
    none, some = (
        describe_map(np.full((30, 30), 255, np.uint8), RESOLUTION),
        describe_map(apartment(), RESOLUTION),
    )
    for method in METHODS:
        found = match_corners(
            none.corners,
            some.corners,
            none.descriptors,
            some.descriptors,
            CorrespondenceSettings(method=method),
        )
        assert len(found) == 0
    assert len(detect_corners(none.levels, RESOLUTION)) == 0
