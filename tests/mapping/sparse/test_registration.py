"""Codes and their normals tell how two maps lie to each other, or that nothing does."""

import numpy as np
import pytest
from furnished_room import box_points, pose_at, room_points, seen_from

from lidarium.mapping.sparse.files.map_files import read_sparse_map, write_sparse_map
from lidarium.mapping.sparse.floor_plane import FloorPlane
from lidarium.mapping.sparse.mapper.full import map_cloud
from lidarium.mapping.sparse.registration import RegistrationSettings, register
from lidarium.mapping.sparse.rigid_motions import inverse_of, moved_points
from lidarium.mapping.sparse.settings import MapperSettings
from lidarium.mapping.sparse.surface_codes import Codes, codes_of

UNMERGED = MapperSettings(merges=False)


@pytest.fixture(scope="module")
def room_map():
    return map_cloud(room_points(0.04, 0.004), 512, UNMERGED)


@pytest.mark.parametrize("k", [128, 512])
def test_the_motion_between_two_maps_of_a_room_is_found(room_map, k):
    motion = pose_at(0.25, -0.2, 0.05, yaw=0.1, pitch=0.02)
    points = moved_points(room_points(0.04, 0.004, seed=1), inverse_of(motion))
    floor = FloorPlane(*motion[2, :3].tolist(), float(motion[2, 3]))
    second = map_cloud(points, k, MapperSettings(merges=False, seed=1), floor=floor)
    found = register(codes_of(room_map), codes_of(second))
    assert found.is_accepted
    assert found.overlap > 0.8
    assert found.rms < 0.02
    np.testing.assert_allclose(found.transform, motion, atol=0.01)


def test_a_single_frame_is_found_in_a_map(room_map):
    pose = pose_at(0.8, 0.9, 0.9, yaw=0.7, pitch=0.3)
    seen = seen_from(room_points(0.04, 0.004, seed=2), pose, half_angle=0.9, reach=5.0)
    level = pose_at(0.0, 0.0, 0.9, pitch=0.3)
    frame = map_cloud(moved_points(seen, level), 200, UNMERGED)
    guess = pose_at(0.9, 0.8, 0.0, yaw=0.65)
    found = register(codes_of(room_map), codes_of(frame), guess)
    assert found.is_accepted, found.refusal
    np.testing.assert_allclose(found.transform, pose_at(0.8, 0.9, 0.0, yaw=0.7), atol=0.03)


def test_a_corridor_holds_nothing_along_itself():
    corridor = np.concatenate(
        [box_points((0, y, 0), (12, y + 0.001, 1.2), 0.05) for y in (0.0, 2.0)]
        + [box_points((0, 0, 0), (12, 2, 0.001), 0.05)]
    )
    codes = codes_of(map_cloud(corridor, 300, UNMERGED))
    found = register(codes, codes, pose_at(0.1, 0.05, 0.0))
    assert not found.is_accepted
    assert "shifts along x" in found.refusal


def test_codes_far_apart_have_no_pairs(room_map):
    codes = codes_of(room_map)
    found = register(codes, Codes(codes.centres + 50.0, codes.normals, codes.weights))
    assert "0 pairs" in found.refusal


def test_little_overlap_is_refused(room_map):
    codes = codes_of(room_map)
    far = Codes(codes.centres + 50.0, codes.normals, 9.0 * codes.weights)
    both = Codes(*(np.concatenate(parts) for parts in zip(codes, far, strict=True)))
    assert "overlap is 0.09" in register(codes, both).refusal


def test_codes_of_no_surface_are_refused(room_map):
    codes = codes_of(room_map)
    bare = Codes(codes.centres, np.zeros_like(codes.normals), codes.weights)
    assert "no codes on surfaces" in register(bare, codes).refusal
    assert register(codes, bare).is_accepted


def test_settings_and_guesses_are_checked(room_map):
    with pytest.raises(ValueError, match="kept_share of registration"):
        RegistrationSettings(kept_share=0.0)
    with pytest.raises(ValueError, match="rigid motion"):
        register(codes_of(room_map), codes_of(room_map), np.zeros((4, 4)))


def test_maps_read_from_files_are_registered(room_map, tmp_path):
    motion = pose_at(0.15, -0.1, 0.0, yaw=0.05)
    points = moved_points(room_points(0.04, 0.004, seed=1), inverse_of(motion))
    second = map_cloud(points, 512, MapperSettings(merges=False, seed=1))
    read = []
    for name, made in (("first", room_map), ("second", second)):
        write_sparse_map(tmp_path / f"{name}.smap", made)
        read.append(read_sparse_map(tmp_path / f"{name}.smap")[0])
    found = register(codes_of(read[0]), codes_of(read[1]))
    assert found.is_accepted, found.refusal
    np.testing.assert_allclose(found.transform, motion, atol=0.05)
