"""The path as a graph of nodes, with local maps and closures on it."""

import math
from dataclasses import replace

import numpy as np
import pytest
from driven_rooms import GEOMETRY, cast, odd_room, through
from mapped_room import ORIGIN, odd_room_submap

from lidarium.mapping.geometry.rigid import composed, relative
from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.localization.graph.node_graph import NodeGraph
from lidarium.mapping.localization.matching.local_mapping import Finished, way
from lidarium.mapping.localization.matching.scan_points import scan_points
from lidarium.mapping.localization.settings import ClosureSettings, SlamSettings, SubmapSettings
from lidarium.mapping.localization.slam.mapped_path import (
    MappedPath,
    _LoopClosing,
    _ScanHistory,
    _ScanSampling,
    _WallSurvey,
)

SETTINGS = SlamSettings(submaps=SubmapSettings(resolution=0.05, path_m=3.0, least_scans=6))
SMALL = np.diag([1e-6, 1e-6, 1e-7])
POSES = through([(1.0, 1.0), (4.0, 1.0), (4.0, 2.4), (1.5, 2.4), (1.0, 1.0)], speed=0.5, turn_rate=1.0)


def led(poses=POSES, settings=SETTINGS, start=(0.0, 0.0, 0.0)):
    """A path led by true motions, and after each scan its pose, node and place in that."""
    path = MappedPath(settings, GEOMETRY, np.array(start))
    path.begin(cast(odd_room(), poses[0]), SMALL, 0.0)
    found = [(path.pose, *path.place)]
    frame = path.local * 0.0
    for k in range(1, len(poses)):
        pose = composed(path.local, relative(poses[k - 1], poses[k]))
        ranges = cast(odd_room(), poses[k])
        change = path.take(pose, SMALL, ranges, path.sampling.all_points(ranges), 0.2 * k)
        frame = frame if change is None else composed(frame, change)
        path.correct(0.2 * k)
        found.append((path.pose, *path.place))
    return path, found, frame


@pytest.fixture(scope="module")
def round_trip():
    return led()


def test_poses_are_those_of_the_motions_that_led_there(round_trip):
    _, found, _ = round_trip
    truth = relative(np.broadcast_to(POSES[0], POSES.shape), POSES)
    poses = np.array([pose for pose, _, _ in found])
    assert np.abs(poses - truth)[:, :2].max() < 0.03
    # The pose says the same as the node and the place in it.
    path = round_trip[0]
    _, node, place = found[-1]
    assert composed(path.nodes[node], place) == pytest.approx(path.pose)


def test_the_length_counts_turns_and_nodes_lie_no_farther_apart_than_is_set(round_trip):
    path, found, _ = round_trip
    steps = [way(relative(POSES[k - 1], POSES[k])) for k in range(1, len(POSES))]
    assert path.length == pytest.approx(sum(steps))
    gaps = relative(path.nodes[:-1], path.nodes[1:])
    assert np.hypot(gaps[:, 0], gaps[:, 1]).max() < SETTINGS.graph.distance_m + 0.15
    assert [node for _, node, _ in found] == sorted(node for _, node, _ in found)


def test_frames_of_local_maps_follow_each_other(round_trip):
    path, _, frame = round_trip
    assert path.mapper_node > 0
    assert frame == pytest.approx(relative(POSES[0], composed(POSES[-1], relative(path.local, np.zeros(3)))), abs=1e-6)


def test_every_scan_is_kept_for_the_map_where_it_is_now_believed_to_be(round_trip):
    path, found, _ = round_trip
    scans = path.key_scans
    assert len(scans.poses) == len(POSES)
    kept = np.array([composed(path.nodes[node], place) for _, node, place in found])
    gaps = relative(kept, scans.poses)
    assert np.abs(gaps).max() < 1e-9
    np.testing.assert_allclose(scans.times_s, 0.2 * np.arange(len(POSES)))


