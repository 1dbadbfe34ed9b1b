import gzip
import math

import pytest
from imported_floors import room, write_map

from lidarium.envs.floors.importers import load_file


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.txt", "0 0 1 0 wall\n", "doors give the scale"),
        ("a.txt", "0 0 1 0 wall\n0 0 1\n", "line 2"),
        ("a.txt", "0 0 1\n", "content of no known floor format"),
        ("a.txt", "", "content of no known floor format"),
        ("a.vectormap.txt", "", "no lines"),
        ("a.vectormap.txt", "1,2,3,4\n1,2,x,4\n", "line 2"),
        ("a.vectormap.txt", "1,2,3,nan\n", "line 1"),
    ],
)
def test_text_that_is_no_drawing_is_refused(tmp_path, name, content, message):
    (tmp_path / name).write_text(content)
    with pytest.raises(ValueError, match=message):
        load_file(tmp_path / name)


def test_missing_files_folders_and_unknown_formats_are_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match="no file"):
        load_file(tmp_path / "none.png")
    with pytest.raises(ValueError, match="folder"):
        load_file(tmp_path)
    (tmp_path / "floor.doc").write_text("")
    with pytest.raises(ValueError, match=r"no known floor format; want a file that ends in .*\.yaml"):
        load_file(tmp_path / "floor.doc")
    (tmp_path / "LICENCE.txt").write_text("Free to use.")
    with pytest.raises(ValueError, match=r"content of no known floor format; want amrl or lifull"):
        load_file(tmp_path / "LICENCE.txt")
    for name in ("a.png", "a.npy", "a.npz"):
        (tmp_path / name).write_bytes(b"nothing of the kind")
        with pytest.raises(ValueError, match=name):
            load_file(tmp_path / name, 0.1)


@pytest.mark.parametrize("name", ["a.xml.gz", "a.txt.gz", "a.vectormap.txt.gz", "a.json.gz"])
@pytest.mark.parametrize(
    "content",
    [gzip.compress(b"0,0,1,1\n" * 99, mtime=0)[:-9], b"not packed", gzip.compress(b"\xff\xfe\x00", mtime=0)],
)
def test_damaged_packed_files_are_refused(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ValueError, match=r"damaged or truncated|not a text file"):
        load_file(tmp_path / name)


@pytest.mark.parametrize("resolution", [0.0, -0.05, math.nan, math.inf])
def test_a_resolution_that_is_not_positive_is_refused(tmp_path, resolution):
    with pytest.raises(ValueError, match="resolution is"):
        load_file(write_map(tmp_path, room()), resolution)


def test_a_resolution_for_a_file_with_its_own_scale_is_refused(tmp_path):
    with pytest.raises(ValueError, match="its own scale"):
        load_file(write_map(tmp_path, room()), 0.1)
