"""Two local maps grow at a time, and hand over to each other."""

import math

import numpy as np
import pytest
from driven_rooms import GEOMETRY, cast, odd_room
from mapped_room import ORIGIN, odd_room_submap, points_of

from lidarium.mapping.geometry.rigid import composed
from lidarium.mapping.localization.matching.local_mapping import LocalMapper, _LocalMatcher, _outweighs, way
from lidarium.mapping.localization.matching.scan_matching import Match
from lidarium.mapping.localization.settings import MatchingSettings, SlamSettings, SubmapSettings

SETTINGS = SlamSettings(submaps=SubmapSettings(resolution=0.05, path_m=2.0, least_scans=4))
STEP = np.array([0.1, 0.05, 0.02])


def seen(pose):
    return cast(odd_room(), composed(ORIGIN, pose))


def begun():
    mapper = LocalMapper(SETTINGS, GEOMETRY)
    assert mapper.begin(7, seen(np.zeros(3))) == []
    return mapper


def test_the_length_of_a_motion_counts_turns_as_a_metre_a_radian():
    assert way(np.array([3.0, -4.0, -0.5])) == pytest.approx(5.5)


def test_another_map_is_wanted_after_half_a_path_and_half_the_scans():
    mapper = begun()
    mapper.insert(STEP, 5.0, seen(STEP))
    assert mapper.wants_another
    mapper.add(8, STEP, seen(STEP))
    assert not mapper.wants_another
    slow = begun()
    for _ in range(6):
        slow.insert(STEP, 0.1, seen(STEP))
    assert not slow.wants_another


def test_a_full_map_hands_over_and_keeps_its_nodes_where_they_were():
    mapper = begun()
    mapper.insert(STEP, 1.0, seen(STEP))
    mapper.note_node(8, STEP)
    mapper.add(8, STEP, seen(STEP))
    poses = np.array([composed(STEP, np.array([0.3, 0.2, 0.1])), STEP])
    same, ended = mapper.hand_over(poses)
    assert (same is poses, ended, mapper.node) == (True, [], 7)
    for _ in range(3):
        mapper.insert(poses[0], 0.5, seen(poses[0]))
    mapper.note_node(9, poses[0])
    there, (finished,) = mapper.hand_over(poses)
    assert mapper.node == 8
    np.testing.assert_allclose(there, [(0.3, 0.2, 0.1), (0.0, 0.0, 0.0)], atol=1e-12)
    assert finished.nodes.tolist() == [7, 8, 9]
    np.testing.assert_allclose(finished.places, [np.zeros(3), STEP, poses[0]], atol=1e-12)


def test_scans_enter_both_maps_where_they_were_taken():
    mapper = begun()
    mapper.add(8, np.array([0.4, -0.2, 0.3]), seen(np.array([0.4, -0.2, 0.3])))
    for k in range(6):
        pose = k * STEP
        assert mapper.insert(pose, 1.0, seen(pose))
    there, _ = mapper.hand_over(np.array([[0.5, -0.1, 0.35]]))
    points = points_of(seen(np.array([0.5, -0.1, 0.35])))
    match = mapper.match(points, there[0], np.zeros(3), np.diag([1e-4, 1e-4, 1e-4]), 0)
    assert match is not None
    assert math.dist(match.pose[:2], there[0, :2]) < 0.02
    assert match.score > 0.5


def test_a_scan_beyond_what_a_map_can_hold_does_not_fit_in():
    mapper = begun()
    assert mapper.insert(STEP, 0.1, seen(STEP))
    assert not mapper.insert(np.array([90.0, 0.0, 0.0]), 90.0, seen(STEP))


def test_a_new_beginning_ends_maps_of_enough_scans_only():
    mapper = begun()
    assert mapper.begin(8, seen(np.zeros(3))) == []
    mapper.insert(STEP, 0.1, seen(STEP))
    (finished,) = mapper.begin(9, seen(np.zeros(3)))
    assert finished.nodes.tolist() == [8]
    assert mapper.node == 9


BETTER_BY = 0.1


def match_of(score, overlap):
    return Match(np.zeros(3), score, overlap, 0.0, np.eye(3), np.zeros((3, 3)))


