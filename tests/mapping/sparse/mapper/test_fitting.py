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
from lidarium.mapping.sparse.planning import plan, points_along
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


def test_points_on_borders_of_cells_add_no_box():
    x, y = np.meshgrid(np.arange(64, 104) * 0.03, np.arange(54, 81) * 0.03)
    top = np.stack([x, y, np.full_like(x, 0.72)], axis=-1).reshape(-1, 3)
    codes = occupied_codes(np.stack([top.min(axis=0), top.max(axis=0)])[None])
    np.testing.assert_array_equal(fitted_codes(codes, cells_of(top)).boxes, codes.boxes)


def table_points():
    """Points of a floor, of a table top, and of its edge, a strip that stands out by 11 cm."""
    x, y = np.meshgrid(np.arange(0.0, 6.0, 0.03), np.arange(0.0, 5.0, 0.03))
    floor = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    x, y = np.meshgrid(np.arange(2.4, 3.6, 0.02), np.arange(2.0, 2.8, 0.02))
    top = np.stack([x, y, np.full_like(x, 0.72)], axis=-1).reshape(-1, 3)
    x, z = np.meshgrid(np.arange(2.4, 3.6, 0.04), (0.69, 0.71))
    return floor, top, np.stack([x, np.full_like(x, 1.89), z], axis=-1).reshape(-1, 3)


def least_gap(free, boxes, floor, obstacles):
    """Return how near paths past the table come to points, of a body of 0.30 m [m]."""
    graph = build_graph(free, boxes, SweptBody(radius=0.3, height=1.2), floor=floor)
    tree, rng = cKDTree(obstacles[:, :2]), np.random.default_rng(0)
    paths = [plan(graph, *rng.uniform(((0.4, 0.4), (4.1, 0.4)), ((1.9, 4.5), (5.5, 4.5)))) for _ in range(40)]
    assert all(path.is_found for path in paths)
    return min(float(tree.query(points_along(path.path[:, :2], 0.01))[0].min()) for path in paths)


def test_paths_keep_the_radius_from_an_edge_that_no_code_has():
    floor, top, edge = table_points()
    both, free = np.concatenate([top, edge]), floor[::37]
    free = free[((free[:, :2] < (2.1, 1.59)) | (free[:, :2] > (3.9, 3.1))).any(axis=1)]
    codes = occupied_codes(np.stack([top.min(axis=0), top.max(axis=0)])[None])
    assert least_gap(free, codes.boxes, None, both) < 0.2
    assert least_gap(free, fitted_codes(codes, cells_of(both)).boxes, None, both) >= 0.3 - 1e-6


@pytest.mark.parametrize("codes", [64, 1024])
def test_paths_keep_the_radius_from_an_edge_that_a_later_frame_sees(codes):
    floor, top, edge = table_points()
    mapper = IncrementalMapper(codes, MapperSettings(least_motion_m=0.0))
    for part in (np.concatenate([floor, top]), np.concatenate([floor[::7], edge])):
        mapper.add(part, np.eye(4))
    for found in (mapper.map, map_cloud(np.concatenate(table_points()), codes)):
        assert least_gap(found.free, found.boxes, found.seen_floor, np.concatenate([top, edge])) >= 0.3 - 1e-6


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
