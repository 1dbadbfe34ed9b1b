"""Real clouds become small maps in which nothing that was seen is lost."""

import math
from dataclasses import replace

import numpy as np
import pytest

from lidarium.mapping.files.images import read_image
from lidarium.mapping.geometry.rigid_motions import moved_points
from lidarium.mapping.point_clouds.cameras import Intrinsics, points_of_depth
from lidarium.mapping.sparse.floor_plane import FloorPlane, find_floor
from lidarium.mapping.sparse.map_files import _parsed_binary, binary_content, text_content
from lidarium.mapping.sparse.mapper.frame_coding import split_points
from lidarium.mapping.sparse.mapper.full import map_cloud
from lidarium.mapping.sparse.mapper.incremental import IncrementalMapper
from lidarium.mapping.sparse.mapper.merging import are_covered
from lidarium.mapping.sparse.settings import FloorSettings, MapperSettings

KINECT = Intrinsics(585.0, 585.0, 320.0, 240.0)
# The first frame is the world; its camera looks along z, y is down, and it leans.
UP = FloorSettings(up_y=-1.0, up_z=0.0, most_tilt=math.radians(40.0))
THESIS_BYTES = 16


@pytest.fixture(scope="module")
def kitchen(shared_data):
    folder = shared_data / "clouds" / "redkitchen"
    if not folder.is_dir():
        pytest.skip(f"no clouds at {folder}")
    return folder


@pytest.fixture(scope="module")
def fused(kitchen):
    return np.load(kitchen / "redkitchen_fused_2cm.npz")["xyz"].astype(np.float64)


@pytest.fixture(scope="module")
def level(fused):
    return find_floor(fused, UP).levelling()


def frames(folder, level, step=1):
    for path in sorted(folder.glob("*.depth.png"))[::step]:
        depth = read_image(path).astype(np.float64)
        depth[depth == 65535] = 0.0
        pose = np.loadtxt(str(path).replace("depth.png", "pose.txt"))
        left, _, right = np.linalg.svd(pose[:3, :3])
        pose[:3, :3] = left @ right
        yield points_of_depth(depth / 1000.0, KINECT), level @ pose


def test_the_kitchen_is_a_third_of_the_thesis_form(fused, level):
    found = map_cloud(fused, 1024, pose=level)
    obstacles, _ = split_points(moved_points(fused, level), found.floor, found.settings)
    assert are_covered(obstacles, found.boxes).all()
    assert found.floor.tilt < math.radians(1.0)
    kept = len(found.occupied) + len(found.ground)
    content = binary_content(found)
    assert 3 * len(content) <= THESIS_BYTES * kept
    assert 5 * len(content) <= len(text_content(found))
    after, _ = _parsed_binary(content)
    assert are_covered(obstacles, after.boxes).all()


def test_frames_of_the_kitchen_become_a_small_map(kitchen, level):
    mapper = IncrementalMapper(256, MapperSettings(range_m=4.0), floor=FloorPlane())
    taken = [mapper.add(points, pose) for points, pose in frames(kitchen, level, 2)]
    assert sum(taken) >= 3
    assert len(mapper.map.occupied) < 150 * sum(taken)
    assert len(mapper.map.ground) > 20


def test_octomap_leaves_of_a_building_have_a_floor(shared_data):
    path = shared_data / "clouds" / "octomap" / "geb079_west.npz"
    if not path.is_file():
        pytest.skip(f"no cloud at {path}")
    points = np.load(path)["occupied"][:, :3].astype(np.float64)
    settings = MapperSettings(voxel_m=0.0, floor=FloorSettings(distance_m=0.08))
    found = map_cloud(points, 512, settings)
    assert found.floor.tilt < math.radians(1.0)
    assert len(found.ground) > 50
    assert len(found.occupied) < 512
    assert len(map_cloud(points, 512, replace(settings, fits_boxes=False)).occupied) < 0.7 * 512
