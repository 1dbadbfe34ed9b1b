"""Maps edited by hand and joined."""

import numpy as np
import pytest
from furnished_room import pose_at, room_points

from lidarium.mapping.sparse.editing import edited, join_maps
from lidarium.mapping.sparse.mapper.full import map_cloud
from lidarium.mapping.sparse.mapper.merging import are_covered
from lidarium.mapping.sparse.sparse_map import SparseMap, free_codes, occupied_codes

WALL = np.array([[[0.0, 0.0, 0.0], [4.0, 0.2, 1.0]]])
EMPTY = free_codes(np.empty((0, 3)))


def test_an_added_box_stands_there():
    found = edited(SparseMap(occupied=occupied_codes(WALL), ground=EMPTY), add_boxes=WALL + 5.0)
    np.testing.assert_array_equal(found.boxes, np.concatenate([WALL, WALL + 5.0]))


def test_a_door_cut_into_a_wall_leaves_the_rest():
    door = np.array([[[1.0, -1.0, -1.0], [2.0, 1.0, 0.8]]])
    found = edited(SparseMap(occupied=occupied_codes(WALL), ground=EMPTY), remove_boxes=door)
    points = np.random.default_rng(0).uniform([-0.5, -0.1, -0.1], [4.5, 0.3, 1.1], (5000, 3))
    inside = are_covered(points, WALL) & ~are_covered(points, door)
    assert (are_covered(points, found.boxes) == inside).all()


def test_codes_as_points_are_removed():
    points = np.array([[0.5, 0.5, 0.5], [3.0, 3.0, 0.5]])
    codes = occupied_codes(np.stack([points, points], axis=1))
    found = edited(SparseMap(occupied=codes, ground=EMPTY), remove_boxes=np.array([[[0, 0, 0], [1, 1, 1.0]]]))
    assert found.centres.tolist() == [[3.0, 3.0, 0.5]]


def test_what_is_added_is_not_removed_again():
    found = edited(SparseMap(occupied=occupied_codes(WALL), ground=EMPTY), add_boxes=WALL, remove_boxes=WALL)
    np.testing.assert_array_equal(found.boxes, WALL)


@pytest.mark.parametrize("boxes", [np.zeros((2, 3)), WALL[:, ::-1], WALL * np.nan])
def test_what_are_no_boxes_is_refused(boxes):
    with pytest.raises(ValueError, match="remove_boxes"):
        edited(SparseMap(occupied=occupied_codes(WALL), ground=EMPTY), remove_boxes=boxes)


def test_two_halves_of_a_room_joined_are_the_room():
    room = room_points(0.05)
    motion = pose_at(1.0, 2.0, 0.0, yaw=np.pi / 2.0)
    left, right = room[room[:, 0] < 2.8], room[room[:, 0] > 2.2]
    first = map_cloud(left, 128)
    second = map_cloud((right - motion[:3, 3]) @ motion[:3, :3], 128)
    found = join_maps(first, second, motion)
    high = room[(room[:, 2] > 0.11) & (room[:, 2] < 1.45)]
    # Turned by a right angle, boxes stay as tight as they were.
    grown = found.boxes + np.array([[[-1e-9], [1e-9]]])
    assert are_covered(high, grown).all()
    assert len(found.poses) == 2
    assert len(found.occupied) <= len(first.occupied) + len(second.occupied)
    assert len(found.ground) < len(first.ground) + len(second.ground)
    assert set(found.ground.frames.tolist()) == {0, 1}
