"""What cannot be points goes, the others are gathered in voxels."""

import numpy as np
import pytest
from furnished_room import room_points
from hypothesis import given
from hypothesis import strategies as st
from scattered_points import room

from lidarium.mapping.sparse.floor_plane import FloorPlane
from lidarium.mapping.sparse.mapper.frame_coding import (
    MIN_GAIN,
    MIN_POINTS,
    _between_cuts,
    _coded,
    _is_floor,
    _surface_normals,
    code_counts,
    coded_as_points,
    coded_floor,
    coded_obstacles,
    cut_labels,
    split_points,
    usable_points,
    voxels_of,
)
from lidarium.mapping.sparse.mapper.full import map_cloud
from lidarium.mapping.sparse.mapper.merging import boxes_of
from lidarium.mapping.sparse.settings import MapperSettings


def test_far_points_and_such_as_are_not_finite_go():
    points = np.array([[1.0, 0, 0], [np.nan, 0, 0], [0, np.inf, 0], [5.0, 0, 0], [0, 0, 4.0]], np.float32)
    assert usable_points(points, 4.0).tolist() == [[1.0, 0.0, 0.0], [0.0, 0.0, 4.0]]
    assert len(usable_points(points)) == 3


@pytest.mark.parametrize(
    ("points", "range_m", "message"),
    [
        (np.empty((0, 3)), None, "no points"),
        (np.full((5, 3), np.nan), None, "none of the 5 points"),
        (np.zeros((5, 2)), None, r"shape \(5, 2\)"),
        (np.random.default_rng(0).uniform(0, 6000, (100, 3)), None, "millimetres"),
        (np.random.default_rng(0).uniform(800, 6000, (100, 3)), 4.0, "points in metres"),
    ],
)
def test_a_cloud_that_cannot_be_mapped_is_refused(points, range_m, message):
    with pytest.raises(ValueError, match=message):
        usable_points(points, range_m)


def test_voxels_are_the_means_of_their_points():
    points = np.random.default_rng(0).uniform(-1.0, 1.0, (2000, 3))
    voxels = voxels_of(points, 0.25)
    assert voxels.weights.sum() == len(points)
    for voxel in range(0, len(voxels.means), 50):
        own = points[voxels.labels == voxel]
        assert len(own) == voxels.weights[voxel]
        np.testing.assert_allclose(own.mean(axis=0), voxels.means[voxel])
        assert np.ptp(own, axis=0).max() <= 0.25
    assert (np.diff([np.argmax(voxels.labels == k) for k in range(len(voxels.means))]) > 0).all()


def test_voxels_of_no_size_are_the_points():
    points = np.ones((3, 3))
    assert voxels_of(points, 0.0).means is points


ROOM = room_points(0.05)


def test_a_table_top_is_no_floor_by_its_normal():
    normals = _surface_normals(ROOM)
    assert normals.shape == ROOM.shape
    for split in ("height", "normal", "both"):
        on_floor = _is_floor(ROOM, FloorPlane(), MapperSettings(split=split))
        assert not on_floor[(ROOM[:, 2] > 0.6) & (ROOM[:, 2] < 0.8)].any()
        inside = ((ROOM[:, :2] > 0.3) & (ROOM[:, :2] < 1.2)).all(axis=1) & (ROOM[:, 2] == 0.0)
        assert on_floor[inside].all()


def test_a_ramp_is_floor_by_its_normal_alone():
    x, y = np.meshgrid(np.arange(0.0, 4.0, 0.05), np.arange(0.0, 1.0, 0.05))
    ramp = np.column_stack([x.ravel(), y.ravel(), np.maximum(x.ravel() - 2.0, 0.0) * 0.2])
    by_height = _is_floor(ramp, FloorPlane(), MapperSettings(split="height"))
    by_normal = _is_floor(ramp, FloorPlane(), MapperSettings(split="normal"))
    assert by_height.mean() < 0.7
    assert by_normal.mean() > 0.95


def test_every_code_has_points_and_every_point_its_nearest_code():
    points = room(600).astype(np.float64)
    codes, labels = _coded(points, np.ones(600), 20, 3)
    assert codes.shape == (20, 3)
    assert set(labels.tolist()) == set(range(20))
    gaps = np.linalg.norm(points[:, None] - codes, axis=2)
    np.testing.assert_allclose(gaps[np.arange(600), labels], gaps.min(axis=1), atol=1e-5)


