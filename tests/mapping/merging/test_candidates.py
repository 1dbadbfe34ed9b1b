"""Candidates for the transform of two maps, and what the maps say of each."""

import math

import numpy as np
import pytest
from drawn_maps import RESOLUTION, about_middle, apartment, blank, moved, room

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.agreement import Agreement
from lidarium.mapping.merging.alignment import Candidate
from lidarium.mapping.merging.candidates import (
    NEAR_M,
    NO_INLIERS,
    THIN_WALL_M,
    Judged,
    ambiguity,
    beside,
    corner_candidates,
    judge,
    most_evident,
    near,
    polished,
)
from lidarium.mapping.merging.correspondence import Matches, match_corners
from lidarium.mapping.merging.described_map import describe_map
from lidarium.mapping.merging.settings import MergeSettings, merge_settings

SETTINGS = MergeSettings()
POSE = about_middle(0.4, apartment())
MIDDLE = (5.0, 4.0)


@pytest.fixture(scope="module")
def maps():
    """The apartment turned, and as it is."""
    return describe_map(moved(apartment(), POSE), RESOLUTION), describe_map(apartment(), RESOLUTION)


def judged(agreeing_m, refusal=None, x=0.0):
    agreement = Agreement(overlap_m2=20.0, agreeing_m=agreeing_m, wall_m=agreeing_m, across_m=5.0, score=1.0)
    return Judged(Candidate(Transform(x), NO_INLIERS), agreement, refusal)


def matches_of(a, b):
    return match_corners(a.corners, b.corners, a.descriptors, b.descriptors, SETTINGS.correspondence)


@pytest.mark.parametrize("mode", ["default", "thesis"])
def test_corners_propose_the_true_transform_among_few(maps, mode):
    a, b = maps
    settings = merge_settings(mode, RESOLUTION)
    found, shortage = corner_candidates(a, b, matches_of(a, b), settings)
    assert shortage is None
    assert 1 <= len(found) <= settings.alignment.candidates
    errors = [one.a_from_b.difference(POSE, MIDDLE) for one in found]
    assert min(distance for distance, _ in errors) < 0.3
    assert all(len(one.inliers) >= settings.alignment.least_inliers for one in found)


def test_too_few_corners_or_matches_propose_nothing_and_say_why(maps):
    a, b = maps
    box = describe_map(room(blank(60, 60), 20, 20, 20, 20)[:, :30], RESOLUTION)
    found, shortage = corner_candidates(a, box, matches_of(a, box), SETTINGS)
    assert found == []
    least = SETTINGS.alignment.least_inliers
    assert shortage == f"too few corners: {len(a.corners)} and {len(box.corners)}, want {least}"
    none = Matches(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0), np.zeros(0))
    found, shortage = corner_candidates(a, b, none, SETTINGS)
    assert found == []
    assert str(shortage).startswith("too few inliers: at most 0 of 0 matches agree")


def test_the_most_evident_is_one_without_objection_however_much_speaks_for_others():
    good, better, refused = judged(10.0), judged(12.0), judged(40.0, "contradiction")
    assert most_evident([good, refused, better]) is better
    assert most_evident([refused, judged(3.0, "small overlap")]) is refused
    assert most_evident([]) is None


def test_a_guess_near_the_truth_is_pulled_into_place(maps):
    a, b = maps
    guess = Transform(POSE.x + 0.8, POSE.y - 0.7, POSE.theta + math.radians(8.0))
    found = near(a, b, guess, SETTINGS)
    best = most_evident(found)
    assert best is not None
    assert best.refusal is None
    assert best.candidate.a_from_b.difference(POSE, MIDDLE)[0] < 0.1
    # The first is the guess itself; all others were found within reach of it, give or take their refinement.
    reach = NEAR_M + SETTINGS.alignment.refinement_reach_m
    centre = b.walls.mean(axis=0)
    assert all(one.candidate.a_from_b.difference(guess, centre)[0] < reach for one in found[1:])


def test_transforms_beside_a_refused_one_reach_over_a_thin_wall(maps):
    one = maps[1]
    # So far away that no wall pulls them.
    far = judge(one, one, Candidate(Transform(50.0, 0.0, 0.0), NO_INLIERS), SETTINGS)
    found = beside(one, one, [far], SETTINGS)
    steps = [(each.candidate.a_from_b.x - 50.0, each.candidate.a_from_b.y) for each in found]
    expected = [(THIN_WALL_M, 0.0), (0.0, THIN_WALL_M), (-THIN_WALL_M, 0.0), (0.0, -THIN_WALL_M)]
    np.testing.assert_allclose(steps, expected, atol=1e-9)


def test_the_two_sides_of_a_thin_wall_are_separated_beside_a_refused_transform(maps):
    one = maps[1]
    off = judge(one, one, Candidate(Transform(THIN_WALL_M, 0.0, 0.0), NO_INLIERS), SETTINGS)
    best = most_evident(beside(one, one, [off], SETTINGS))
    assert best is not None
    assert best.candidate.a_from_b.difference(Transform(), MIDDLE)[0] < 0.03


def test_a_polished_transform_does_not_depend_on_which_map_is_called_a(maps):
    a, b = maps
    start = Transform(POSE.x + 0.1, POSE.y + 0.05, POSE.theta)
    forth = polished(a, b, judge(a, b, Candidate(start, NO_INLIERS), SETTINGS), SETTINGS)
    back = polished(b, a, judge(b, a, Candidate(start.inverse(), NO_INLIERS), SETTINGS), SETTINGS)
    distance, angle = forth.candidate.a_from_b.difference(back.candidate.a_from_b.inverse(), MIDDLE)
    assert distance < 0.01
    assert angle < math.radians(0.1)
    assert forth.candidate.a_from_b.difference(POSE, MIDDLE)[0] < 0.03


def test_a_mode_that_does_not_refine_on_walls_leaves_transforms_as_they_are(maps):
    a, b = maps
    settings = merge_settings("thesis", RESOLUTION)
    one = judge(a, b, Candidate(Transform(POSE.x + 0.1, POSE.y, POSE.theta), NO_INLIERS), settings)
    assert polished(a, b, one, settings) is one


def test_a_square_room_is_ambiguous_and_an_apartment_is_not(maps):
    square = describe_map(room(blank(120, 120), 20, 20, 80, 80), RESOLUTION)
    for one, expected in ((square, "ambiguous: moved by"), (maps[1], None)):
        best = judge(one, one, Candidate(Transform(), NO_INLIERS), SETTINGS)
        found = ambiguity(one, one, best, [best], SETTINGS)
        assert found is expected if expected is None else str(found).startswith(expected)


def test_a_refused_rival_for_which_much_more_speaks_is_named(maps):
    one = maps[1]
    rival = judged(90.0, "contradiction: a wall", 3.0)
    found = ambiguity(one, one, judged(20.0), [rival], SETTINGS)
    assert found == (
        "contradiction: moved by 3.0 m and turned by 0 deg, 90.0 m of walls speak for it instead of 20.0 m, "
        "but contradiction: a wall"
    )
