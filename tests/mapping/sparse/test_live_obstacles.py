"""A frame shows what has come upon a place; the graph goes around it until it is gone."""

import numpy as np
import pytest
from furnished_room import box_points, pose_at, room_points, seen_from

from lidarium.mapping.sparse.graph.obstacles import ChangingGraph
from lidarium.mapping.sparse.graph.topological_graph import build_graph
from lidarium.mapping.sparse.live_obstacles import live_obstacles
from lidarium.mapping.sparse.mapper.full import map_cloud
from lidarium.mapping.sparse.planning.requests import plan
from lidarium.mapping.sparse.swept_body import SweptBody

BODY = SweptBody(radius=0.25, height=1.2)
CRATE = np.array([[0.6, 1.7, 0.0], [1.1, 2.2, 0.6]])


@pytest.fixture(scope="module")
def room():
    return map_cloud(room_points(0.03), 700)


@pytest.fixture(scope="module")
def pose():
    return pose_at(0.85, 0.4, 1.0, yaw=np.pi / 2.0, pitch=0.5)


def frame(pose, crate):
    points = room_points(0.02, 0.002)
    if crate:
        points = np.concatenate([points, box_points(*CRATE, 0.02)])
    return seen_from(points, pose, half_angle=0.9)


def test_nothing_is_new_where_nothing_has_changed(room, pose):
    assert live_obstacles(room, frame(pose, False), pose).shape == (0, 2, 3)


def test_a_crate_is_boxed_and_paths_go_around_it_until_it_is_gone(room, pose):
    boxes = live_obstacles(room, frame(pose, True), pose)
    assert len(boxes) > 0
    assert (boxes[:, 0].min(axis=0)[:2] >= CRATE[0, :2] - 0.05).all()
    assert (boxes[:, 1].max(axis=0)[:2] <= CRATE[1, :2] + 0.05).all()
    base = build_graph(room.free, room.boxes, BODY)
    changing, ends = ChangingGraph(base), (np.array([0.85, 1.0]), np.array([0.85, 3.2]))
    before = plan(base, *ends)
    numbers = changing.insert_all(boxes)
    around = plan(changing.graph, *ends)
    assert before.is_found
    assert not around.is_found or around.length > before.length + 0.02
    assert plan(changing.graph, CRATE.mean(axis=0)[:2], ends[1]).reason == "start in collision"
    changing.remove_all(numbers)
    assert changing.graph.weights.tobytes() == base.weights.tobytes()
    assert np.array_equal(plan(changing.graph, *ends).path, before.path)


def test_of_several_obstacles_all_are_put_there_or_none(room):
    base = build_graph(room.free, room.boxes, BODY)
    changing = ChangingGraph(base)
    with pytest.raises(ValueError, match="box is"):
        changing.insert_all([CRATE, np.full((2, 3), np.nan)])
    assert changing.obstacles == {}
    numbers = changing.insert_all([CRATE, CRATE + 1.0])
    with pytest.raises(ValueError, match="no obstacle 99"):
        changing.remove_all([numbers[0], 99])
    assert len(changing.obstacles) == 2
    changing.remove_all(numbers)
    assert changing.graph.weights.tobytes() == base.weights.tobytes()


def test_frames_without_points_are_refused(room, pose):
    with pytest.raises(ValueError, match="no points"):
        live_obstacles(room, np.empty((0, 3)), pose)