def test_fewer_points_than_codes_are_codes_themselves():
    points = np.array([[0.0, 0, 0], [1.0, 2, 3], [4.0, 4, 4]])
    codes, labels = _coded(points, np.ones(3), 50, 0)
    np.testing.assert_allclose(codes[labels], points)
    assert sorted(labels.tolist()) == [0, 1, 2]


def test_heavy_points_draw_codes_to_them_and_the_seed_decides():
    points = np.array([[0.0, 0, 0], [1.0, 0, 0]])
    codes, _ = _coded(points, np.array([1.0, 9.0]), 1, 0)
    assert codes[0, 0] == pytest.approx(0.9)
    cloud = room(300).astype(np.float64)
    first, again, other = (_coded(cloud, np.ones(300), 9, seed)[0] for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()


PAD = 0.02


def corner(x=0.0):
    """Points of two walls that meet, 1 m long and 0.5 m high, 5 cm apart."""
    along, up = np.meshgrid(np.arange(0.0, 1.0, 0.05), np.arange(0.0, 0.5, 0.05))
    one = np.stack([along.ravel() + x, np.zeros(along.size), up.ravel()], axis=1)
    other = np.stack([np.full(along.size, x), along.ravel() + 0.05, up.ravel()], axis=1)
    return np.concatenate([one, other])


def room_of(points, labels):
    boxes = boxes_of(points, labels, int(labels.max()) + 1)
    return float(np.prod(boxes[:, 1] - boxes[:, 0] + PAD, axis=1).sum())


def test_a_corner_becomes_its_two_walls():
    points = corner()
    found = cut_labels(points, np.zeros(len(points), np.int64), PAD)
    boxes = boxes_of(points, found, int(found.max()) + 1)
    thin = (boxes[:, 1] - boxes[:, 0])[:, :2].min(axis=1)
    assert thin.max() < 0.11
    # What lies inside of the corner is in no box any more.
    inside = np.array([0.5, 0.5, 0.2])
    assert not ((boxes[:, 0] <= inside) & (inside <= boxes[:, 1])).all(axis=1).any()


def test_a_wall_and_a_full_block_stay_whole():
    wall = corner()[:200]
    block = np.stack(np.meshgrid(*[np.arange(0.0, 0.5, 0.05)] * 3), axis=-1).reshape(-1, 3)
    for points in (wall, block):
        assert cut_labels(points, np.zeros(len(points), np.int64), PAD).tolist() == [0] * len(points)


def test_so_many_cuts_are_made_as_are_allowed_the_largest_first():
    points = np.concatenate([corner(), 0.5 * corner() + [5.0, 0.0, 0.0]])
    labels = np.repeat([0, 1], len(points) // 2)
    rooms = []
    for most in range(6):
        found = cut_labels(points, labels, PAD, most)
        assert found.max() + 1 <= 2 + most
        rooms.append(room_of(points, found))
    assert rooms == sorted(rooms, reverse=True)
    once = cut_labels(points, labels, PAD, 1)
    assert len(np.unique(once[labels == 0])) == 2
    assert len(np.unique(once[labels == 1])) == 1
    assert np.array_equal(cut_labels(points, labels, PAD, 1000), cut_labels(points, labels, PAD))


@given(
    st.lists(st.tuples(*[st.integers(0, 20)] * 3), min_size=1, max_size=60),
    st.integers(1, 4),
    st.randoms(use_true_random=False),
)
def test_pieces_lie_within_codes_and_take_less_room(cells, codes, random):
    points = 0.05 * np.array(cells, np.float64)
    labels = np.unique([random.randrange(codes) for _ in cells], return_inverse=True)[1]
    found = cut_labels(points, labels, PAD)
    assert set(found) == set(range(found.max() + 1))
    for piece in range(found.max() + 1):
        code = np.unique(labels[found == piece])
        assert len(code) == 1
        is_whole = np.array_equal(found == piece, labels == code[0])
        assert is_whole or (found == piece).sum() >= MIN_POINTS
    cuts = found.max() - labels.max()
    assert room_of(points, found) <= room_of(points, labels) + 1e-12
    if cuts == 1:
        code = next(c for c in range(labels.max() + 1) if len(np.unique(found[labels == c])) == 2)
        own = labels == code
        whole = room_of(points[own], np.zeros(own.sum(), np.int64))
        parts = room_of(points[own], np.unique(found[own], return_inverse=True)[1])
        assert parts <= (1.0 - MIN_GAIN) * whole + 1e-12


@pytest.mark.parametrize("codes", [40, 80])
def test_a_whole_cloud_has_no_more_boxes_than_codes(codes):
    floor = np.stack(np.meshgrid(np.arange(0.0, 4.0, 0.05), np.arange(0.0, 4.0, 0.05)), axis=-1)
    ground = np.concatenate([floor.reshape(-1, 2), np.zeros((floor.size // 2, 1))], axis=1)
    places = [np.array([0.0, y, 0.15]) for y in (0.3, 2.0)]
    walls = np.concatenate([corner(x) + place for x in (0.2, 1.6, 3.0) for place in places])
    found = map_cloud(np.concatenate([ground, walls]), codes, MapperSettings(fits_boxes=False))
    assert len(found.occupied) + len(found.ground) <= codes


ROOM_OF_FRAME_CODING, LEVEL = room_points(0.05), FloorPlane()
SETTINGS = MapperSettings()


@pytest.mark.parametrize(("count", "share", "expected"), [(100, 0.3, (70, 30)), (2, 0.9, (1, 1)), (50, 0.0, (49, 1))])
def test_both_kinds_get_at_least_a_code(count, share, expected):
    assert code_counts(count, share) == expected


def test_fewer_than_two_codes_are_refused():
    with pytest.raises(ValueError, match="k is 1; want at least 2 codes"):
        code_counts(1, 0.5)


def test_what_is_too_deep_or_too_high_is_cut_off():
    heights = np.array([-9.0, -SETTINGS.noise_depth_m, 0.0, SETTINGS.ceiling_m, SETTINGS.ceiling_m + 0.01])
    points = np.stack([np.zeros(5), np.zeros(5), heights], axis=1)
    assert _between_cuts(points, LEVEL, SETTINGS).tolist() == [False, True, True, True, False]


def test_points_are_split_once_into_obstacles_and_floor():
    above, floor = split_points(ROOM_OF_FRAME_CODING, LEVEL, SETTINGS)
    assert (floor[:, 2] <= SETTINGS.floor_height_m).all()
    assert (above[:, 2] > SETTINGS.floor_height_m).all()
    assert len(above) + len(floor) == _between_cuts(ROOM_OF_FRAME_CODING, LEVEL, SETTINGS).sum()


def test_every_obstacle_point_lies_in_the_box_of_a_code():
    above, _ = split_points(ROOM_OF_FRAME_CODING, LEVEL, SETTINGS)
    codes = coded_obstacles(above, 40, SETTINGS, 7)
    inside = ((above[:, None] >= codes.boxes[:, 0]) & (above[:, None] <= codes.boxes[:, 1])).all(axis=2)
    assert inside.any(axis=1).all()
    assert (codes.frames == 7).all()
    assert (codes.centres >= codes.boxes[:, 0] - 1e-9).all()
    assert (codes.centres <= codes.boxes[:, 1] + 1e-9).all()


def test_floor_codes_lie_on_the_floor_and_apart():
    _, floor = split_points(ROOM_OF_FRAME_CODING, LEVEL, SETTINGS)
    codes = coded_floor(floor, 60, SETTINGS).centres
    assert 10 < len(codes) <= 60
    assert np.abs(codes[:, 2]).max() <= SETTINGS.floor_height_m
    gaps = np.linalg.norm(codes[:, None] - codes, axis=2) + 9.0 * np.eye(len(codes))
    assert gaps.min() >= SETTINGS.merge_radius_m


def test_no_points_have_no_codes():
    assert len(coded_obstacles(np.empty((0, 3)), 9, SETTINGS)) == 0
    assert len(coded_floor(np.empty((0, 3)), 9, SETTINGS).centres) == 0


def test_codes_as_points_have_no_size_and_are_split_by_their_own_height():
    occupied, free = coded_as_points(ROOM_OF_FRAME_CODING, 80, LEVEL, SETTINGS)
    np.testing.assert_array_equal(occupied.boxes[:, 0], occupied.boxes[:, 1])
    assert (occupied.centres[:, 2] > SETTINGS.floor_height_m).all()
    assert (free.centres[:, 2] <= SETTINGS.floor_height_m).all()
    assert len(free.centres) > 0
