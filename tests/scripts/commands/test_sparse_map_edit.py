"""Sparse maps are edited on the command line."""

import json

import numpy as np
import pytest

from lidarium.mapping.sparse.map_files import read_sparse_map, write_sparse_map
from lidarium.mapping.sparse.sparse_map import SparseMap, free_codes, occupied_codes
from lidarium.scripts.main import main

BOX = np.array([[[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]]])


@pytest.fixture
def before(tmp_path):
    path = tmp_path / "before.smap"
    write_sparse_map(path, SparseMap(occupied=occupied_codes(BOX), ground=free_codes(np.array([[2.0, 2.0, 0.0]]))))
    return path


def holds(sparse_map, point):
    boxes = sparse_map.boxes
    return bool(((boxes[:, 0] <= point) & (point <= boxes[:, 1])).all(axis=1).any())


def test_boxes_are_cleared_then_added(before, tmp_path, capsys):
    content = before.read_bytes()
    out = tmp_path / "after.smap"
    boxes = ["--remove", "0.5,-1,-1,2,2,2", "--add", "3,3,0,4,4,1", "--add", "5,5,0,6,6,1"]
    assert main(["sparse-map", "edit", str(before), *boxes, "--out", str(out), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    found, _ = read_sparse_map(out)
    assert holds(found, [0.25, 0.5, 0.5])
    assert not holds(found, [0.75, 0.5, 0.5])
    assert holds(found, [3.5, 3.5, 0.5])
    assert holds(found, [5.5, 5.5, 0.5])
    assert result["occupied"] == len(found.boxes) == 3
    assert result["before"] == {"occupied": 1, "free": 1}
    assert before.read_bytes() == content
    assert (tmp_path / "after.png").is_file()
    assert (tmp_path / "after_3d.png").is_file()


def test_another_map_is_joined_where_it_stands(before, tmp_path):
    out = tmp_path / "joined"
    joined = ["--join", str(before), "--at", f"10,0,{np.pi / 2.0}"]
    assert main(["sparse-map", "edit", str(before), *joined, "--out", str(out)]) == 0
    found, _ = read_sparse_map(out / "edited.smap")
    assert holds(found, [0.5, 0.5, 0.5])
    # Turned by a right angle about its origin, the other box reaches from x = 9 to x = 10.
    assert holds(found, [9.5, 0.5, 0.5])
    assert not holds(found, [10.5, 0.5, 0.5])
    assert np.abs(found.free - [8.0, 2.0, 0.0]).max(axis=1).min() < 0.01


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ([], "want --add, --remove or --join"),
        (["--add", "0,0,0,1,1"], "want 6 finite numbers"),
        (["--add", "1,0,0,0,1,1"], "want low before high"),
        (["--remove", "0,0,0,nan,1,1"], "want 6 finite numbers"),
        (["--join", "nowhere.smap"], "nowhere.smap"),
        (["--join", "nowhere.smap", "--at", "1,2"], "want 3 or 4 finite numbers"),
    ],
)
def test_what_is_no_good_is_named_and_nothing_is_written(before, tmp_path, capsys, options, said):
    out = tmp_path / "out"
    assert main(["sparse-map", "edit", str(before), *options, "--out", str(out)]) == 2
    assert said in capsys.readouterr().err
    assert not out.exists()
