"""Corners and peaks of a map, seen again and again."""

import numpy as np

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.splines.landmarks import no_landmarks
from lidarium.mapping.splines.settings import MapSettings

SETTINGS = MapSettings()


def seen(points, sigmas, update=1, before=None):
    before = no_landmarks() if before is None else before
    points = np.array(points, float).reshape(-1, 2)
    return before.updated(points, np.full(len(points), sigmas), update, 0.2, SETTINGS)


def test_what_is_new_is_kept_with_the_weight_of_its_noise():
    found = seen([(1.0, 2.0), (3.0, 1.0)], 0.02, 7)
    assert len(found) == 2
    np.testing.assert_allclose(found.weights, 0.25)
    assert (found.counts.tolist(), found.last_seen.tolist()) == ([1, 1], [7, 7])


def test_a_landmark_seen_again_moves_to_the_weighted_mean():
    found = seen([(1.04, 2.0)], 0.01, 2, seen([(1.0, 2.0)], 0.02))
    np.testing.assert_allclose(found.points, [(1.032, 2.0)])
    np.testing.assert_allclose(found.weights, 1.25)
    assert (found.counts.tolist(), found.last_seen.tolist()) == ([2], [2])


def test_two_points_near_one_landmark_do_not_make_another():
    found = seen([(1.02, 2.0), (1.1, 2.0)], 0.02, 2, seen([(1.0, 2.0)], 0.02))
    assert len(found) == 1
    assert found.counts.tolist() == [2]


def test_what_was_seen_once_and_never_again_goes_and_what_is_trusted_stays():
    found = seen([(0.0, 0.0)], 0.02)
    for update in range(2, 2 + SETTINGS.trusted_count):
        found = seen([(0.0, 0.0)], 0.02, update, found)
    found = seen([(5.0, 5.0)], 0.02, 20, found)
    assert len(found) == 2
    later = seen([], 0.02, 20 + SETTINGS.trial_updates, found)
    np.testing.assert_allclose(later.points, [(0.0, 0.0)])


def test_weights_have_a_limit():
    found = seen([(0.0, 0.0)], 1e-4)
    for update in range(2, 6):
        found = seen([(0.0, 0.0)], 1e-4, update, found)
    assert found.weights[0] == SETTINGS.most_weight


def test_landmarks_of_two_maps_are_joined_where_they_are_near():
    first, second = seen([(0.0, 0.0), (4.0, 0.0)], 0.01), seen([(0.1, 0.0), (9.0, 9.0)], 0.01, 3)
    joined = first.joined(second, 0.2, 50.0)
    np.testing.assert_allclose(joined.points, [(0.05, 0.0), (4.0, 0.0), (9.0, 9.0)])
    assert joined.counts.tolist() == [2, 1, 1]
    assert joined.last_seen.tolist() == [3, 1, 3]


def test_landmarks_move_with_their_frame_and_are_cut_to_a_square():
    found = seen([(1.0, 0.0), (0.0, 3.0)], 0.01).moved(Transform(0.0, 0.0, np.pi / 2.0))
    np.testing.assert_allclose(found.points, [(0.0, 1.0), (-3.0, 0.0)], atol=1e-12)
    np.testing.assert_allclose(found.within(2.0).points, [(0.0, 1.0)], atol=1e-12)
    assert len(no_landmarks().within(2.0)) == 0
