"""The files of a merge: fused maps where they lie, transforms, pictures."""

import json
import math

import cv2
import numpy as np
import pytest
from drawn_maps import RESOLUTION, blank, moved, room

from lidarium.mapping.files.map_files import MapImage, read_ros_map
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import FREE, UNKNOWN
from lidarium.mapping.merging.frame_tree import Edge, FrameTree
from lidarium.mapping.merging.joining.merged_maps import Merged
from lidarium.mapping.merging.pair_result import PairResult
from lidarium.mapping.merging.regions.settings import RegionSettings
from lidarium.scripts.output.merged_files import corner_of, draw_regions, write_merged

ORIGIN = (-3.0, 2.0, math.pi / 2)
SHIFT = Transform(-1.5, -0.5)


def two_rooms():
    return room(room(blank(), 20, 20, 40, 60), 70, 20, 50, 90)


@pytest.fixture
def merged():
    """Two maps of one place, one of them shifted, and a third that joins none."""
    levels = {"west": two_rooms(), "east": moved(two_rooms(), SHIFT.inverse()), "other": two_rooms()}
    tree = FrameTree()
    for name in levels:
        tree.add_map(name)
    tree.add_edge(Edge("west", "east", SHIFT, 10.0))
    found = PairResult(True, "accepted", SHIFT)
    return Merged(levels, RESOLUTION, {("west", "east"): found}, tree)


def images_of(merged):
    origins = {"west": ORIGIN, "east": (10.0, -4.0, 0.0), "other": (0.0, 0.0, 0.0)}
    return {name: MapImage(merged.levels[name], origin, RESOLUTION) for name, origin in origins.items()}


def test_a_corner_is_where_the_map_has_its_origin(merged):
    corner = corner_of(images_of(merged)["west"])
    assert corner.apply([0.0, 0.0]) == pytest.approx([-3.0, 2.0])
    assert corner.apply([1.0, 0.0]) == pytest.approx([-3.0, 3.0])


def test_a_group_of_maps_becomes_one_in_the_frame_of_its_first(merged, tmp_path):
    result = {"world": "west"}
    files = write_merged(merged, [], images_of(merged), result, tmp_path)
    assert files == ["map.yaml", "map.pgm", "transforms.json", "merge.png"]
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(files)
    assert json.loads((tmp_path / "transforms.json").read_text()) == result
    assert cv2.imread(str(tmp_path / "merge.png")).shape[2] == 3
    fused, written = merged.fused(["west", "east"]), read_ros_map(tmp_path / "map.yaml")
    assert written.resolution == pytest.approx(RESOLUTION)
    assert np.count_nonzero(written.levels == FREE) == np.count_nonzero(fused.levels == FREE)
    # The lower left corner of what is known, in the turned frame of the first map.
    x, y = fused.origin
    assert written.origin == pytest.approx((-3.0 - y, 2.0 + x, math.pi / 2))
    known = np.argwhere(merged.levels["west"] != UNKNOWN).min(axis=0)[::-1] * RESOLUTION
    assert fused.origin == pytest.approx(tuple(known), abs=1e-6)


def test_each_further_group_has_a_number(merged, tmp_path):
    merged.levels["more"] = merged.levels["other"]
    merged.tree.add_map("more")
    merged.tree.add_edge(Edge("other", "more", Transform(), 5.0))
    images = {**images_of(merged), "more": images_of(merged)["other"]}
    files = write_merged(merged, [], images, {}, tmp_path)
    assert files[:4] == ["map.yaml", "map.pgm", "map-2.yaml", "map-2.pgm"]
    assert all((tmp_path / name).is_file() for name in files)


def test_bent_maps_are_written_where_there_are_any(merged, tmp_path):
    bent = merged.deformed(["west", "east"])
    write_merged(merged, [bent], images_of(merged), {}, tmp_path)
    written = read_ros_map(tmp_path / "map.yaml")
    assert written.levels.shape == bent.fused.levels.shape


def test_regions_are_drawn_of_each_map(merged, tmp_path):
    assert draw_regions(merged, images_of(merged), RegionSettings(), tmp_path) == "regions.png"
    picture = cv2.imread(str(tmp_path / "regions.png"))
    assert picture.std() > 5.0
    # Panels for three maps beside each other.
    assert picture.shape[1] > 2 * picture.shape[0]
