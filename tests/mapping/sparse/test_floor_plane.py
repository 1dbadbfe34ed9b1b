"""The plane of a floor."""

import math

import numpy as np
import pytest
from furnished_room import box_points, pose_at, room_points, seen_from

from lidarium.mapping.geometry.rigid_motions import checked_poses, moved_points
from lidarium.mapping.sparse.floor_plane import FloorPlane, find_floor
from lidarium.mapping.sparse.settings import FloorSettings


@pytest.mark.parametrize("plane", [FloorPlane(0.6, 0.0, 0.8, 1.5), FloorPlane(0.0, -1.0, 0.0, 2.0)])
def test_levelling_makes_the_floor_level(plane):
    points = np.random.default_rng(0).uniform(-3.0, 3.0, (20, 3))
    np.testing.assert_allclose(moved_points(points, plane.levelling())[:, 2], plane.heights(points), atol=1e-12)
    checked_poses(plane.levelling())
    checked_poses(FloorPlane(0.0, 0.0, -1.0, 0.0).levelling())


def test_a_floor_has_a_unit_normal():
    with pytest.raises(ValueError, match="unit normal"):
        FloorPlane(0.0, 0.0, 2.0, 0.0)


ROOM = room_points(0.05)


def test_the_floor_of_a_room_is_neither_its_ceiling_nor_a_table():
    floor = find_floor(ROOM + np.array([0.0, 0.0, 0.37]))
    assert abs(floor.offset + 0.37) < 0.005
    assert floor.tilt < math.radians(0.1)


def test_the_floor_is_found_with_a_camera_that_looks_down():
    pose = pose_at(0.8, 1.0, 1.1, yaw=0.5, pitch=math.radians(30.0))
    seen = seen_from(room_points(0.04, noise=0.005), pose, half_angle=0.8)
    floor = find_floor(seen, FloorSettings(most_tilt=math.radians(45.0)))
    assert floor.tilt == pytest.approx(math.radians(30.0), abs=math.radians(0.5))
    assert floor.offset == pytest.approx(1.1, abs=0.01)
    level = moved_points(seen, floor.levelling())
    assert (np.abs(level[:, 2]) < 0.02).sum() > 100


def test_the_floor_of_a_cloud_with_another_way_up():
    turned = ROOM[:, [0, 2, 1]] * [1.0, -1.0, 1.0]
    floor = find_floor(turned, FloorSettings(up_y=-1, up_z=0))
    np.testing.assert_allclose(floor.normal, [0.0, -1.0, 0.0], atol=0.01)


def test_the_same_seed_finds_the_same_floor():
    noisy = room_points(0.05, noise=0.01)
    assert find_floor(noisy, seed=3) == find_floor(noisy, seed=3)


@pytest.mark.parametrize(
    "points",
    [
        box_points((0, 0, 0.2), (4, 0, 2), 0.05),
        np.random.default_rng(0).normal(0.0, 1.0, (3000, 3)),
        np.zeros((2, 3)),
        np.zeros((100, 3)),
    ],
)
def test_a_cloud_without_a_floor_is_refused(points):
    with pytest.raises(ValueError, match="no floor"):
        find_floor(points, FloorSettings(least_share=0.1))