def test_uncertainty_is_none_at_the_start_and_grows():
    assert not MappedPath(SETTINGS, GEOMETRY, np.zeros(3)).covariance(np.zeros((3, 3))).any()
    traces = []
    for scans in (2, 10, 20):
        path, _, _ = led(POSES[:scans])
        covariance = path.covariance(path.spread)
        assert np.linalg.eigvalsh(covariance).min() > 0.0
        traces.append(np.trace(covariance))
    assert traces[0] < traces[1] < traces[2]


def test_a_path_begins_where_it_is_said_to():
    start = (3.0, -1.0, 2.0)
    path, found, _ = led(POSES[:12], start=start)
    truth = composed(np.array(start), relative(POSES[0], POSES[11]))
    assert found[0][0] == pytest.approx(start)
    assert path.pose == pytest.approx(truth, abs=1e-6)


def test_a_new_beginning_keeps_nodes_and_scans(round_trip):
    path, _, _ = led(POSES[:20])
    before, nodes, kept = path.pose, path.nodes, len(path.key_scans.poses)
    path.restart(cast(odd_room(), POSES[19]), SMALL, 9.0)
    assert path.local.tolist() == [0.0, 0.0, 0.0]
    assert path.pose == pytest.approx(before)
    assert path.nodes[: len(nodes)] == pytest.approx(nodes)
    assert path.last_node == len(nodes)
    assert path.mapper_node == path.last_node
    assert len(path.key_scans.poses) == kept + 1


def test_a_correction_is_handed_out_once():
    twice = np.concatenate([POSES, POSES[1:]])
    path, _, _ = led(twice, replace(SETTINGS, closures=replace(SETTINGS.closures, path_m=4.0)))
    path.correct(math.inf)
    assert path.closures > 0
    assert path.pending == 0
    assert path.corrections > 0
    first = path.take_correction()
    assert first is not None
    np.testing.assert_array_equal(first.poses, path.key_scans.poses)
    assert path.take_correction() is None


# It tells at once what it recognises, however far that would move the robot.
LOOP_CLOSING_SETTINGS = SlamSettings(closures=ClosureSettings(delay_s=2.0, confirmed_beyond_m=1.0))
TRUE, BELIEVED = np.array([0.1, 0.05, 0.02]), np.array([0.2, -0.05, 0.05])


def back_again(settings=LOOP_CLOSING_SETTINGS):
    """Loops that know the room from long ago, the nodes of a robot that comes back, and what it sees."""
    loops = _LoopClosing(settings)
    loops.remember([Finished(odd_room_submap().finished(), np.array([0]), np.zeros((1, 3)))], 0.0)
    graph = NodeGraph(settings.graph, None, np.zeros(3))
    graph.add(BELIEVED, np.diag([0.3**2, 0.3**2, math.radians(5.0) ** 2]))
    points = scan_points(
        cast(odd_room(), composed(ORIGIN, TRUE)),
        GEOMETRY.unit_vectors,
        GEOMETRY.angle_increment,
        5.6,
        0.05,
        350,
    )
    return loops, graph, points


def test_a_place_is_recognised_and_acts_once_after_the_delay():
    loops, graph, points = back_again()
    loops.find(graph, points, 50.0, 0.6, 10.0)
    assert loops.pending == 1
    assert loops.take_due(11.9) == []
    (closure,) = loops.take_due(12.0)
    assert (closure.old, closure.new) == (0, 1)
    assert closure.measured == pytest.approx(TRUE, abs=0.02)
    assert loops.pending == 0
    assert loops.take_due(99.0) == []


def test_each_closure_waits_for_its_own_time():
    loops, graph, points = back_again()
    for now in (10.0, 10.5):
        loops.find(graph, points, 50.0, 0.6, now)
    assert len(loops.take_due(12.2)) == 1
    assert loops.pending == 1
    assert len(loops.take_due(math.inf)) == 1


def test_a_local_map_of_short_ago_recognises_nothing():
    loops, graph, points = back_again()
    loops.find(graph, points, LOOP_CLOSING_SETTINGS.closures.path_m - 0.1, 0.6, 10.0)
    assert loops.pending == 0


