"""No path leads over floor that was not seen, or over a step that the robot does not climb."""

import json
import struct
import zlib
from dataclasses import replace

import numpy as np
import pytest
from furnished_room import box_points
from scipy.spatial import cKDTree

from lidarium.mapping.sparse.editing import edited, join_maps
from lidarium.mapping.sparse.floor_plane import FloorPlane, find_floor
from lidarium.mapping.sparse.graph import build_graph
from lidarium.mapping.sparse.map_files import _HEADER, binary_content, read_sparse_map, write_sparse_map
from lidarium.mapping.sparse.mapper.full import map_cloud
from lidarium.mapping.sparse.mapper.incremental import IncrementalMapper
from lidarium.mapping.sparse.planning import plan, points_along
from lidarium.mapping.sparse.seen_floor import CELL_M, MAX_CELLS, UNSEEN, FloorPoints, SeenFloor
from lidarium.mapping.sparse.settings import MapperSettings
from lidarium.mapping.sparse.swept_body import SweptBody
from lidarium.scripts.main import main

BODY = SweptBody(radius=0.3, height=1.0)
SPACING = 0.03


def floor_points(wide=6.0, deep=5.0, holes=(), noise=0.0, seed=0):
    """Points of a floor without those in holes (low x, low y, high x, high y), with walls around it."""
    x, y = np.meshgrid(np.arange(0.0, wide, SPACING), np.arange(0.0, deep, SPACING))
    floor = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    for low_x, low_y, high_x, high_y in holes:
        is_hole = (floor[:, 0] > low_x) & (floor[:, 0] < high_x) & (floor[:, 1] > low_y) & (floor[:, 1] < high_y)
        floor = floor[~is_hole]
    walls = box_points((0, 0, 0), (wide, deep, 1.5), SPACING)
    walls = walls[(walls[:, 2] > 0.0) & (walls[:, 2] < 1.5)]
    points = np.concatenate([floor, walls])
    return points + np.random.default_rng(seed).normal(0.0, noise, points.shape) if noise else points


def stairs(low_x, low_y, high_x, high_y):
    """Points of steps of 17 cm that lead down along x."""
    x, y = np.meshgrid(np.arange(low_x, high_x, SPACING), np.arange(low_y, high_y, SPACING))
    return np.stack([x, y, -0.17 * np.ceil((x - low_x) / 0.25 + 1e-9)], axis=-1).reshape(-1, 3)


def pallet(low_x, low_y, high_x, high_y, height=0.09):
    """Points of the top and the sides of a pallet."""
    points = box_points((low_x, low_y, 0.0), (high_x, high_y, height), 0.02)
    return points[points[:, 2] > 0.0]


def graph_of(found, body=BODY):
    return build_graph(found.free, found.boxes, body, floor=found.seen_floor)


def worst_footprint(path, tree, heights, radius):
    """Return the farthest point of the footprint from a seen one [m], and the largest step below it."""
    offsets = np.arange(-radius, radius + 1e-9, 0.025)
    x, y = np.meshgrid(offsets, offsets)
    disc = np.stack([x, y], axis=-1)[np.hypot(x, y) <= radius]
    farthest, step = 0.0, 0.0
    for middle in points_along(path[:, :2], 0.05):
        farthest = max(farthest, float(tree.query(middle + disc)[0].max()))
        below = heights[tree.query_ball_point(middle, radius)]
        step = max(step, float(np.ptp(below)))
    return farthest, step


@pytest.mark.parametrize("name", ["hole", "stairwell"])
def test_a_path_goes_round_a_hole_and_round_stairs(shared_cases, name):
    points = np.load(shared_cases / "cloud-stairwell" / f"{name}.npz")["xyz"]
    found = map_cloud(points, 1024)
    assert abs(found.floor.offset) < 0.01
    graph = graph_of(found)
    path = plan(graph, np.array([1.0, 2.0]), np.array([5.0, 2.0]))
    assert 5.3 < path.length < 5.9
    assert plan(graph, np.array([3.0, 2.0]), np.array([5.0, 2.0])).reason == "start without floor"
    assert plan(graph, np.array([1.0, 2.0]), np.array([3.0, 2.0, 0.0])).reason == "goal without floor"
    # The middle is on floor, the footprint is not all.
    assert plan(graph, np.array([2.0, 2.0]), np.array([5.0, 2.0])).reason == "start without floor"
    assert plan(graph, np.array([1.0, 2.0, 1.5]), np.array([5.0, 2.0])).reason == "start without floor"


