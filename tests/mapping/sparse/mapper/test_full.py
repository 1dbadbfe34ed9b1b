"""Maps of whole clouds: every point in a box, the floor free."""

import numpy as np
import pytest
from furnished_room import TABLE_TOP, furniture, room_points

from lidarium.mapping.sparse.floor_plane import FloorPlane
from lidarium.mapping.sparse.mapper.frame_coding import split_points
from lidarium.mapping.sparse.mapper.full import map_cloud
from lidarium.mapping.sparse.mapper.merging import are_covered
from lidarium.mapping.sparse.settings import FloorSettings, MapperSettings
from lidarium.mapping.sparse.swept_body import SweptBody, are_free, index_boxes

ROOM = room_points(0.04, noise=0.004)


@pytest.fixture(scope="module")
def room_map():
    return map_cloud(ROOM, 256)


def test_every_occupied_point_lies_in_a_box(room_map):
    obstacles, _ = split_points(ROOM, room_map.floor, room_map.settings)
    assert len(obstacles) > 10_000
    assert are_covered(obstacles, room_map.boxes).all()


def test_the_ceiling_and_what_is_below_the_floor_are_cut_off():
    deep = np.concatenate([ROOM, [[2.0, 2.0, -0.3]], [[2.0, 2.0, 1.6]]])
    found = map_cloud(deep, 128)
    assert found.boxes[:, 1, 2].max() <= found.settings.ceiling_m + 0.01
    assert found.boxes[:, 0, 2].min() > 0.0
    assert (np.abs(found.free[:, 2]) < 0.11).all()


def test_codes_lie_in_their_boxes_with_unit_normals(room_map):
    codes = room_map.occupied
    assert ((codes.centres >= codes.boxes[:, 0]) & (codes.centres <= codes.boxes[:, 1])).all()
    lengths = np.linalg.norm(codes.normals, axis=1)
    assert (np.isclose(lengths, 1.0) | (lengths == 0.0)).all()
    assert codes.weights.sum() == len(split_points(ROOM, room_map.floor, room_map.settings)[0])


def test_free_codes_lie_on_the_floor_apart_from_each_other(room_map):
    free = room_map.free
    gaps = np.linalg.norm(free[:, None] - free[None], axis=2) + np.eye(len(free))
    assert gaps.min() > 0.5 * room_map.settings.merge_radius_m
    assert np.abs(room_map.floor.heights(free)).max() < 0.05


def test_the_table_top_is_in_the_way_and_open_floor_is_not(room_map):
    index, body = index_boxes(room_map.boxes), SweptBody(radius=0.25, height=1.2)
    middle = np.append(TABLE_TOP[:, :2].mean(axis=0), 0.0)[None]
    assert not are_free(index, middle, middle, body.numbers)[0]
    low = SweptBody(radius=0.25, height=0.5)
    assert are_free(index, middle, middle, low.numbers)[0]


def test_truly_free_places_stay_free(room_map):
    index, body = index_boxes(room_map.boxes), SweptBody(radius=0.25, height=1.2)
    places = np.random.default_rng(0).uniform([0.4, 0.4], [4.6, 3.6], (1000, 2))
    things = furniture()
    gaps = np.maximum(np.maximum(things[:, 0, :2] - places[:, None], places[:, None] - things[:, 1, :2]), 0.0)
    clear = places[np.linalg.norm(gaps, axis=2).min(axis=1) > 0.35]
    clear = np.column_stack([clear, np.zeros(len(clear))])
    assert are_free(index, clear, clear, body.numbers).mean() > 0.95


def test_the_same_seed_gives_the_same_map():
    first, second = map_cloud(ROOM, 64), map_cloud(ROOM, 64)
    np.testing.assert_array_equal(first.boxes, second.boxes)
    np.testing.assert_array_equal(first.free, second.free)
    other = map_cloud(ROOM, 64, MapperSettings(seed=1))
    assert not np.array_equal(first.free, other.free)


def test_codes_that_are_not_merged_all_stay(room_map):
    found = map_cloud(ROOM, 256, MapperSettings(merges=False))
    assert len(found.occupied) == 179
    assert len(room_map.occupied) < 60


def test_the_thesis_has_codes_as_points_split_by_their_own_height():
    settings = MapperSettings(mode="thesis")
    found = map_cloud(ROOM, 128, settings)
    np.testing.assert_array_equal(found.boxes[:, 0], found.boxes[:, 1])
    assert (found.floor.heights(found.centres) > settings.floor_height_m).all()
    assert (found.floor.heights(found.free) <= settings.floor_height_m).all()
    # The ceiling has codes as well; they are cut off.
    assert 64 < len(found.occupied) + len(found.ground) < 128


@pytest.mark.parametrize("split", ["normal", "both"])
def test_floor_by_normals_keeps_every_point_in_a_box(split):
    found = map_cloud(ROOM[::3], 128, MapperSettings(split=split))
    obstacles, on_floor = split_points(ROOM[::3], found.floor, found.settings)
    assert are_covered(obstacles, found.boxes).all()
    assert len(on_floor) > 1000
    assert (np.abs(on_floor[:, 2]) < 0.11).mean() > 0.95


def test_a_cloud_that_leans_is_mapped_where_it_was_levelled():
    angle = np.radians(20.0)
    lean = np.array([[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]])
    leaning = ROOM @ lean.T
    from lidarium.mapping.sparse.floor_plane import find_floor

    settings = FloorSettings(most_tilt=np.radians(40.0))
    pose = find_floor(leaning, settings).levelling()
    found = map_cloud(leaning, 128, pose=pose)
    assert found.floor.tilt < np.radians(0.2)
    np.testing.assert_array_equal(found.poses[0], pose)
    assert np.abs(found.free[:, 2]).max() < 0.05


@pytest.mark.parametrize(
    ("points", "k", "message"),
    [
        (np.empty((0, 3)), 16, "no points"),
        (np.full((9, 3), np.nan), 16, "finite"),
        (ROOM * 1000.0, 16, "millimetres"),
        (ROOM[ROOM[:, 0] < 0.01] + [0.0, 0.0, 0.0], 16, "no floor"),
        (np.ones((50, 3)), 16, "no floor"),
        (ROOM, 1, "k is 1"),
    ],
)
def test_a_cloud_that_cannot_be_mapped_is_refused(points, k, message):
    with pytest.raises(ValueError, match=message):
        map_cloud(points, k)


def test_fewer_points_than_codes_give_a_code_for_each():
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    found = map_cloud(points, 64, floor=FloorPlane())
    assert len(found.ground) == 3
    assert found.boxes.tolist() == [[[0, 0, 1], [0, 0, 1]]]


def test_a_cloud_of_nothing_but_floor_has_no_boxes():
    floor = ROOM[np.abs(ROOM[:, 2]) < 0.02]
    found = map_cloud(floor, 32)
    assert len(found.occupied) == 0
    assert len(found.ground) > 5