def test_places_are_not_recognised_where_no_candidate_is_tried():
    loops, graph, points = back_again(
        replace(LOOP_CLOSING_SETTINGS, closures=replace(LOOP_CLOSING_SETTINGS.closures, candidates=0))
    )
    loops.find(graph, points, 50.0, 0.6, 10.0)
    assert loops.pending == 0


LASER = ScanGeometry()
WALL_SURVEY_SETTINGS = SlamSettings()
DUE_M = WALL_SURVEY_SETTINGS.graph.start_path_m
NODE = np.zeros((1, 3))


def box_scan(heading=0.0, half=2.0):
    """Ranges in the middle of a square room [m]."""
    angles = heading + LASER.angle_first + LASER.angle_increment * np.arange(LASER.beams)
    gaps = half / np.maximum(np.maximum(np.abs(np.cos(angles)), np.abs(np.sin(angles))), 1e-9)
    return gaps.astype(np.float32)


def with_history(*headings):
    history = _ScanHistory(LASER, 0.05)
    for time_s, heading in enumerate(headings):
        history.append(0, np.array([0.0, 0.0, heading]), box_scan(heading), float(time_s))
    return _WallSurvey(WALL_SURVEY_SETTINGS, _ScanSampling(WALL_SURVEY_SETTINGS, LASER)), history


def test_walls_are_surveyed_once_the_path_is_long_enough():
    survey, history = with_history(0.0, 0.7, 1.4)
    survey.survey(DUE_M - 0.1, 0, history, NODE)
    assert not survey.compass.is_surveyed
    survey.survey(DUE_M, 0, history, NODE)
    assert survey.compass.is_surveyed
    assert survey.compass.bearings[0].direction == pytest.approx(0.0, abs=0.01)


def test_without_scans_they_are_surveyed_again_after_as_much_of_the_path():
    survey, history = with_history()
    survey.survey(DUE_M, 0, history, NODE)
    history.append(0, np.zeros(3), box_scan(), 0.0)
    survey.survey(2.0 * DUE_M - 0.1, 0, history, NODE)
    assert not survey.compass.is_surveyed
    survey.survey(2.0 * DUE_M, 0, history, NODE)
    assert survey.compass.is_surveyed


def test_a_new_beginning_puts_the_survey_off():
    survey, history = with_history(0.0, 0.7)
    survey.restart(5.0)
    survey.survey(5.0 + DUE_M - 0.1, 0, history, NODE)
    assert not survey.compass.is_surveyed
    survey.survey(5.0 + DUE_M, 0, history, NODE)
    assert survey.compass.is_surveyed


def test_where_walls_are_not_used_nothing_is_surveyed():
    settings = SlamSettings(uses_walls=False)
    survey, (_, history) = _WallSurvey(settings, _ScanSampling(settings, LASER)), with_history(0.0)
    survey.observe(box_scan(), np.zeros(3))
    survey.restart(1.0)
    survey.survey(1e3, 0, history, NODE)
    assert survey.compass is None


NODES = np.array([(0.0, 0.0, 0.0), (2.0, 1.0, 0.5)])
PLACES = ((0, (1.0, 1.5, 0.2)), (1, (0.5, 0.3, 1.0)), (1, (1.0, 0.2, -0.4)))


def filled():
    history = _ScanHistory(GEOMETRY, 0.05)
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
    gradual = _ScanHistory(GEOMETRY, 0.05)
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


def test_samples_lie_where_beams_end():
    laser, settings = ScanGeometry(), SlamSettings()
    angles = laser.angle_first + laser.angle_increment * np.arange(laser.beams)
    half = 2.0 / np.maximum(np.abs(np.cos(angles)), np.abs(np.sin(angles)))
    ranges = half.astype(np.float32)
    points = _ScanSampling(settings, laser).all_points(ranges)
    assert np.abs(points).max(axis=1) == pytest.approx(2.0, abs=1e-3)
    few = _ScanSampling(settings, laser).points(ranges, 0.5, 10)
    assert 0 < len(few) <= 10
