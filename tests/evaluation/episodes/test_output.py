import pytest

from lidarium.evaluation.episodes.output import as_json, check_writable, whole_file, write_json


def test_a_file_appears_when_it_is_finished(tmp_path):
    path = tmp_path / "new" / "file.txt"
    with whole_file(path) as beside:
        beside.write_text("half")
        assert beside.suffix == ".txt"
        assert not path.exists()
        beside.write_text("whole")
    assert path.read_text() == "whole"
    assert [entry.name for entry in path.parent.iterdir()] == ["file.txt"]


def fail_while_writing(path):
    with whole_file(path) as beside:
        beside.write_text("new")
        raise RuntimeError("on the way")


def test_a_file_that_fails_leaves_the_old_one_and_nothing_else(tmp_path):
    path = tmp_path / "file.txt"
    path.write_text("old")
    with pytest.raises(RuntimeError, match="on the way"):
        fail_while_writing(path)
    assert path.read_text() == "old"
    assert [entry.name for entry in tmp_path.iterdir()] == ["file.txt"]


def test_json_has_no_numbers_that_are_not_finite(tmp_path):
    with pytest.raises(ValueError, match="JSON"):
        as_json({"value": float("nan")})
    with pytest.raises(ValueError, match="JSON"):
        write_json(tmp_path / "x.json", {"value": float("inf")})
    assert not list(tmp_path.iterdir())


def test_checking_a_folder_leaves_nothing_behind(tmp_path):
    check_writable(tmp_path / "a" / "b")
    check_writable(tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_folder_below_a_file_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(NotADirectoryError, match="file is not a folder"):
        check_writable(tmp_path / "file" / "out")
    with pytest.raises(NotADirectoryError, match="is not a folder"):
        check_writable(tmp_path / "file")
