"""A cloud becomes a map, and the map answers requests, on the command line."""

import json

import numpy as np
import pytest
from furnished_room import room_points
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from lidarium.mapping.point_clouds.ply_files import write_ply
from lidarium.mapping.point_clouds.point_cloud import PointCloud
from lidarium.mapping.sparse.graph import build_graph
from lidarium.mapping.sparse.map_files import read_sparse_map
from lidarium.mapping.sparse.planning import plan
from lidarium.mapping.sparse.swept_body import SweptBody
from lidarium.scripts.main import main


def test_the_map_and_its_pictures_are_written(room):
    sparse_map, _ = read_sparse_map(room / "maps" / "room.smap")
    assert 10 < len(sparse_map.boxes) < 400
    assert len(sparse_map.free) > 50
    assert {path.name for path in (room / "maps").iterdir()} == {"room.smap", "room.png", "room_3d.png"}


def test_frames_with_poses_make_one_map(room, tmp_path):
    points = room_points(0.04)
    for name, half, x in (("left", points[:, 0] < 2.6, 0.0), ("right", points[:, 0] > 2.4, 2.5)):
        write_ply(tmp_path / f"{name}.ply", PointCloud((points[half] - (x, 0.0, 0.0)).astype(np.float32)))
        pose = np.eye(4)
        pose[0, 3] = x
        np.savetxt(tmp_path / f"{name}.txt", pose)
    clouds, poses = ([str(tmp_path / f"{name}.{kind}") for name in ("left", "right")] for kind in ("ply", "txt"))
    command = ["sparse-map", *clouds, "--poses", *poses, "--out", str(tmp_path / "map.txt")]
    assert main(command) == 2  # boxes have sizes, which a text does not keep: paths would lead through walls
    assert main([*command, "--mode", "thesis"]) == 0
    assert (tmp_path / "map.txt").read_text().startswith("# sparse-map v1 ")


def test_points_out_of_range_are_left_out(room, tmp_path):
    path = tmp_path / "near.smap"
    assert main(["sparse-map", str(room / "room.ply"), "--range", "2", "--out", str(path)]) == 0
    near, _ = read_sparse_map(path)
    assert np.hypot(*near.free[:, :2].T).max() <= 2.0 < np.hypot(*room_points(0.03)[:, :2].T).max()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["missing.ply"], "missing.ply"),
        (["CLOUD", "--poses", "a.txt", "b.txt"], "--poses names 2 files"),
        (["CLOUD", "--up", "up"], "--up is 'up'"),
        (["CLOUD", "--scale", "-1"], "scale"),
        (["CLOUD", "--intrinsics", "1,1,1,1"], "--intrinsics is given, but there are no depth images"),
        (["depth.png", "--intrinsics", "1,2"], "--intrinsics is '1,2'"),
        (["CLOUD", "--world-to-camera"], "--world-to-camera is given, but there are no poses"),
        (["CLOUD", "--least-motion", "9"], "--least-motion is given, but a single cloud has no frame before it"),
        (["CLOUD", "CLOUD", "--least-motion", "nan"], "least-motion is nan"),
        (["CLOUD", "--codes", "1"], "1"),
        (["CLOUD", "--range", "-1"], "range_m of the mapper is -1.0"),
        (["CLOUD", "--range", "nan"], "range_m of the mapper is nan"),
    ],
)
def test_bad_clouds_are_refused_and_nothing_is_written(room, tmp_path, arguments, message, capsys):
    named = [str(room / "room.ply") if argument == "CLOUD" else argument for argument in arguments]
    out = tmp_path / "out"
    assert main(["sparse-map", *named, "--out", str(out / "map.smap")]) == 2
    assert message in capsys.readouterr().err
    assert not out.exists() or not list(out.iterdir())


def test_no_path_leads_through_a_wall_of_faces(shared_cases, tmp_path):
    cloud = shared_cases / "cloud-mesh-faces" / "partition.obj"
    assert main(["sparse-map", str(cloud), "--out", str(tmp_path)]) == 0
    assert main(["plan", str(tmp_path / "map.smap"), "--from", "2,3", "--to", "6,3"]) == 3


