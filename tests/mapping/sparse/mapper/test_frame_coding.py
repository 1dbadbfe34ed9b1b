"""Codes of one cloud: floor and obstacles apart."""

import numpy as np
import pytest
from furnished_room import room_points

from lidarium.mapping.sparse.floor_plane import FloorPlane
from lidarium.mapping.sparse.mapper.frame_coding import (
    between_cuts,
    code_counts,
    coded_as_points,
    coded_floor,
    coded_obstacles,
    split_points,
)
from lidarium.mapping.sparse.settings import MapperSettings

ROOM, LEVEL = room_points(0.05), FloorPlane()
SETTINGS = MapperSettings()


@pytest.mark.parametrize(
    ("count", "share", "expected"), [(100, 0.3, (70, 30)), (2, 0.9, (1, 1)), (50, 0.0, (49, 1))]
)
def test_both_kinds_get_at_least_a_code(count, share, expected):
    assert code_counts(count, share) == expected


def test_fewer_than_two_codes_are_refused():
    with pytest.raises(ValueError, match="k is 1; want at least 2 codes"):
        code_counts(1, 0.5)


def test_what_is_too_deep_or_too_high_is_cut_off():
    heights = np.array([-9.0, -SETTINGS.noise_depth_m, 0.0, SETTINGS.ceiling_m, SETTINGS.ceiling_m + 0.01])
    points = np.stack([np.zeros(5), np.zeros(5), heights], axis=1)
    assert between_cuts(points, LEVEL, SETTINGS).tolist() == [False, True, True, True, False]


def test_points_are_split_once_into_obstacles_and_floor():
    above, floor = split_points(ROOM, LEVEL, SETTINGS)
    assert (floor[:, 2] <= SETTINGS.floor_height_m).all()
    assert (above[:, 2] > SETTINGS.floor_height_m).all()
    assert len(above) + len(floor) == between_cuts(ROOM, LEVEL, SETTINGS).sum()


def test_every_obstacle_point_lies_in_the_box_of_a_code():
    above, _ = split_points(ROOM, LEVEL, SETTINGS)
    codes = coded_obstacles(above, 40, SETTINGS, 7)
    inside = ((above[:, None] >= codes.boxes[:, 0]) & (above[:, None] <= codes.boxes[:, 1])).all(axis=2)
    assert inside.any(axis=1).all()
    assert (codes.frames == 7).all()
    assert (codes.centres >= codes.boxes[:, 0] - 1e-9).all()
    assert (codes.centres <= codes.boxes[:, 1] + 1e-9).all()


def test_floor_codes_lie_on_the_floor_and_apart():
    _, floor = split_points(ROOM, LEVEL, SETTINGS)
    codes = coded_floor(floor, 60, SETTINGS).centres
    assert 10 < len(codes) <= 60
    assert np.abs(codes[:, 2]).max() <= SETTINGS.floor_height_m
    gaps = np.linalg.norm(codes[:, None] - codes, axis=2) + 9.0 * np.eye(len(codes))
    assert gaps.min() >= SETTINGS.merge_radius_m


def test_no_points_have_no_codes():
    assert len(coded_obstacles(np.empty((0, 3)), 9, SETTINGS)) == 0
    assert len(coded_floor(np.empty((0, 3)), 9, SETTINGS).centres) == 0


def test_codes_as_points_have_no_size_and_are_split_by_their_own_height():
    occupied, free = coded_as_points(ROOM, 80, LEVEL, SETTINGS)
    np.testing.assert_array_equal(occupied.boxes[:, 0], occupied.boxes[:, 1])
    assert (occupied.centres[:, 2] > SETTINGS.floor_height_m).all()
    assert (free.centres[:, 2] <= SETTINGS.floor_height_m).all()
    assert len(free.centres) > 0
