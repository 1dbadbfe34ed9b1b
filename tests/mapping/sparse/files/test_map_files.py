"""Names and first bytes of files say their form."""

import os

import numpy as np
import pytest
from made_sparse_maps import some_map

from lidarium.mapping.sparse.files.binary_form import (
    GraphEdges,
    binary_content,
)
from lidarium.mapping.sparse.files.map_files import read_sparse_map, write_sparse_map
from lidarium.mapping.sparse.files.text_form import text_content
from lidarium.mapping.sparse.sparse_map import SparseMap, free_codes, occupied_codes


def test_binary_is_a_third_of_the_thesis_form():
    known = some_map(400)
    assert 3 * len(binary_content(known)) < len(text_content(known))


def test_names_say_the_form(tmp_path):
    known = some_map()
    for name in ("room.txt", "room.smap"):
        write_sparse_map(tmp_path / name, known)
        assert len(read_sparse_map(tmp_path / name)[0].occupied) == 60
    with pytest.raises(ValueError, match=r"want one that ends in \.smap or \.txt"):
        write_sparse_map(tmp_path / "room.map", known)
    with pytest.raises(ValueError, match="keeps no graph"):
        write_sparse_map(tmp_path / "g.txt", known, GraphEdges(np.zeros((1, 3)), np.empty((0, 2), int)))
    assert sorted(os.listdir(tmp_path)) == ["room.smap", "room.txt"]
    with pytest.raises(FileNotFoundError, match="there is no file"):
        read_sparse_map(tmp_path / "none.smap")


def test_a_map_that_cannot_be_written_leaves_nothing(tmp_path):
    far = SparseMap(occupied=occupied_codes(np.full((1, 2, 3), 1e7)), ground=free_codes([]))
    for name in ("far.smap", "far.txt"):
        with pytest.raises(ValueError, match="1,000,000 m"):
            write_sparse_map(tmp_path / name, far)
    assert os.listdir(tmp_path) == []


def test_a_text_with_the_name_of_a_binary_file_is_refused(tmp_path):
    path = tmp_path / "map.smap"
    path.write_text(text_content(some_map()))
    with pytest.raises(ValueError, match="it begins with"):
        read_sparse_map(path)