def random_holes(seed):
    """Return a hole, the place of stairs and the place of a pallet, apart from each other."""
    rng = np.random.default_rng(seed)
    found = []
    for column in range(3):
        size = rng.uniform(0.4, 1.0, 2)
        low = np.array([0.6 + 1.8 * column, 0.2]) + rng.uniform(0.0, 1.0, 2) * [0.3, 3.4]
        found.append((*low, *(low + size)))
    return found


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("noise", [0.0, 0.005])
def test_the_whole_footprint_of_a_path_is_on_points_of_floor(seed, noise):
    hole, well, wood = random_holes(seed)
    solid = floor_points(holes=(hole, well, wood), noise=noise, seed=seed)
    cloud = np.concatenate([solid, stairs(*well), pallet(*wood)])
    graph = graph_of(map_cloud(cloud, 1024, MapperSettings(seed=seed)))
    seen = cloud[(cloud[:, 2] > -0.1) & (cloud[:, 2] < 0.1)]
    tree = cKDTree(seen[:, :2])
    rng, answered, possible = np.random.default_rng(seed), 0, 0
    holes = np.array([hole, well, wood])
    for _ in range(60):
        start, goal = rng.uniform((0.36, 0.36), (5.6, 4.6), (2, 2))
        gaps = [np.maximum(np.maximum(holes[:, :2] - end, end - holes[:, 2:]), 0.0) for end in (start, goal)]
        is_possible = min(np.hypot(*gap.T).min() for gap in gaps) > BODY.radius + 0.1
        path = plan(graph, start, goal)
        possible += is_possible
        answered += is_possible and path.is_found
        if path.is_found:
            farthest, step = worst_footprint(path.path, tree, seen[:, 2], BODY.radius)
            assert farthest <= 0.1
            assert step <= 0.05 + 8.0 * noise
    assert possible > 20
    assert answered >= 0.97 * possible


def test_a_step_is_climbed_by_a_robot_that_can():
    cloud = np.concatenate([floor_points(holes=[(2.5, -1.0, 3.5, 6.0)]), pallet(2.5, 0.0, 3.5, 5.0)])
    found = map_cloud(cloud, 1024)
    ends = np.array([1.0, 2.0]), np.array([5.0, 2.0])
    assert plan(graph_of(found), *ends).reason == "no path"
    assert plan(graph_of(found, replace(BODY, clearance=0.1)), *ends).length == pytest.approx(4.0, abs=0.05)
    # It starts on the pallet, and does not come down.
    assert plan(graph_of(found), np.array([3.0, 2.0]), np.array([3.0, 3.0])).is_found
    assert plan(graph_of(found), np.array([3.0, 2.0]), np.array([5.0, 3.0])).reason == "no path"


def test_a_map_without_cells_of_floor_answers_as_if_all_was_seen():
    found = map_cloud(floor_points(holes=[(2.0, 1.0, 4.0, 4.0)]), 512, MapperSettings(floor_gap_m=0.0))
    assert found.seen_floor is None
    assert plan(graph_of(found), np.array([1.0, 2.5]), np.array([5.0, 2.5])).length == pytest.approx(4.0, abs=0.01)


@pytest.mark.parametrize(("width", "gap", "is_floor"), [(0.1, 0.1, True), (0.25, 0.1, False), (0.1, 0.04, False)])
def test_narrow_gaps_between_points_are_floor(width, gap, is_floor):
    cloud = floor_points(holes=[(2.9, -1.0, 2.9 + width, 6.0)])
    found = map_cloud(cloud, 512, MapperSettings(floor_gap_m=gap))
    assert plan(graph_of(found), np.array([1.0, 2.0]), np.array([5.0, 2.0])).is_found == is_floor


def test_frames_see_the_floor_of_their_whole_cloud():
    cloud = floor_points(holes=[(2.0, 1.0, 4.0, 4.0)])
    mapper = IncrementalMapper(512, MapperSettings(least_motion_m=0.0), floor=FloorPlane())
    for part in (cloud[:, 0] < 2.5, (cloud[:, 0] >= 2.5) & (cloud[:, 1] < 2.0), cloud[:, 0] >= 2.5):
        mapper.add(cloud[part], np.eye(4))
    whole = map_cloud(cloud, 512, floor=FloorPlane()).seen_floor
    seen = mapper.map.seen_floor
    np.testing.assert_array_equal(seen.low, whole.low)
    assert (seen.steps == whole.steps).mean() > 0.99
    mapper.correct(mapper.map.poses)
    assert mapper.map.seen_floor is None  # the cells are of the poses before


