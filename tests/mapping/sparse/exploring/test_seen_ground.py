"""Which ground a camera sees: what its pixels show, and no more."""

import math

import numpy as np
import pytest

from lidarium.mapping.sparse.exploring.seen_ground import SeenGround, joined_ground
from tests.ground_views import depth_image, looking

WALL = np.array([[[2.0, -3.0, 0.0], [2.2, 3.0, 2.0]]])


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
