"""Matched scans are kept with their nodes, and their map is rendered from there."""

import numpy as np
from driven_rooms import GEOMETRY, cast, odd_room

from lidarium.mapping.geometry.rigid import composed
from lidarium.mapping.localization.slam.scan_history import ScanHistory

NODES = np.array([(0.0, 0.0, 0.0), (2.0, 1.0, 0.5)])
PLACES = ((0, (1.0, 1.5, 0.2)), (1, (0.5, 0.3, 1.0)), (1, (1.0, 0.2, -0.4)))


def filled():
    history = ScanHistory(GEOMETRY, 0.05)
    for k, (node, place) in enumerate(PLACES):
        pose = np.array(place)
        history.append(node, pose, cast(odd_room(), composed(NODES[node], pose)), 0.5 * k)
    return history


def test_scans_lie_where_their_nodes_are():
    scans = filled().scans(NODES)
    for pose, (node, place) in zip(scans.poses, PLACES, strict=True):
        np.testing.assert_allclose(pose, composed(NODES[node], np.array(place)))
    assert scans.times_s.tolist() == [0.0, 0.5, 1.0]
    assert scans.ranges.dtype == np.float32
    moved = filled().scans(NODES + np.array([(0.0, 0.0, 0.0), (0.1, 0.0, 0.0)]))
    np.testing.assert_allclose(moved.poses - scans.poses, [(0, 0, 0), (0.1, 0, 0), (0.1, 0, 0)], atol=1e-12)


def test_scans_since_a_node_are_those_taken_at_it_or_after():
    assert filled().since(0).tolist() == [0, 1, 2]
    assert filled().since(1).tolist() == [1, 2]
    assert filled().since(2).tolist() == []


def test_the_map_grows_by_new_scans_and_is_the_same_as_of_all_at_once():
    gradual = ScanHistory(GEOMETRY, 0.05)
    for k, (node, place) in enumerate(PLACES):
        pose = np.array(place)
        gradual.append(node, pose, cast(odd_room(), composed(NODES[node], pose)), 0.5 * k)
        gradual.map(NODES)
    at_once = filled().map(NODES)
    np.testing.assert_array_equal(gradual.map(NODES).log_odds, at_once.log_odds)
    assert gradual.map(NODES).log_odds.max() > 0.0


def test_the_map_is_rendered_again_only_once_it_is_discarded():
    history, moved = filled(), NODES + np.array([(0.0, 0.0, 0.0), (0.4, 0.3, 0.2)])
    before = history.map(NODES).log_odds.copy()
    np.testing.assert_array_equal(history.map(moved).log_odds, before)
    history.discard_map()
    again = history.map(moved).log_odds
    assert again.shape != before.shape or (again != before).any()
    np.testing.assert_array_equal(again, filled().map(moved).log_odds)