def test_cells_become_larger_on_a_wide_floor():
    points = FloorPoints(0.1)
    plane = FloorPlane()
    near = np.array([[0.01, 0.01, 0.02], [-0.26, 0.01, 0.04]])
    points.add(near, plane)
    wide = np.array([[-80.0, -70.0, 0.0], [90.0, 60.0, 0.0]])
    points.add(wide, plane)
    seen = points.seen(np.empty((0, 2, 3)), plane, 0.1)
    assert seen.cell_m > CELL_M
    assert seen.steps.size <= MAX_CELLS
    # Sums survive the change of cells.
    assert points._counts.sum() == 4.0
    assert points._sums.sum() == pytest.approx(0.06)
    for point in (*near, *wide):
        column, row = np.floor(point[:2] / points._side).astype(int) - points._low
        assert points._counts[row, column] >= 1.0


def test_rims_surround_what_bears_a_robot():
    steps = np.zeros((6, 8), np.uint8)
    steps[2:4, 3:5], steps[0, 7] = UNSEEN, 9
    support = SeenFloor(steps, np.array([10, -20]), 0.05).supports(0.05)
    rims = support.rims()
    rng = np.random.default_rng(0)
    for point in rng.uniform((0.4, -1.1), (1.0, -0.6), (2000, 2)):
        in_rim = ((rims[:, 0, :2] + 0.0126 <= point) & (point <= rims[:, 1, :2] - 0.0126)).all(axis=1).any()
        assert not (in_rim and support.bears(point))
    # From what bears to what does not, no straight line misses them.
    inside, outside = np.array([0.52, -0.98]), np.array([0.7, -0.85])
    assert support.bears(inside)
    assert not support.bears(outside)
    line = inside + np.linspace(0.0, 1.0, 400)[:, None] * (outside - inside)
    assert any(((rims[:, 0, :2] <= p) & (p <= rims[:, 1, :2])).all(axis=1).any() for p in line)
    assert not SeenFloor(np.full((2, 2), UNSEEN, np.uint8), np.zeros(2, np.int64)).supports(0.05).rims().size


def test_space_that_is_cleared_down_to_the_floor_bears_a_robot():
    found = map_cloud(floor_points(holes=[(2.0, 1.0, 4.0, 4.0)]), 512)
    ends = np.array([1.0, 2.5]), np.array([5.0, 2.5])
    hole = np.array([[[1.9, 0.9, -0.1], [4.1, 4.1, 1.0]]])
    assert plan(graph_of(found), *ends).length > 4.5
    assert plan(graph_of(edited(found, remove_boxes=hole)), *ends).length == pytest.approx(4.0, abs=0.01)
    above = hole + np.array([0.0, 0.0, 0.3])
    assert plan(graph_of(edited(found, remove_boxes=above)), *ends).length > 4.5


