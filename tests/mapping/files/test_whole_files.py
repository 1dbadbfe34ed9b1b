import os

import pytest

from lidarium.mapping.files import output
from lidarium.mapping.files.output import (
    as_json,
    check_writable,
    check_written,
    clear_unfinished,
    whole_file,
    write_json,
)


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


def test_what_a_full_disk_does_not_take_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "file.json"
    write_json(path, {"number": 1})
    before = path.read_bytes()

    def refuse(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(output.os, "fsync", refuse)
    with pytest.raises(OSError, match="No space"):
        write_json(path, {"number": 2})
    assert path.read_bytes() == before
    assert os.listdir(tmp_path) == ["file.json"]


def test_a_link_is_replaced_and_what_it_leads_to_stays(tmp_path):
    (tmp_path / "theirs").write_text("theirs")
    (tmp_path / "file.json").symlink_to(tmp_path / "theirs")
    write_json(tmp_path / "file.json", {})
    assert (tmp_path / "theirs").read_text() == "theirs"


@pytest.mark.skipif(os.name == "nt", reason="modes of files are those of Unix")
def test_who_may_read_a_file_is_as_the_users_mask_says(tmp_path):
    before = os.umask(0o027)
    try:
        write_json(tmp_path / "new" / "file.json", {})
    finally:
        os.umask(before)
    assert (tmp_path / "new" / "file.json").stat().st_mode & 0o777 == 0o640
    assert (tmp_path / "new").stat().st_mode & 0o777 == 0o750


def test_only_what_a_writer_left_is_cleared_away(tmp_path):
    """The fault that was found: ``.git`` and ``.dvc`` went."""
    for name in (".one.npz.a1b2c3d4", ".two.npz.abcdefgh"):
        (tmp_path / name).mkdir()
    (tmp_path / ".one.npz.a1b2c3d4" / "one.npz").write_bytes(b"half")
    kept = [".git", ".dvc", ".one.npz.short", ".one.txt.a1b2c3d4", ".one.npz.A1B2C3D4", ".more.npz.a1b2c3d4"]
    for name in kept:
        (tmp_path / name).mkdir()
        (tmp_path / name / "HEAD").write_text("ref: refs/heads/main")
    (tmp_path / ".file.npz.a1b2c3d4").write_text("a file")
    aim = tmp_path / "aim"
    aim.mkdir()
    (aim / "link.npz").write_text("theirs")
    (tmp_path / ".link.npz.a1b2c3d4").symlink_to(aim)
    clear_unfinished(tmp_path, ".npz")
    left = [*kept, ".file.npz.a1b2c3d4", ".link.npz.a1b2c3d4", "aim"]
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(left)
    assert (aim / "link.npz").exists()


def test_files_that_went_meanwhile_are_told(tmp_path):
    write_json(tmp_path / "one.json", {})
    check_written(tmp_path, ["one.json"])
    with pytest.raises(FileNotFoundError, match="somebody has removed it"):
        check_written(tmp_path, ["one.json", "two.json"])
