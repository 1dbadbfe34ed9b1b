"""What a floor leaves: a map, a picture and figures."""

import json

import numpy as np
import pytest

from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.mapping.files.map_files import read_ros_map
from lidarium.scripts.common import Command
from lidarium.scripts.output.floor_files import (
    _levels,
    check_out,
    floor_description,
    write_floor,
    write_result,
)


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
    assert "none, cells of an image" in text
    assert "note" not in text
    assert "scale was assumed" in floor_description(
        {**result, "remark": "scale was assumed"}, None, [], "a hall"
    )


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
