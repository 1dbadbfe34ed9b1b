"""Boxes hold all points that were seen, and no box is mostly empty."""

import numpy as np
import pytest
from furnished_room import room_points
from scipy.spatial import cKDTree

from lidarium.mapping.geometry.rigid_motions import moved_points
from lidarium.mapping.point_clouds.cameras import Intrinsics, read_depth_image, read_pose
from lidarium.mapping.sparse.graph import build_graph
from lidarium.mapping.sparse.mapper.fitting import (
    CELL_M,
    MOST_EMPTY,
    NEAR_M,
    SeenPoints,
    empty_shares,
    fitted_codes,
    near_distance,
    unlike_points,
)
from lidarium.mapping.sparse.mapper.frame_coding import split_points
from lidarium.mapping.sparse.mapper.full import map_cloud
from lidarium.mapping.sparse.mapper.incremental import IncrementalMapper
from lidarium.mapping.sparse.mapper.merging import are_covered
from lidarium.mapping.sparse.planning import plan
from lidarium.mapping.sparse.settings import MapperSettings
from lidarium.mapping.sparse.sparse_map import occupied_codes
from lidarium.mapping.sparse.swept_body import SweptBody


def cells_of(points):
    cells = SeenPoints()
    cells.add(points)
    return cells.middles


def test_cells_hold_the_points_of_all_frames_once():
    points = np.random.default_rng(0).uniform(-3.0, 3.0, (5000, 3))
    cells = SeenPoints()
    for part in np.split(points, 5):
        cells.add(part)
    cells.add(points[:100])
    assert np.abs(cKDTree(cells.middles).query(points, p=np.inf)[0]).max() <= 0.5 * CELL_M + 1e-9
    assert len(cells.middles) == len(np.unique(np.floor(points / CELL_M), axis=0))
    with pytest.raises(ValueError, match="farther than"):
        cells.add(np.array([[1e6, 0.0, 0.0]]))


def test_shares_are_those_of_a_dense_grid():
    rng = np.random.default_rng(1)
    points = rng.uniform(0.0, 1.0, (40, 3))
    boxes = np.sort(rng.uniform(0.0, 1.0, (20, 2, 3)), axis=1)
    tree = cKDTree(points)
    for box, found in zip(boxes, empty_shares(boxes, tree, NEAR_M), strict=True):
        grid = np.stack(np.meshgrid(*np.linspace(box[0], box[1], 25).T), axis=-1).reshape(-1, 3)
        assert found == pytest.approx(float((tree.query(grid)[0] > NEAR_M).mean()), abs=0.12)


def test_a_box_that_spans_two_things_becomes_two():
    edge = np.stack([np.full(40, 2.7), np.linspace(4.1, 4.4, 40), np.full(40, 0.7)], axis=1)
    wall = np.stack([np.full(40, 4.0), np.linspace(4.1, 4.4, 40), np.linspace(0.5, 0.7, 40)], axis=1)
    both = np.concatenate([edge, wall])
    codes = occupied_codes(np.stack([both.min(axis=0), both.max(axis=0)])[None])
    found = fitted_codes(codes, cells_of(both))
    assert are_covered(both, found.boxes).all()
    assert (found.boxes[:, 1, 0] < 2.8).any()
    assert ((found.boxes[:, 1, 0] < 2.8) | (found.boxes[:, 0, 0] > 3.9)).all()


def test_points_in_no_box_get_one():
    points = room_points(0.04)
    points = points[points[:, 2] > 0.1]
    found = fitted_codes(occupied_codes(np.array([[[0.0, 0.0, 0.1], [0.1, 4.0, 2.4]]])), cells_of(points))
    assert are_covered(points, found.boxes + np.array([[-0.01], [0.01]])).all()


@pytest.mark.parametrize("seed", range(6))
def test_frames_leave_no_box_in_the_gap_between_two_things(shared_cases, seed):
    folder = shared_cases / "cloud-phantom-boxes"
    mapper, seen = IncrementalMapper(256, MapperSettings(least_motion_m=0.0, seed=seed)), []
    for name in "01":
        points = read_depth_image(folder / f"depth_{name}.png", Intrinsics(525, 525, 319.5, 239.5)).points
        pose = read_pose(folder / f"pose_{name}.txt")
        mapper.add(points, pose)
        seen.append(moved_points(points.astype(np.float64), pose))
    found = mapper.map
    obstacles, _ = split_points(np.concatenate(seen), found.floor, found.settings)
    assert are_covered(obstacles, found.boxes).all()
    tree = cKDTree(obstacles)
    for box in found.boxes:
        counts = np.ceil((box[1] - box[0]) / 0.02).astype(int) + 1
        shares = np.stack(np.meshgrid(*((np.arange(count) + 0.5) / count for count in counts)), axis=-1).reshape(-1, 3)
        assert (tree.query(box[0] + shares * (box[1] - box[0]))[0] > 0.10).mean() <= 0.3
    graph = build_graph(found.free, found.boxes, SweptBody(), floor=found.seen_floor)
    assert plan(graph, np.array([3.45, 3.6]), np.array([3.45, 5.0])).length == pytest.approx(1.4, abs=0.01)


@pytest.mark.parametrize("codes", [32, 256])
def test_maps_of_few_codes_are_fitted(codes):
    points = room_points(0.04)
    found = map_cloud(points, codes)
    assert unlike_points(found, cells_of(points)) == {"points": 0, "boxes": 0}
    obstacles, _ = split_points(points, found.floor, found.settings)
    tree = cKDTree(cells_of(obstacles))
    assert empty_shares(found.boxes, tree, near_distance(tree)).max() <= MOST_EMPTY + 0.05


def test_what_a_map_misses_is_counted():
    points = room_points(0.04)
    found = map_cloud(points, 256, MapperSettings(fits_boxes=False))
    post = np.stack([np.full(50, 1.0), np.full(50, 3.0), np.linspace(0.3, 1.0, 50)], axis=1)
    assert unlike_points(found, cells_of(np.concatenate([points, post])))["points"] > 20