@pytest.mark.parametrize(("score", "is_believed"), [(0.45, False), (0.55, True), (0.8, True)])
def test_odometry_is_given_up_only_for_a_match_that_is_clearly_better(score, is_believed):
    assert _outweighs(match_of(score, 1.0), match_of(0.4, 1.0), BETTER_BY) == is_believed


def test_part_of_a_scan_that_agrees_better_does_not_outweigh_all_of_it():
    # As it was at the corner of a hall, where the part lay on the other side of a wall of 0.2 m.
    near, far = match_of(0.43, 0.92), match_of(0.56, 0.64)
    assert not _outweighs(far, near, BETTER_BY)
    assert _outweighs(match_of(0.56, 0.92), near, BETTER_BY)


SURE = np.diag([1e-4, 1e-4, 1e-4])
MATCHING = MatchingSettings(range_m=5.6)


@pytest.fixture(scope="module")
def submap():
    return odd_room_submap()


def matcher():
    made = _LocalMatcher(SlamSettings(matching=MATCHING), GEOMETRY)
    made.usual_score = 0.7
    return made


def seen_local_matching(pose):
    return points_of(cast(odd_room(), composed(ORIGIN, np.asarray(pose, float))))


def test_a_scan_near_where_odometry_leads_is_matched_there(submap):
    true = np.array([0.1, -0.1, 0.05])
    one = matcher()
    match = one.match(submap, seen_local_matching(true), true + np.array([0.03, -0.02, 0.01]), np.zeros(3), SURE, 0)
    assert match is not None
    assert np.abs(match.pose - true).max() < 0.02
    assert one.explains
    assert one.contradiction < 0.1
    assert one.usual_score == pytest.approx(0.9 * 0.7 + 0.1 * match.score)


@pytest.mark.parametrize("turn", [2.0, -1.2])
def test_a_turn_that_odometry_does_not_know_is_found_in_any_direction(submap, turn):
    true = np.array([0.1, 0.1, turn])
    one = matcher()
    match = one.match(submap, seen_local_matching(true), np.array([0.1, 0.1, 0.0]), np.zeros(3), SURE, 0)
    assert match is not None
    assert np.abs(match.pose - true).max() < 0.03
    assert one.recoveries == 1


def test_a_scan_of_another_place_matches_nowhere(submap):
    square = np.array([(-0.7, -0.7, 0.7, -0.7), (0.7, -0.7, 0.7, 0.7), (0.7, 0.7, -0.7, 0.7), (-0.7, 0.7, -0.7, -0.7)])
    one = matcher()
    assert one.match(submap, points_of(cast(square, np.zeros(3))), np.zeros(3), np.zeros(3), SURE, 0) is None
    assert not one.explains
    assert one.usual_score == 0.7


def test_on_new_ground_and_with_hardly_a_return_odometry_is_believed(submap):
    predicted = np.array([0.05, 0.02, 0.01])
    few = seen_local_matching(predicted)[:5]
    match = matcher().match(submap, few, predicted, np.zeros(3), SURE, 0)
    assert match is not None
    assert match.pose is predicted
    assert not match.information.any()
    far = np.array([40.0, 0.0, 0.0])
    match = matcher().match(submap, seen_local_matching(np.zeros(3)), far, np.zeros(3), SURE, 0)
    assert match is not None
    assert match.pose is far


def test_the_first_scan_is_matched_at_the_origin_only_if_it_agrees(submap):
    one = matcher()
    match = one.match_first(submap, seen_local_matching((0.02, 0.01, 0.0)))
    assert match is not None
    assert match.pose == pytest.approx((0.02, 0.01, 0.0), abs=0.02)
    assert one.match_first(submap, seen_local_matching((0.0, 0.0, 2.0))) is None


def test_a_pose_found_otherwise_is_noted_where_it_agrees(submap):
    one = matcher()
    one.judge(submap, seen_local_matching((0.0, 0.0, 2.0)), np.zeros(3))
    assert one.usual_score == 0.7
    one.judge(submap, seen_local_matching(np.zeros(3)), np.zeros(3))
    assert one.usual_score != 0.7
