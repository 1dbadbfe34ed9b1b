"""Maps that grow frame by frame, and stay as large as the place."""

import numpy as np
import pytest
from furnished_room import pose_at, room_points, seen_from

from lidarium.mapping.geometry.rigid_motions import moved_points
from lidarium.mapping.sparse.floor_plane import FloorPlane
from lidarium.mapping.sparse.mapper.frame_coding import split_points
from lidarium.mapping.sparse.mapper.incremental import IncrementalMapper
from lidarium.mapping.sparse.mapper.merging import are_covered
from lidarium.mapping.sparse.settings import MapperSettings


def frames(count, noise=0.004):
    for number in range(count):
        angle = 2.0 * np.pi * number / 12
        pose = pose_at(2.5 + 1.6 * np.cos(angle), 2.0 + 1.3 * np.sin(angle), 0.9, angle + 1.9 * number, 0.4)
        yield seen_from(room_points(0.04, noise, number), pose, half_angle=0.7), pose


@pytest.fixture(scope="module")
def grown():
    mapper, sizes, seen = IncrementalMapper(64, floor=FloorPlane()), [], []
    for points, pose in frames(36):
        assert mapper.add(points, pose)
        seen.append(moved_points(points, pose))
        sizes.append((len(mapper.map.occupied), len(mapper.map.ground)))
    return mapper.map, sizes, np.concatenate(seen)


def test_every_occupied_point_of_every_frame_lies_in_a_box(grown):
    found, _, seen = grown
    obstacles, _ = split_points(seen, found.floor, found.settings)
    assert len(obstacles) > 20_000
    assert are_covered(obstacles, found.boxes).all()


def test_a_place_that_is_seen_again_adds_little(grown):
    _, sizes, _ = grown
    assert sizes[-1][0] < 1.2 * sizes[11][0]
    assert sizes[-1][1] < 700


def test_boxes_stay_bounded(grown):
    found, _, _ = grown
    bounded = IncrementalMapper(64, MapperSettings(range_m=4.0, most_boxes=40), floor=FloorPlane())
    for points, pose in frames(12):
        bounded.add(points, pose)
    assert len(bounded.map.occupied) <= 40
    assert len(found.occupied) < 150


def test_a_frame_is_taken_after_half_a_metre_or_an_eighth_of_a_turn():
    mapper = IncrementalMapper(16, floor=FloorPlane())
    points = seen_from(room_points(0.05), pose_at(1.0, 1.0, pitch=0.4))
    taken = [
        mapper.add(points, pose_at(x, 1.0, yaw=np.radians(yaw), pitch=0.4))
        for x, yaw in ((1.0, 0), (1.4, 0), (1.4, 44), (1.5, 0), (1.5, 46), (1.9, 46), (1.5, 91))
    ]
    assert taken == [True, False, False, True, True, False, True]
    assert len(mapper.map.poses) == 4


def test_corrected_poses_move_what_their_frames_saw():
    mapper = IncrementalMapper(64, floor=FloorPlane())
    all_frames = list(frames(6))
    for points, pose in all_frames[:5]:
        mapper.add(points, pose)
    before = mapper.map
    shift = np.eye(4)
    shift[:3, 3] = (0.3, -0.2, 0.0)
    mapper.correct(shift @ before.poses)
    np.testing.assert_allclose(mapper.map.boxes, before.boxes + shift[:3, 3])
    points, pose = all_frames[5]
    assert mapper.add(points, shift @ pose)
    obstacles, _ = split_points(moved_points(points, shift @ pose), FloorPlane(), before.settings)
    # Boxes are moved to where they would have been recorded, then back.
    assert are_covered(obstacles, mapper.map.boxes + np.array([[[-1e-9], [1e-9]]])).all()
    assert len(mapper.map.poses) == 6


def test_the_same_frames_give_the_same_map():
    maps = []
    for _ in range(2):
        mapper = IncrementalMapper(32, floor=FloorPlane())
        for points, pose in frames(4):
            mapper.add(points, pose)
        maps.append(mapper.map)
    np.testing.assert_array_equal(maps[0].boxes, maps[1].boxes)
    np.testing.assert_array_equal(maps[0].free, maps[1].free)


def test_the_floor_is_found_in_the_first_frame():
    mapper = IncrementalMapper(64)
    points, pose = next(frames(1))
    mapper.add(points, pose)
    assert abs(mapper.map.floor.offset) < 0.01


def test_the_thesis_keeps_all_codes():
    mapper = IncrementalMapper(32, MapperSettings(mode="thesis", range_m=4.0), floor=FloorPlane())
    for points, pose in frames(5):
        mapper.add(points, pose)
    found = mapper.map
    assert 100 < len(found.occupied) + len(found.ground) <= 160
    assert set(found.occupied.frames.tolist()) == set(range(5))


@pytest.mark.parametrize(
    ("points", "pose", "message"),
    [
        (np.empty((0, 3)), np.eye(4), "no points"),
        (np.full((3, 3), 900.0), np.eye(4), "points in metres"),
        (np.ones((3, 3)), np.zeros((4, 4)), "rigid motion"),
        (np.ones((3, 3)), np.eye(4), "no floor"),
    ],
)
def test_a_frame_that_cannot_be_added_leaves_the_map_as_it_was(points, pose, message):
    mapper = IncrementalMapper(16)
    with pytest.raises(ValueError, match=message):
        mapper.add(points, pose)
    with pytest.raises(ValueError, match="no frame yet"):
        _ = mapper.map


def test_free_codes_of_different_frames_keep_apart(grown):
    found, _, _ = grown
    gaps = np.linalg.norm(found.free[:, None] - found.free[None], axis=2)
    of_others = found.ground.frames[:, None] != found.ground.frames[None]
    assert gaps[of_others].min() > found.settings.merge_radius_m


def test_what_is_forgotten_does_not_come_back_with_the_next_frame():
    x, y = np.meshgrid(np.arange(-2.0, 2.0, 0.05), np.arange(-2.0, 2.0, 0.05))
    floor = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    inside = np.random.default_rng(0).uniform((1.0, -0.2, 0.0), (1.4, 0.2, 0.6), (2000, 3))
    mapper = IncrementalMapper(128, MapperSettings(range_m=4.0), floor=FloorPlane())
    mapper.add(np.concatenate([floor, inside]), np.eye(4))
    gone = np.ones(len(mapper.map.boxes), np.bool_)
    assert gone.any()
    mapper.forget(gone)
    mapper.add(floor, pose_at(0.6, 0.0, 0.0, 0.0, 0.0))
    assert len(mapper.map.boxes) == 0
