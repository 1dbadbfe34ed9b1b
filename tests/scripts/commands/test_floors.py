"""Floors: the catalogue, their files and pictures, floors made ahead."""

import importlib
import json

import cv2
import numpy as np
import pytest

from lidarium.envs.floors.catalogue import names as catalogue
from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.envs.floors.catalogue.store import FOLDER_VARIABLE
from lidarium.mapping.files.map_files import read_ros_map
from lidarium.scripts.commands import floors
from lidarium.scripts.commands.floors import (
    _levels,
    check_out,
    floor_description,
    write_floor,
    write_result,
)
from lidarium.scripts.common import Command
from lidarium.scripts.main import main


def test_the_list_names_floors_kinds_and_sets(capsys):
    assert main(["floors", "list"]) == 0
    told = capsys.readouterr().out
    assert all(
        word in told for word in ("apartment", "clinic", "scene_loop_corridor", "office:SEED", "set:validation", "200")
    )


def test_the_list_is_json_too(capsys, tmp_path):
    assert main(["floors", "list", "--json", "--out", str(tmp_path)]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["sets"]["train"]["floors"] == 10_000
    assert result == json.loads((tmp_path / "floors.json").read_text())


def test_a_map_too_coarse_for_its_floor_is_doubtful(tmp_path, capsys):
    command = ["floors", "generate", "--seed", "3", "--kind", "apartment", "--out", str(tmp_path), "--json"]
    assert main([*command, "--map-resolution", "0.5"]) == 4
    assert "in cells of 0.5 m the map has" in json.loads(capsys.readouterr().out)["remark"]
    assert main([*command, "--map-resolution", "0.05"]) == 0


def test_a_floor_is_told_in_figures_and_drawn(capsys, tmp_path):
    assert main(["floors", "show", "apartment"]) == 0
    assert "free area" in capsys.readouterr().out
    assert main(["floors", "show", "apartment", "--json", "--out", str(tmp_path)]) == 0
    assert json.loads(capsys.readouterr().out)["sha256"] == load_floor("apartment").sha256
    assert sorted(path.name for path in tmp_path.iterdir()) == ["apartment.json", "apartment.png"]


def test_a_generated_floor_is_a_ros_map_that_can_be_explored(tmp_path, capsys):
    arguments = [
        "floors",
        "generate",
        "--kind",
        "apartment",
        "--area",
        "45",
        "--loops",
        "0.2",
        "--clutter",
        "0.1",
        "--seed",
        "7",
    ]
    assert main([*arguments, "--out", str(tmp_path), "--json"]) == 0
    figures = json.loads(capsys.readouterr().out)
    assert figures["name"] == "apartment:7"
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        f"apartment-7.{kind}" for kind in ("json", "pgm", "png", "yaml")
    ]
    assert cv2.imread(str(tmp_path / "apartment-7.png")) is not None
    assert (
        main(
            [
                "run",
                "--floor",
                str(tmp_path / "apartment-7.yaml"),
                "--robots",
                "1",
                "--horizon-s",
                "5",
                "--out",
                str(tmp_path / "run"),
            ]
        )
        == 0
    )


def test_the_ros_map_of_a_floor_has_its_free_cells(tmp_path):
    assert (
        main(
            [
                "floors",
                "generate",
                "--kind",
                "corridors",
                "--seed",
                "2",
                "--out",
                str(tmp_path),
                "--map-resolution",
                "0.05",
            ]
        )
        == 0
    )
    found = read_ros_map(tmp_path / "corridors-2.yaml")
    raster = load_floor("corridors:2").raster(0.05, 0.3, 0.3)
    assert ((found.levels == 255) == (raster.solid == 0)).all()
    assert found.origin[:2] == raster.origin


