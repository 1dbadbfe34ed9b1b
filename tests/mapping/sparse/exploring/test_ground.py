"""Pixels of a depth camera that show the ground."""

import math

import numpy as np
import pytest

from lidarium.mapping.sparse.exploring.ground import (
    BLOCKED,
    SEEN,
    UNKNOWN,
    SeenGround,
    _ground_pixels,
    are_seen_through,
    ground_map,
    joined_ground,
)
from lidarium.mapping.sparse.swept_body import SweptBody
from tests.ground_views import depth_image, looking

WALL = np.array([[[2.0, -3.0, 0.0], [2.2, 3.0, 2.0]]])


def test_the_camera_knows_between_which_distances_it_sees_the_ground():
    camera = looking(pitch=0.0, rows=60)
    lowest = math.atan(29.5 / camera.intrinsics.fy)
    assert camera.nearest_m == pytest.approx(0.5 / math.tan(lowest))
    assert camera.farthest_m == pytest.approx(math.sqrt(4.0**2 - 0.5**2))
    assert looking(pitch=1.2).farthest_m == pytest.approx(0.5 / math.tan(1.2 - lowest))
    assert looking(pitch=0.3, pan=0.7).bearing == pytest.approx(0.7)
    assert camera.half_angle == pytest.approx(math.radians(29.0))


def test_a_camera_that_sees_no_ground_is_refused_with_the_cure():
    with pytest.raises(ValueError, match=r"sees the ground only from inf m on.*a larger pitch"):
        looking(pitch=-0.6)
    with pytest.raises(ValueError, match=r"at a height of 2 m .* beyond its range of 2\.5 m"):
        looking(pitch=0.0, height=2.0, range_m=2.5)


def test_pixels_show_ground_where_their_points_lie_on_it_within_range():
    camera = looking()
    depth = depth_image(camera, (0.0, 0.0, 0.0), WALL)
    shown = _ground_pixels(depth, camera.numbers)
    pinhole = camera.intrinsics
    for row, column in np.argwhere(depth > 0.0)[::37]:
        point = depth[row, column] * np.array(
            [(column - pinhole.cx) / pinhole.fx, (row - pinhole.cy) / pinhole.fy, 1.0]
        )
        height = (camera.pose[:3, :3] @ point + camera.pose[:3, 3])[2]
        is_ground = abs(height) < 1e-3 and np.linalg.norm(point) <= 4.0
        assert shown[row, column] == is_ground or (0.0 < height < 0.05)
    assert shown.any()
    assert not _ground_pixels(np.zeros_like(depth), camera.numbers).any()


CAMERA = looking(pitch=0.2, columns=320, rows=240)
WALL_OF_SEEN_THROUGH = [[3.5, -3.0, 0.0], [3.7, 3.0, 2.0]]
ROBOT = (0.0, 0.0, 0.0)


def judged(boxes, standing, camera=CAMERA, range_m=4.0):
    depth = depth_image(camera, ROBOT, [WALL_OF_SEEN_THROUGH, *standing])
    return are_seen_through(np.array(boxes, float), depth, camera.intrinsics, camera.pose, range_m).tolist()


def box(x, y=0.0, z=0.3, side=0.1):
    half = 0.5 * side
    return [[x - half, y - half, z - half], [x + half, y + half, z + half]]


def test_a_box_that_is_no_longer_there_is_gone_and_one_that_stands_is_not():
    boxes = [box(2.0, -0.4), box(2.0, 0.4)]
    assert judged(boxes, [boxes[0]]) == [False, True]
    assert judged(boxes, []) == [True, True]
    assert judged(boxes, boxes) == [False, False]


def test_the_wall_itself_stays():
    assert judged([[[3.5, -0.3, 0.1], [3.52, 0.3, 0.5]]], []) == [False]


@pytest.mark.parametrize(
    "hidden",
    [box(2.0, 5.0), box(-2.0), box(2.0, 0.0, 3.0), box(3.45), box(0.02, 0.0, 0.5)],
    ids=["beside the image", "behind", "above", "hardly before the wall", "at the camera"],
)
def test_a_box_is_kept_where_the_image_cannot_show_that_it_is_gone(hidden):
    assert judged([hidden], []) == [False]


def test_a_box_is_kept_where_part_of_it_may_stand_or_something_hides_it():
    wide = [[2.0, -0.5, 0.2], [2.1, 0.5, 0.4]]
    assert judged([wide], [box(2.05, 0.45, 0.3, 0.1)]) == [False]
    assert judged([box(2.5)], [box(1.5, 0.0, 0.35, 0.3)]) == [False]
    assert judged([box(2.0)], [box(2.0, 0.08)]) == [False], "something stands right beside it"


def test_boxes_out_of_range_and_pixels_without_measurement_say_nothing():
    assert judged([box(2.0)], [], range_m=1.5) == [False]
    nothing = np.zeros(CAMERA.shape, np.float32)
    one = np.array([box(2.0)])
    assert not are_seen_through(one, nothing, CAMERA.intrinsics, CAMERA.pose, 4.0).any()
    assert len(are_seen_through(np.empty((0, 2, 3)), nothing, CAMERA.intrinsics, CAMERA.pose, 4.0)) == 0


def test_a_coarse_image_does_not_show_that_a_thin_leg_far_away_is_gone():
    coarse = looking(pitch=0.2, columns=40, rows=30)
    leg = box(3.0, 0.0, 0.3, 0.03)
    assert judged([leg], [], coarse) == [False]
    assert judged([box(3.0, 0.0, 0.3, 0.4)], [], coarse) == [True]
    assert judged([leg], [], CAMERA) == [True]


