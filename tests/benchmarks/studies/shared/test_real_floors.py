"""Real floors below a folder, by kind."""

import json

import pytest

from lidarium.benchmarks.studies.shared.study import real_floors


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


def test_a_folder_without_any_is_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match="no real floors"):
        real_floors(tmp_path)
