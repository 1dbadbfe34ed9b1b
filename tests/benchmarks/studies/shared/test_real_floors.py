"""Real floors below a folder, by kind."""

import json

import pytest

from lidarium.benchmarks.studies.shared.study import compared_floors, real_floors


def test_floors_are_found_by_kind_and_only_connected_ones_of_kth(tmp_path):
    kth, apartments = tmp_path / "floorplans" / "kth" / "xml", tmp_path / "floorplans" / "lifull" / "txt"
    for path in (kth / "a.xml.gz", kth / "b.xml.gz", apartments / "c.txt"):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    meta = {"a": {"conn": 0.9}, "b": {"conn": 0.5}}
    (tmp_path / "floorplans" / "kth" / "meta.json").write_text(json.dumps(meta))
    found = real_floors(tmp_path)
    assert found["kth"] == [kth / "a.xml.gz"]
    assert found["lifull"] == [apartments / "c.txt"]
    assert not found["slam"]
    assert not found["dungeon"]


def test_policies_are_compared_on_floors_that_no_setting_was_chosen_on(tmp_path):
    apartments, maps = tmp_path / "floorplans" / "lifull" / "txt", tmp_path / "slam_maps"
    for path in (apartments / "a.txt", apartments / "b.txt", apartments / "c.txt", maps / "d.yaml"):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    found = compared_floors(tmp_path)
    assert found["lifull"] == [str(apartments / "b.txt")]
    assert found["slam"] == [str(maps / "d.yaml")]
    assert compared_floors(None) == {}


def test_a_folder_without_any_is_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match="no real floors"):
        real_floors(tmp_path)