def seen_at(ground, x, y):
    column, row = np.floor(np.array([x, y]) / ground.cell_m).astype(int) - ground.low
    return bool(ground.cells[row, column])


def test_a_coarse_image_leaves_no_gaps():
    ground = SeenGround(looking(columns=16, rows=24), 0.2)
    ground.add(np.zeros(3), depth_image(ground.camera, (0.0, 0.0, 0.0)))
    for x in np.arange(1.05, 2.5, 0.1):
        assert all(seen_at(ground, x, y) for y in np.arange(-0.35, 0.4, 0.1))


def test_ground_behind_a_wall_is_not_seen_and_that_before_it_is():
    camera = looking(columns=320, rows=240, shortfall_m=0.04)
    ground = SeenGround(camera, 0.2)
    ground.add(np.zeros(3), depth_image(camera, (0.0, 0.0, 0.0), WALL))
    assert seen_at(ground, 1.75, 0.05)
    assert seen_at(ground, 1.85, 0.45)
    assert not any(seen_at(ground, x, y) for x in (2.15, 2.25, 2.45, 3.0) for y in (-0.45, 0.05, 0.45))
    assert not seen_at(ground, -1.0, 0.0)
    assert not seen_at(ground, 0.35, 0.0), "below the image"
    assert seen_at(ground, 0.05, 0.05), "below the body"


def test_ground_is_seen_where_the_robot_believes_to_be():
    camera, pose = looking(), np.array([3.2, -1.4, 2.0])
    here, there = SeenGround(camera, 0.2), SeenGround(camera, 0.2)
    depth = depth_image(camera, (0.0, 0.0, 0.0))
    here.add(np.zeros(3), depth)
    there.add(pose, depth)
    places = [(1.5, 0.0), (2.0, 0.6), (2.5, -0.5), (3.5, 1.0), (0.0, 0.0)]
    for x, y in places:
        c, s = math.cos(pose[2]), math.sin(pose[2])
        assert seen_at(here, x, y)
        assert seen_at(there, pose[0] + c * x - s * y, pose[1] + s * x + c * y)
    assert abs(int(here.cells.sum()) - int(there.cells.sum())) < 0.05 * here.cells.sum()


def test_ground_drawn_again_at_the_same_poses_is_the_same_ground():
    camera, ground = looking(), SeenGround(looking(), 0.2)
    poses = np.array([[0.0, 0.0, 0.0], [0.5, 0.1, 0.4], [-3.0, 9.0, 2.5]])
    for pose in poses:
        ground.add(pose, depth_image(camera, pose, WALL))
    cells, low = ground.cells.copy(), ground.low.copy()
    ground.move(poses)
    both = np.zeros_like(cells)
    column, row = ground.low - low
    both[row : row + ground.cells.shape[0], column : column + ground.cells.shape[1]] = ground.cells
    assert np.array_equal(both, cells)
    ground.move(poses + np.array([1.0, 0.0, 0.0]))
    assert int(ground.cells.sum()) == int(cells.sum())
    with pytest.raises(ValueError, match=r"poses have shape \(2, 3\); want \(3, 3\)"):
        ground.move(poses[:2])


def test_the_ground_of_several_is_what_any_of_them_has_seen():
    camera = looking()
    one, other = SeenGround(camera, 0.2), SeenGround(camera, 0.2)
    one.add(np.zeros(3), depth_image(camera, (0.0, 0.0, 0.0)))
    other.add(np.array([6.0, -2.0, 3.0]), depth_image(camera, (6.0, -2.0, 3.0)))
    cells, low = joined_ground([one, SeenGround(camera, 0.2), other])
    for ground in (one, other):
        for row, column in np.argwhere(ground.cells):
            x, y = ground.low + np.array([column, row]) - low
            assert cells[y, x]
    assert cells.sum() <= one.cells.sum() + other.cells.sum()
    assert joined_ground([])[0].shape == (1, 1)


BODY = SweptBody(radius=0.2, height=0.6)


def test_a_map_of_the_ground_says_what_is_taken_up_and_what_a_body_passes_below():
    cells = np.zeros((20, 30), np.bool_)
    cells[:, 10:] = True
    table = np.array([[[0.6, 0.0, 0.7], [1.2, 1.0, 0.74]]])
    low = ground_map(cells, (0.0, 0.0), 0.1, np.concatenate([WALL, table]), BODY)
    high = ground_map(cells, (0.0, 0.0), 0.1, table, SweptBody(radius=0.2, height=1.2))
    assert (low.levels[:, 20:22] == BLOCKED).all()
    assert (low.levels[:, 12:19] == SEEN).all()
    assert (low.levels[:, :10] == UNKNOWN).all()
    assert (high.levels[:10, 6:12] == BLOCKED).all()
    assert low.seen_m2 == pytest.approx(0.01 * np.count_nonzero(low.levels == SEEN))
    assert low.are_unknown(np.array([[0.5, 0.5], [1.5, 0.5], [2.1, 0.5], [99.0, 0.0]])).tolist() == [
        True,
        False,
        False,
        True,
    ]


def test_frontiers_are_where_seen_ground_borders_on_unknown_cells():
    cells = np.zeros((20, 20), np.bool_)
    cells[5:15, 5:15] = True
    known = ground_map(cells, (0.0, 0.0), 0.1, np.array([[[0.5, 0.5, 0.0], [0.6, 1.5, 1.0]]]), BODY)
    clusters = known.frontiers(0.3)
    assert len(clusters) == 1
    # Three sides of ten cells are open; corners belong to two of them.
    assert len(clusters.cells) == 9 + 9 + 8
    assert not len(known.frontiers(10.0))
    assert known.centres(np.array([[0, 3]]))[0] == pytest.approx([0.35, 0.05])
