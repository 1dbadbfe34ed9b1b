"""Polygons of HouseExpo as floors."""

import json

import pytest
from imported_floors import connectivity, free_of

from lidarium.envs.floors.importers import load_file


def test_houseexpo_is_free_within_its_polygon(tmp_path):
    corners = [[0.1, 0.1], [4.1, 0.1], [4.1, 2.1], [2.1, 2.1], [2.1, 4.1], [0.1, 4.1]]
    (tmp_path / "house.json").write_text(json.dumps({"verts": corners, "id": "house"}))
    floor = load_file(tmp_path / "house.json")
    assert free_of(floor).sum() * 0.05**2 == pytest.approx(12.0)


@pytest.mark.parametrize(
    "content",
    ["{}", "[1]", '{"verts": [[0, 0], [1, 1]]}', '{"verts": "none"}', '{"verts": [[0, 0], [1, "a"]]}', "{"],
)
def test_houseexpo_without_a_polygon_is_refused(tmp_path, content):
    (tmp_path / "house.json").write_text(content)
    with pytest.raises(ValueError, match=r"verts|JSON"):
        load_file(tmp_path / "house.json")


def test_houses_are_connected(shared_data):
    for path in sorted((shared_data / "floorplans" / "houseexpo").glob("*.json")):
        assert connectivity(free_of(load_file(path), 0.025)) > 0.999
