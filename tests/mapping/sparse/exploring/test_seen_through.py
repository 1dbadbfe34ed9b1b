"""Boxes are gone where an image shows what is behind all of them."""

import numpy as np
import pytest

from lidarium.mapping.sparse.exploring.seen_through import are_seen_through
from tests.ground_views import depth_image, looking

CAMERA = looking(pitch=0.2, columns=320, rows=240)
WALL = [[3.5, -3.0, 0.0], [3.7, 3.0, 2.0]]
ROBOT = (0.0, 0.0, 0.0)


def judged(boxes, standing, camera=CAMERA, range_m=4.0):
    depth = depth_image(camera, ROBOT, [WALL, *standing])
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