@pytest.mark.parametrize("turn", [0.0, 0.5 * np.pi, 0.3])
def test_joined_maps_have_the_floor_of_both(turn):
    """Two halves of a room, the second in a frame of its own."""
    cloud = floor_points(holes=[(2.0, 1.0, 4.0, 4.0)])
    motion = np.eye(4)
    motion[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
    motion[:2, 3] = 1.0, -2.0
    back = np.linalg.inv(motion)
    first = map_cloud(cloud[cloud[:, 0] < 3.5], 512)
    second = map_cloud(cloud[cloud[:, 0] > 3.0] @ back[:3, :3].T + back[:3, 3], 512)
    joined = join_maps(first, second, motion)
    graph = graph_of(joined, SweptBody(radius=0.2, height=1.0))
    path = plan(graph, np.array([1.0, 2.5]), np.array([5.0, 2.5]))
    tree = cKDTree(cloud[cloud[:, 2] < 0.1][:, :2])
    assert path.is_found
    assert worst_footprint(path.path, tree, np.zeros(len(cloud)), 0.2)[0] <= 0.1
    assert join_maps(first, replace(second, seen_floor=None), motion).seen_floor is None


def test_the_floor_comes_back_from_a_file(tmp_path):
    found = map_cloud(np.concatenate([floor_points(holes=[(2, 1, 3, 3)]), pallet(4, 1, 5, 2)]), 512)
    write_sparse_map(tmp_path / "a.smap", found)
    after = read_sparse_map(tmp_path / "a.smap")[0].seen_floor
    np.testing.assert_array_equal(after.steps, found.seen_floor.steps)
    np.testing.assert_array_equal(after.low, found.seen_floor.low)
    assert after.cell_m == CELL_M
    assert {0, 9} <= set(np.unique(after.steps))
    without = binary_content(replace(found, seen_floor=None))
    assert len(binary_content(found)) < len(without) + 500


@pytest.mark.parametrize(
    ("cells", "message"),
    [
        ("[0,0,9,9,0.05]", "9 x 9 cells in"),
        ("[0,0,-1,9,0.05]", "-1 x 9 cells in"),
        ("[0,0,70000,70000,0.05]", "70000 x 70000 cells"),
        ("[0,0,4,1.5,0.05]", "four whole numbers"),
        ("[0,0,4]", "four whole numbers"),
        ("[900000000,0,4,6,0.05]", "not within 1,000,000 m"),
        ("[0,0,4,6,0.0]", "cells of 0.0 m"),
        ("[0,0,4,6,NaN]", "not within"),
    ],
)
def test_a_file_whose_floor_lies_is_refused_by_its_name(tmp_path, cells, message):
    found = map_cloud(floor_points(), 64)
    content = binary_content(replace(found, seen_floor=SeenFloor(np.zeros((4, 6), np.uint8), np.zeros(2, np.int64))))
    body = zlib.decompress(content[_HEADER.size :]).replace(b"[0,0,4,6,0.05]", cells.encode())
    (length,) = struct.unpack_from("<I", body)
    body = struct.pack("<I", length + len(cells) - 14) + body[4:]
    packed, head = zlib.compress(body), list(_HEADER.unpack_from(content))
    head[-3:] = len(body), len(packed), zlib.crc32(packed)
    path = tmp_path / "lie.smap"
    path.write_bytes(_HEADER.pack(*head) + packed)
    with pytest.raises(ValueError, match=message) as caught:
        read_sparse_map(path)
    assert str(path) in str(caught.value)


def test_steps_that_no_floor_has_are_refused(tmp_path):
    steps = np.full((4, 6), 180, np.uint8)
    found = replace(map_cloud(floor_points(), 64), seen_floor=SeenFloor(steps, np.zeros(2, np.int64)))
    (tmp_path / "a.smap").write_bytes(binary_content(found))
    with pytest.raises(ValueError, match="steps of more than 100 cm"):
        read_sparse_map(tmp_path / "a.smap")


def test_the_command_line_tells_of_maps_that_do_not_know_their_floor(tmp_path, capsys):
    cloud = np.concatenate([floor_points(holes=[(2.5, -1.0, 3.5, 6.0)]), pallet(2.5, 0.0, 3.5, 5.0)])
    np.savez(tmp_path / "cloud.npz", xyz=cloud)
    for name, mode in (("map.smap", "default"), ("map.txt", "thesis")):
        command = ["sparse-map", str(tmp_path / "cloud.npz"), "--mode", mode, "--out", str(tmp_path / name)]
        assert main(command) == 0
    capsys.readouterr()
    request = ["--from", "1,2", "--to", "5,2", "--json"]
    assert main(["plan", str(tmp_path / "map.smap"), *request]) == 3
    assert json.loads(capsys.readouterr().out)["remarks"] == []
    assert main(["plan", str(tmp_path / "map.smap"), *request, "--max-step", "0.1"]) == 0
    capsys.readouterr()
    assert main(["plan", str(tmp_path / "map.txt"), *request]) == 0
    shown = capsys.readouterr()
    assert "does not know which floor was seen" in json.loads(shown.out)["remarks"][0]
    assert "does not know which floor was seen" in shown.err
    assert main(["plan", str(tmp_path / "map.smap"), *request, "--max-step", "-1"]) == 2


def test_a_floor_with_stairs_that_lead_down_is_found():
    cloud = np.concatenate([floor_points(holes=[(1, 1, 3, 3)]), stairs(1, 1, 3, 3)])
    assert abs(find_floor(cloud).offset) < 0.005
