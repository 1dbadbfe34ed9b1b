"""A cloud becomes a map, and the map answers requests, on the command line."""

import json
from itertools import pairwise

import numpy as np
import pytest
from furnished_room import furniture, room_points

from lidarium.mapping.point_clouds.ply import write_ply
from lidarium.mapping.point_clouds.point_cloud import PointCloud
from lidarium.mapping.sparse.files.map_files import read_sparse_map
from lidarium.scripts.main import main


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    """A cloud of a furnished room, and its map."""
    folder = tmp_path_factory.mktemp("room")
    write_ply(folder / "room.ply", PointCloud(room_points(0.03).astype(np.float32)))
    assert main(["sparse-map", str(folder / "room.ply"), "--out", str(folder / "maps" / "room.smap")]) == 0
    return folder


def test_the_map_and_its_pictures_are_written(room):
    sparse_map, _ = read_sparse_map(room / "maps" / "room.smap")
    assert 10 < len(sparse_map.boxes) < 400
    assert len(sparse_map.free) > 50
    assert {path.name for path in (room / "maps").iterdir()} == {"room.smap", "room.png", "room_3d.png"}


def test_a_path_is_planned_around_the_table(room, tmp_path, capsys):
    arguments = ["--from", "0.7,1.8", "--to", "3.3,1.8", "--radius", "0.2", "--out", str(tmp_path)]
    assert main(["plan", str(room / "maps" / "room.smap"), *arguments, "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["found"]
    assert result["length_m"] > 2.6  # the table stands between
    points = np.array(result["points"])
    top = furniture()[0]
    for a, b in pairwise(points):
        along = a + np.linspace(0.0, 1.0, 200)[:, None] * (b - a)
        gaps = np.maximum(np.maximum(top[0, :2] - along[:, :2], along[:, :2] - top[1, :2]), 0.0)
        assert np.hypot(*gaps.T).min() > 0.2 - 1e-6
    assert {path.name for path in tmp_path.iterdir()} == {"path.json", "path.png", "path_3d.png"}


def test_a_low_robot_goes_under_the_table(room, capsys):
    request = ["--from", "0.7,1.8", "--to", "3.3,1.8", "--radius", "0.2", "--height", "0.5", "--json"]
    assert main(["plan", str(room / "maps" / "room.smap"), *request]) == 0
    assert json.loads(capsys.readouterr().out)["length_m"] == pytest.approx(2.6, abs=0.05)


def test_a_goal_in_the_table_has_no_path_and_exit_code_3(room, capsys):
    assert main(["plan", str(room / "maps" / "room.smap"), "--from", "0.7,1.8", "--to", "2.2,1.8"]) == 3
    assert "goal in collision" in capsys.readouterr().out


def test_frames_with_poses_make_one_map(room, tmp_path):
    points = room_points(0.04)
    for name, half, x in (("left", points[:, 0] < 2.6, 0.0), ("right", points[:, 0] > 2.4, 2.5)):
        write_ply(tmp_path / f"{name}.ply", PointCloud((points[half] - (x, 0.0, 0.0)).astype(np.float32)))
        pose = np.eye(4)
        pose[0, 3] = x
        np.savetxt(tmp_path / f"{name}.txt", pose)
    clouds, poses = (
        [str(tmp_path / f"{name}.{kind}") for name in ("left", "right")] for kind in ("ply", "txt")
    )
    assert main(["sparse-map", *clouds, "--poses", *poses, "--out", str(tmp_path / "map.txt")]) == 0
    assert (tmp_path / "map.txt").read_text().startswith("# sparse-map v1 ")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["missing.ply"], "missing.ply"),
        (["CLOUD", "--poses", "a.txt", "b.txt"], "--poses names 2 files"),
        (["CLOUD", "--up", "up"], "--up is 'up'"),
        (["CLOUD", "--scale", "-1"], "scale"),
        (["CLOUD", "--intrinsics", "1,2"], "--intrinsics is '1,2'"),
        (["CLOUD", "--codes", "1"], "1"),
    ],
)
def test_bad_clouds_are_refused_and_nothing_is_written(room, tmp_path, arguments, message, capsys):
    named = [str(room / "room.ply") if argument == "CLOUD" else argument for argument in arguments]
    out = tmp_path / "out"
    assert main(["sparse-map", *named, "--out", str(out / "map.smap")]) == 2
    assert message in capsys.readouterr().err
    assert not out.exists() or not list(out.iterdir())


@pytest.mark.parametrize("point", ["1", "1,2,3,4", "a,b", "nan,0"])
def test_bad_points_are_refused(room, point, capsys):
    assert main(["plan", str(room / "maps" / "room.smap"), "--from", point, "--to", "1,1"]) == 2
    assert "--from is" in capsys.readouterr().err