def test_a_dungeon_is_imported(shared_data, tmp_path, capsys):
    path = sorted((shared_data / "floorplans" / "synthetic_dungeon").glob("*.png"))[0]
    assert main(["floors", "import", str(path), "--out", str(tmp_path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["area_m2"] > 10.0
    assert (tmp_path / f"{path.stem}.yaml").exists()


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["generate", "--kind", "castle"], "castle"),
        (["generate", "--area", "5"], "area_m2 is 5"),
        (["generate", "--loops", "2"], "loops is 2"),
        (["generate", "--map-resolution", "0"], "resolution is 0"),
        (["generate", "--map-resolution", "50"], "map-resolution is 50.0 m, by which no cell is free"),
        (["show", "apartmnt"], "did you mean 'apartment'?"),
        (["show", "set:train"], "is a set"),
    ],
)
def test_floors_that_cannot_be_are_refused(arguments, word, tmp_path, capsys):
    assert main(["floors", *arguments, "--out", str(tmp_path / "out")]) == 2
    told = capsys.readouterr()
    assert word in told.err
    assert told.out == ""
    assert not (tmp_path / "out").exists()


@pytest.fixture
def store(tmp_path, monkeypatch):
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path / "store"))
    monkeypatch.setattr(catalogue, "SETS", {"few": (5, 3)})
    # A floor that this process has loaded before would not be stored again.
    catalogue._load_named.cache_clear()
    return tmp_path / "store"


def test_a_set_is_prepared_once(store, tmp_path, capsys):
    for made in (3, 0):
        assert main(["floors", "prepare", "set:few", "--json", "--out", str(tmp_path / "out")]) == 0
        result = json.loads(capsys.readouterr().out)
        assert (result["floors"], result["prepared"], result["made"], result["is_interrupted"]) == (
            3,
            3,
            made,
            False,
        )
        assert result["folder"] == str(store)
        assert result == json.loads((tmp_path / "out" / "prepared.json").read_text())
    assert len([path for path in store.rglob("*") if path.is_file()]) == 6


