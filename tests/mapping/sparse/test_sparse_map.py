"""Codes move with their frames."""

import numpy as np
import pytest
from furnished_room import pose_at

from lidarium.mapping.sparse.sparse_map import SparseMap, free_codes, occupied_codes

BOX = np.array([[[1.0, 0.0, 0.0], [2.0, 0.2, 1.0]]])


def two_frames():
    first = occupied_codes(BOX, 0)
    second = occupied_codes(BOX + np.array([0.0, 3.0, 0.0]), 1)
    poses = np.stack([np.eye(4), pose_at(0.0, 3.0)])
    return SparseMap(
        occupied=first.joined(second),
        ground=free_codes(np.zeros((1, 3)), 1),
        poses=poses,
        recorded=poses,
    )


def test_a_corrected_pose_moves_the_codes_of_its_frame_alone():
    known = two_frames()
    poses = known.poses.copy()
    poses[1, :3, 3] += [0.5, 0.0, 0.0]
    moved = known.moved(poses)
    np.testing.assert_array_equal(moved.boxes[0], BOX[0])
    np.testing.assert_allclose(moved.boxes[1], BOX[0] + [0.5, 3.0, 0.0])
    np.testing.assert_allclose(moved.free, [[0.5, 0.0, 0.0]], atol=1e-12)


def test_a_turned_box_becomes_the_one_around_its_corners():
    known = two_frames()
    moved = known.moved(np.stack([pose_at(0.0, 0.0, 0.0, yaw=np.pi / 2.0), known.poses[1]]))
    np.testing.assert_allclose(moved.boxes[0], [[-0.2, 1.0, 0.0], [0.0, 2.0, 1.0]], atol=1e-12)


def test_corrections_do_not_add_up():
    known = two_frames()
    moved = known
    for turn in np.linspace(0.0, 3.0, 20):
        moved = moved.moved(np.stack([pose_at(turn, 0.0, 0.0, yaw=turn), known.poses[1]]))
    back = moved.moved(known.poses)
    np.testing.assert_array_equal(back.boxes, known.boxes)


def test_normals_turn_with_their_frame():
    known = two_frames()
    known.occupied.normals[0] = [1.0, 0.0, 0.0]
    moved = known.moved(np.stack([pose_at(0.0, 0.0, 0.0, yaw=np.pi / 2.0), known.poses[1]]))
    np.testing.assert_allclose(moved.normals[0], [0.0, 1.0, 0.0], atol=1e-12)


def test_codes_of_unknown_frames_are_refused():
    with pytest.raises(ValueError, match="frames up to 1"):
        SparseMap(occupied=occupied_codes(BOX, 1), ground=free_codes(np.empty((0, 3))))
    with pytest.raises(ValueError, match="poses have shape"):
        two_frames().moved(np.eye(4)[None])


def test_boxes_have_their_low_corner_first():
    with pytest.raises(ValueError, match="low before high"):
        occupied_codes(BOX[:, ::-1])
