"""The path as a graph of nodes, with local maps and closures on it."""

import math
from dataclasses import replace

import numpy as np
import pytest
from driven_rooms import GEOMETRY, cast, odd_room, through

from lidarium.mapping.geometry.rigid import composed, relative
from lidarium.mapping.localization.matching.local_mapping import way
from lidarium.mapping.localization.matching.settings.matching import SubmapSettings
from lidarium.mapping.localization.matching.settings.slam import SlamSettings
from lidarium.mapping.localization.slam.mapped_path import MappedPath

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
    assert frame == pytest.approx(
        relative(POSES[0], composed(POSES[-1], relative(path.local, np.zeros(3)))), abs=1e-6
    )


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
