"""Two local maps grow at a time, and hand over to each other."""

import math

import numpy as np
import pytest
from driven_rooms import GEOMETRY, cast, odd_room
from mapped_room import ORIGIN, points_of

from lidarium.mapping.geometry.rigid import composed
from lidarium.mapping.localization.matching.local_mapping import LocalMapper, way
from lidarium.mapping.localization.matching.settings.matching import SubmapSettings
from lidarium.mapping.localization.matching.settings.slam import SlamSettings

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
