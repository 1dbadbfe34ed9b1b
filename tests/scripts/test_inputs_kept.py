"""Commands do not overwrite their input files, and remove files of earlier runs."""

import shutil

import cv2
import numpy as np
import pytest
from drawn_maps import RESOLUTION, apartment, blank, kept, room

from lidarium.mapping.files.map_files import write_ros_map
from lidarium.scripts.main import main


@pytest.fixture
def folder(tmp_path):
    """Two maps, a plain image and a log, by names that commands write."""
    for name, columns in (("map", slice(0, 150)), ("other", slice(58, 220))):
        write_ros_map(tmp_path, name, kept(apartment(), slice(0, 180), columns), (0.0, 0.0, 0.0), RESOLUTION)
    cv2.imwrite(str(tmp_path / "plan.png"), apartment())
    (tmp_path / "trajectory.tum").write_text("0 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n")
    for name in ("bound.png", "map.png", "map_3d.png", "edited.smap", "path.json"):
        (tmp_path / name).write_bytes(b"refused before it is read")
    np.savez(tmp_path / "log.npz", ranges=np.full((9, 36), 3.0), angle_min=-np.pi, angle_increment=np.pi / 18)
    return tmp_path


@pytest.mark.parametrize(
    ("words", "name"),
    [
        ("merge map.yaml other.yaml", "map.yaml"),
        ("merge other.yaml link.yaml", "map.pgm"),
        ("predict other.yaml", "other.yaml"),
        ("slam log.npz --reference trajectory.tum", "trajectory.tum"),
        ("run --floor map.yaml --horizon-s 1", "map.yaml"),
        ("floors show plan.png --resolution 0.05", "plan.png"),
        ("floors import other.yaml", "other.yaml"),
        ("bound bound.png --resolution 0.05", "bound.png"),
        ("sparse-map map_3d.png --intrinsics 50,50,32,24", "map_3d.png"),
        ("sparse-map frames/cloud.txt --poses map.png", "map.png"),
        ("sparse-map-edit edited.smap --add 0,0,0,1,1,1", "edited.smap"),
        ("plan path.json --from 0,0 --to 1,1", "path.json"),
    ],
)
def test_no_command_writes_over_what_it_reads(words, name, folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    shutil.copy("map.yaml", "link.yaml")  # a header of another name with the same image
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert main([*words.split(), "--out", "."]) == 2
    assert f"{name} is read, and would be overwritten" in capsys.readouterr().err
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


@pytest.mark.parametrize(
    ("words", "name"),
    [
        ("merge in/map.yaml in/other.yaml", "map.yaml"),
        ("merge in/map.yaml in/other.yaml", "map-2.pgm"),
        ("predict in/other.yaml", "other.pgm"),
        ("slam in/log.npz", "map.pgm"),
        ("run --floor in/map.yaml --horizon-s 1", "merged.yaml"),
        ("floors show in/plan.png --resolution 0.05", "plan.json"),
        ("floors import in/other.yaml", "other.png"),
        ("bound in/map.yaml", "bound.png"),
        ("plan in/edited.smap --from 0,0 --to 1,1", "path.png"),
    ],
)
def test_no_command_replaces_files_of_others(words, name, folder, monkeypatch, capsys):
    """Another program's result of the same name makes them no files of the command."""
    monkeypatch.chdir(folder)
    (folder / "out").mkdir()
    shutil.copytree(folder, folder / "in", ignore=lambda *_: ["in", "out"])
    for other in (name, "result.json", "transforms.json", "slam.json"):
        (folder / "out" / other).write_text('{"mine": 1}')
    assert main([*words.split(), "--out", "out"]) == 2
    assert "was not written by this command, and would be replaced" in capsys.readouterr().err
    kept = (name, "result.json", "transforms.json", "slam.json")
    assert {path.name: path.read_text() for path in (folder / "out").iterdir()} == dict.fromkeys(kept, '{"mine": 1}')


def test_a_merge_replaces_no_map_of_a_run(folder, tmp_path, capsys):
    out = tmp_path / "run"
    run = "run --floor scene_room --policy nearest_frontier --robots 2 --unknown-starts --horizon-s 2 --out"
    assert main([*run.split(), str(out)]) == 0
    before = (out / "map.pgm").read_bytes()
    assert (out / "transforms.json").exists()
    assert main(["merge", str(folder / "map.yaml"), str(folder / "other.yaml"), "--out", str(out)]) == 2
    assert "was not written by this command" in capsys.readouterr().err
    assert (out / "map.pgm").read_bytes() == before


def test_maps_that_do_not_join_leave_no_map_of_those_that_did(folder, tmp_path):
    out, elsewhere = tmp_path / "out", room(blank(), 20, 20, 90, 130)
    far = write_ros_map(folder, "far", elsewhere, (0.0, 0.0, 0.0), RESOLUTION)
    assert main(["merge", str(folder / "map.yaml"), str(folder / "other.yaml"), "--out", str(out)]) == 0
    assert (out / "map.pgm").exists()
    for name in ("map-of-mine.txt", "map-kitchen.yaml", "map-kitchen.pgm"):
        (out / name).write_text("kept")
    assert main(["merge", str(folder / "map.yaml"), str(far), "--out", str(out)]) == 3
    kept_ones = ["map-kitchen.pgm", "map-kitchen.yaml", "map-of-mine.txt"]
    assert sorted(path.name for path in out.iterdir()) == [*kept_ones, "merge.png", "transforms.json"]


def test_a_run_alone_leaves_no_map_of_an_earlier_team(tmp_path, capsys):
    for robots in ("2 --record", "1"):
        (tmp_path / "robot_closeup.png").write_bytes(b"mine")
        words = f"run --floor scene_room --policy nearest_frontier --robots {robots} --horizon-s 2 --out"
        assert main([*words.split(), str(tmp_path)]) == 0
    assert "removed files of an earlier run from" in capsys.readouterr().err
    assert not list(tmp_path.glob("robot_1.*"))
    assert not (tmp_path / "transforms.json").exists()
    assert not (tmp_path / "episode.npz").exists()
    assert (tmp_path / "robot_0.yaml").exists()
    assert (tmp_path / "robot_closeup.png").read_bytes() == b"mine"


def test_a_map_of_a_run_is_not_the_floor_of_a_run_into_the_same_folder(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    options = ["--policy", "nearest_frontier", "--robots", "1", "--horizon-s", "1"]
    write_ros_map(tmp_path, "map", apartment(), (0.0, 0.0, 0.0), RESOLUTION)
    main(["run", "--floor", "map.yaml", *options])
    floor = tmp_path / "runs" / "map-nearest_frontier-0" / "map.yaml"
    before = floor.read_bytes()
    assert main(["run", "--floor", str(floor), *options]) == 2
    assert "is read, and would be overwritten" in capsys.readouterr().err
    assert floor.read_bytes() == before