def test_a_cloud_with_another_axis_upwards_is_doubtful(shared_cases, tmp_path, capsys):
    cloud = str(shared_cases / "cloud-up-axis" / "y_up.obj")
    assert main(["sparse-map", cloud, "--out", str(tmp_path / "a"), "--json"]) == 4
    shown = capsys.readouterr()
    result = json.loads(shown.out)
    assert result["probably_wrong"]
    assert "lies along another axis: --levels --up 0,1,0?" in result["remarks"][0]
    assert result["remarks"][0] in shown.err
    assert main(["sparse-map", cloud, "--levels", "--up", "0,1,0", "--out", str(tmp_path / "b"), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["floor"]["area_m2"] == pytest.approx(24.0, rel=0.15)
    assert result["remarks"] == []


def test_a_map_of_grid_coordinates_is_that_of_the_room_at_an_offset(shared_cases, tmp_path, capsys):
    maps = {}
    for name in ("grid", "local"):
        cloud = str(shared_cases / "cloud-grid-coordinates" / f"{name}.ply")
        assert main(["sparse-map", cloud, "--out", str(tmp_path / name), "--json"]) == 0
        maps[name] = read_sparse_map(tmp_path / name / "map.smap")[0]
        result = json.loads(capsys.readouterr().out)
        assert result["offset"] == ([530_000.0, 181_000.0, 0.0] if name == "grid" else [0.0, 0.0, 0.0])
        assert len(result["remarks"]) == (name == "grid")
    assert len(maps["grid"].free) == len(maps["local"].free)
    low, high = (maps["grid"].free - np.array([0.0, 0.0, 35.0]), maps["local"].free)
    assert cKDTree(low).query(high)[0].max() < 0.05


def test_all_frames_that_are_named_are_used(shared_cases, tmp_path, capsys):
    folder = shared_cases / "cloud-frame-left-out"
    clouds, poses = [str(folder / f"frame_{k}.npz") for k in "ab"], [str(folder / f"pose_{k}.txt") for k in "ab"]
    request = ["sparse-map", *clouds, "--poses", *poses, "--out", str(tmp_path / "map.smap"), "--json"]
    assert main(request) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["frames"] == {"all": 2, "used": 2}
    assert result["agreement"] > 0.99
    assert result["unlike_points"] == {"points": 0, "boxes": 0}
    found, _ = read_sparse_map(tmp_path / "map.smap")
    graph = build_graph(found.free, found.boxes, SweptBody(radius=0.3))
    assert plan(graph, np.array([2.2, 0.7]), np.array([4.2, 0.7])).length == pytest.approx(2.17, abs=0.02)
    # The floor around the first point was seen by neither frame.
    graph = build_graph(found.free, found.boxes, SweptBody(radius=0.3), floor=found.seen_floor)
    assert plan(graph, np.array([2.2, 0.7]), np.array([4.2, 0.7])).reason == "start without floor"
    clouds, poses = [clouds[0], *clouds], [poses[0], *poses]
    request = ["sparse-map", *clouds, "--poses", *poses, "--out", str(tmp_path / "map.smap"), "--json"]
    assert main([*request, "--least-motion", "0.1"]) == 0
    assert json.loads(capsys.readouterr().out)["frames"] == {"all": 3, "used": 2}


def test_frames_that_contradict_each_other_are_refused(shared_cases, tmp_path, capsys):
    folder = shared_cases / "cloud-phantom-boxes"
    clouds, poses = [str(folder / f"depth_{k}.png") for k in "01"], [str(folder / f"pose_{k}.txt") for k in "01"]
    request = ["sparse-map", *clouds, "--intrinsics", "525,525,319.5,239.5", "--out", str(tmp_path / "map.smap")]
    inverse = []
    for k, path in enumerate(poses):
        inverse.append(str(tmp_path / f"{k}.txt"))
        np.savetxt(inverse[-1], np.linalg.inv(np.loadtxt(path)))
    # As given they have no floor, or contradict.
    assert main([*request, "--poses", *inverse, "--world-to-camera"]) == 0
    assert (tmp_path / "map.smap").exists()
    (tmp_path / "map.smap").unlink()
    capsys.readouterr()
    assert main([*request, "--poses", poses[0], poses[0]]) == 2
    assert "frames contradict each other: of what they see twice" in capsys.readouterr().err
    assert not (tmp_path / "map.smap").exists()


@pytest.mark.parametrize(("focal", "change"), [(472.5, "8% longer"), (525.0, None), (577.5, "8% shorter")])
def test_a_focal_length_that_is_wrong_by_a_tenth_is_told(shared_cases, tmp_path, capsys, focal, change):
    folder = shared_cases / "cloud-phantom-boxes"
    clouds, poses = [str(folder / f"depth_{k}.png") for k in "01"], [str(folder / f"pose_{k}.txt") for k in "01"]
    request = ["sparse-map", *clouds, "--poses", *poses, "--intrinsics", f"{focal},{focal},319.5,239.5"]
    assert main([*request, "--out", str(tmp_path / "map.smap")]) == (4 if change else 0)
    told = capsys.readouterr().err
    assert ("are --intrinsics theirs?" in told) == bool(change)
    assert not change or f"with a focal length {change}" in told


def test_a_folder_of_tum_becomes_a_map(shared_cases, tmp_path, capsys):
    folder, data = shared_cases / "cloud-phantom-boxes", tmp_path / "tum"
    data.mkdir()
    truth, depth = [], []
    for k in range(2):
        (data / f"{k}.png").write_bytes((folder / f"depth_{k}.png").read_bytes())
        pose = np.loadtxt(folder / f"pose_{k}.txt")
        x, y, z, w = Rotation.from_matrix(pose[:3, :3]).as_quat()
        truth.append(f"{k}.01 {pose[0, 3]} {pose[1, 3]} {pose[2, 3]} {x} {y} {z} {w}")
        depth.append(f"{k}.0 {k}.png")
    (data / "depth.txt").write_text("\n".join(depth))
    (data / "groundtruth.txt").write_text("\n".join(truth))
    request = ["sparse-map", str(data), "--intrinsics", "525,525,319.5,239.5", "--out", str(tmp_path / "map.smap")]
    assert main([*request, "--scale", "0.001", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["frames"] == {"all": 2, "used": 2}
    assert result["floor"]["area_m2"] > 10.0
    assert main([*request, "--poses", str(folder / "pose_0.txt")]) == 2
    assert "is a folder with poses" in capsys.readouterr().err


def test_a_cloud_with_little_floor_has_a_map_if_its_share_is_given(tmp_path, capsys):
    x, y = np.meshgrid(np.arange(0.0, 2.0, 0.04), np.arange(0.0, 2.0, 0.04))
    floor = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    rng = np.random.default_rng(0)
    clutter = rng.normal((6.0, 6.0, 3.0), (2.0, 2.0, 0.6), (200_000, 3))
    np.savez(tmp_path / "cloud.npz", xyz=np.concatenate([floor, clutter]))
    request = ["sparse-map", str(tmp_path / "cloud.npz"), "--out", str(tmp_path / "map.smap")]
    assert main(request) == 2
    assert "a smaller share (--floor-share)" in capsys.readouterr().err
    assert main([*request, "--floor-share", "0.005"]) in (0, 4)
