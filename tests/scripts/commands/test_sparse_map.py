"""A cloud becomes a map, and the map answers requests, on the command line."""

import json

import numpy as np
import pytest
from furnished_room import room_points
from scipy.spatial import cKDTree

from lidarium.mapping.point_clouds.ply_files import write_ply
from lidarium.mapping.point_clouds.point_cloud import PointCloud
from lidarium.mapping.sparse.map_files import read_sparse_map
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
    assert main(["sparse-map", *clouds, "--poses", *poses, "--out", str(tmp_path / "map.txt")]) == 0
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
        (["CLOUD", "--intrinsics", "1,2"], "--intrinsics is '1,2'"),
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