def test_an_interrupted_preparation_keeps_what_it_has_and_goes_on(store, monkeypatch, capsys):
    prepare = floors._prepared

    def interrupted(spec, **heights):
        if spec == "building:7":
            raise KeyboardInterrupt
        return prepare(spec, **heights)

    monkeypatch.setattr(floors, "_prepared", interrupted)
    assert main(["floors", "prepare", "set:few"]) == 130
    assert "2 of 3" in capsys.readouterr().out
    monkeypatch.setattr(floors, "_prepared", prepare)
    assert main(["floors", "prepare", "set:few", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["made"] == 1


def test_several_workers_prepare_the_same(store, capsys):
    assert main(["floors", "prepare", "set:few", "--workers", "2", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["made"] == 3
    assert main(["floors", "prepare", "set:few", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["made"] == 0


def test_a_killed_worker_ends_the_preparation_with_what_to_do(store, tmp_path, monkeypatch, capsys):
    (tmp_path / "killing.py").write_text(
        "import os, signal\n\ndef prepared(spec, **heights):\n    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(floors, "_prepared", importlib.import_module("killing").prepared)
    assert main(["floors", "prepare", "set:few", "--workers", "2"]) == 2
    told = capsys.readouterr()
    assert "a worker was killed" in told.err
    assert "at least 0 of 3 floors are ready" in told.err
    assert "fewer --workers than 2" in told.err
    assert told.out == ""


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["set:fw"], "did you mean 'few'"),
        (["apartmant"], "did you mean 'apartment'"),
        (["apartment", "--workers", "0"], "workers is 0"),
        (["apartment", "--lidar", "sonar"], "sonar"),
        (["apartment", "--raster-resolution", "0"], "resolution is 0"),
    ],
)
def test_preparations_that_cannot_be_are_refused(arguments, word, store, capsys):
    assert main(["floors", "prepare", *arguments]) == 2
    assert word in capsys.readouterr().err


def test_without_a_store_there_is_nothing_to_prepare(monkeypatch, capsys):
    monkeypatch.setenv(FOLDER_VARIABLE, "off")
    assert main(["floors", "prepare", "apartment"]) == 2
    assert FOLDER_VARIABLE in capsys.readouterr().err


def test_a_map_shows_the_skin_of_walls_and_not_their_inside():
    solid = np.ones((1, 12), np.uint8)
    solid[0, :3] = 0
    assert _levels(solid, 0.05).tolist() == [[255, 255, 255, 0, 0, *[127] * 7]]
    assert _levels(solid, 0.5).tolist() == [[255, 255, 255, 0, *[127] * 8]]


def test_a_floor_is_written_with_its_figures(tmp_path):
    floor = load_floor("apartment")
    answer = write_floor(Command(out=tmp_path), floor, 0.05)
    names = {"apartment.yaml", "apartment.pgm", "apartment.png", "apartment.json"}
    assert {path.name for path in tmp_path.iterdir()} == names
    assert json.loads((tmp_path / "apartment.json").read_text()) == answer.result
    assert all(name in answer.text for name in names)
    ros_map = read_ros_map(tmp_path / "apartment.yaml")
    raster = floor.raster(0.05, 0.3, 0.3)
    assert np.array_equal(ros_map.levels == 255, raster.solid == 0)


def test_facts_name_what_was_assumed():
    result = {
        "name": "hall",
        "size_m": (4.0, 2.5),
        "area_m2": 9.87,
        "reachable_m2": 9.5,
        "whole_m2": 12.0,
        "rooms": 1,
        "loops": 0,
        "clutter": 0.125,
        "solids": 0,
        "sha256": "ab",
        "remark": "",
    }
    text = floor_description(result, None, [])
    assert text.startswith("hall\n")
    assert "4 x 2.5 m" in text
    assert "12.5 %" in text
    assert "9.5 m2 of 12.0 m2" in text
    assert "none, cells of an image" in text
    assert "note" not in text
    assert "scale was assumed" in floor_description({**result, "remark": "scale was assumed"}, None, [], "a hall")


def test_results_go_to_out_where_it_is_given(tmp_path):
    write_result(Command(), "a.json", {"a": 1})
    write_result(Command(out=tmp_path), "a.json", {"a": 1})
    write_result(Command(out=tmp_path), "a.json", {"a": 2}, tmp_path / "b")
    assert json.loads((tmp_path / "a.json").read_text()) == {"a": 1}
    assert json.loads((tmp_path / "b" / "a.json").read_text()) == {"a": 2}


def test_an_out_that_is_a_file_is_refused(tmp_path):
    check_out(Command())
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match="file"):
        check_out(Command(out=tmp_path / "file"))


def test_layers_meshes_and_what_cannot_be_reached_are_told(shared_cases, tmp_path, capsys):
    flat = str(shared_cases / "dxf-layers-and-doors" / "flat.dxf")
    assert main(["floors", "show", flat, "--json"]) == 4
    assert "cannot be reached and are left out" in json.loads(capsys.readouterr().out)["remark"]
    assert main(["floors", "import", flat, "--layers", "A-WALL", "--out", str(tmp_path / "flat"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["area_m2"] == pytest.approx(77.5, abs=0.05)
    assert main(["floors", "show", flat, "--layers", "A-WALL", "--layers", "A-FURN", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["area_m2"] == pytest.approx(75.3, abs=0.05)
    hall = str(shared_cases / "sdf-frames-and-meshes" / "two_meshes.world")
    assert main(["floors", "show", hall]) == 2
    assert "--skip-meshes leaves them out" in capsys.readouterr().err
    assert main(["floors", "show", hall, "--skip-meshes"]) == 0
    assert "2 collisions are left out" in capsys.readouterr().out
    assert main(["floors", "show", "apartment", "--skip-meshes"]) == 2


def test_a_run_tells_what_of_a_drawing_cannot_be_reached(shared_cases, tmp_path, capsys):
    flat = str(shared_cases / "dxf-layers-and-doors" / "flat.dxf")
    asked = ["run", "--floor", flat, "--robots", "1", "--horizon-s", "1", "--out", str(tmp_path), "--json"]
    assert main(asked) == 4
    told, error = capsys.readouterr()
    assert "flat: 37.6 m2 in 4 other areas cannot be reached and are left out; 33.8 of 71.8 m2 can" in error
    result = json.loads(told)
    assert result["floor_reachable_m2"] == pytest.approx(33.8, abs=0.05)
    assert result["floor_whole_m2"] == pytest.approx(71.8, abs=0.05)
    assert main([*asked, "--starts", "7.5,3.5,0"]) == 0  # in another room
    assert "33.8 of" not in capsys.readouterr().err
