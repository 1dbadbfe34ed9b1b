"""Scans are matched near what odometry says, else far from it."""

import numpy as np
import pytest
from driven_rooms import GEOMETRY, cast, odd_room
from mapped_room import ORIGIN, odd_room_submap, points_of

from lidarium.mapping.geometry.rigid import composed
from lidarium.mapping.localization.matching.local_matching import LocalMatcher, outweighs
from lidarium.mapping.localization.matching.scan_matching import Match
from lidarium.mapping.localization.matching.settings.matching import MatchingSettings
from lidarium.mapping.localization.matching.settings.slam import SlamSettings

BETTER_BY = 0.1


def match_of(score, overlap):
    return Match(np.zeros(3), score, overlap, 0.0, np.eye(3), np.zeros((3, 3)))


@pytest.mark.parametrize(("score", "is_believed"), [(0.45, False), (0.55, True), (0.8, True)])
def test_odometry_is_given_up_only_for_a_match_that_is_clearly_better(score, is_believed):
    assert outweighs(match_of(score, 1.0), match_of(0.4, 1.0), BETTER_BY) == is_believed


def test_part_of_a_scan_that_agrees_better_does_not_outweigh_all_of_it():
    # As it was at the corner of a hall, where the part lay on the other side of a wall of 0.2 m.
    near, far = match_of(0.43, 0.92), match_of(0.56, 0.64)
    assert not outweighs(far, near, BETTER_BY)
    assert outweighs(match_of(0.56, 0.92), near, BETTER_BY)


SURE = np.diag([1e-4, 1e-4, 1e-4])
MATCHING = MatchingSettings(range_m=5.6)


@pytest.fixture(scope="module")
def submap():
    return odd_room_submap()


def matcher():
    made = LocalMatcher(SlamSettings(matching=MATCHING), GEOMETRY)
    made.usual_score = 0.7
    return made


def seen(pose):
    return points_of(cast(odd_room(), composed(ORIGIN, np.asarray(pose, float))))


def test_a_scan_near_where_odometry_leads_is_matched_there(submap):
    true = np.array([0.1, -0.1, 0.05])
    one = matcher()
    match = one.match(submap, seen(true), true + np.array([0.03, -0.02, 0.01]), np.zeros(3), SURE, 0)
    assert match is not None
    assert np.abs(match.pose - true).max() < 0.02
    assert one.explains
    assert one.contradiction < 0.1
    assert one.usual_score == pytest.approx(0.9 * 0.7 + 0.1 * match.score)


@pytest.mark.parametrize("turn", [2.0, -1.2])
def test_a_turn_that_odometry_does_not_know_is_found_in_any_direction(submap, turn):
    true = np.array([0.1, 0.1, turn])
    one = matcher()
    match = one.match(submap, seen(true), np.array([0.1, 0.1, 0.0]), np.zeros(3), SURE, 0)
    assert match is not None
    assert np.abs(match.pose - true).max() < 0.03
    assert one.recoveries == 1


def test_a_scan_of_another_place_matches_nowhere(submap):
    square = np.array(
        [(-0.7, -0.7, 0.7, -0.7), (0.7, -0.7, 0.7, 0.7), (0.7, 0.7, -0.7, 0.7), (-0.7, 0.7, -0.7, -0.7)]
    )
    one = matcher()
    assert one.match(submap, points_of(cast(square, np.zeros(3))), np.zeros(3), np.zeros(3), SURE, 0) is None
    assert not one.explains
    assert one.usual_score == 0.7


def test_on_new_ground_and_with_hardly_a_return_odometry_is_believed(submap):
    predicted = np.array([0.05, 0.02, 0.01])
    few = seen(predicted)[:5]
    match = matcher().match(submap, few, predicted, np.zeros(3), SURE, 0)
    assert match is not None
    assert match.pose is predicted
    assert not match.information.any()
    far = np.array([40.0, 0.0, 0.0])
    match = matcher().match(submap, seen(np.zeros(3)), far, np.zeros(3), SURE, 0)
    assert match is not None
    assert match.pose is far


def test_the_first_scan_is_matched_at_the_origin_only_if_it_agrees(submap):
    one = matcher()
    match = one.match_first(submap, seen((0.02, 0.01, 0.0)))
    assert match is not None
    assert match.pose == pytest.approx((0.02, 0.01, 0.0), abs=0.02)
    assert one.match_first(submap, seen((0.0, 0.0, 2.0))) is None


def test_a_pose_found_otherwise_is_noted_where_it_agrees(submap):
    one = matcher()
    one.judge(submap, seen((0.0, 0.0, 2.0)), np.zeros(3))
    assert one.usual_score == 0.7
    one.judge(submap, seen(np.zeros(3)), np.zeros(3))
    assert one.usual_score != 0.7
