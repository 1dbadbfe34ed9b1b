"""Files that are there whole or not at all."""

import os

import pytest

from lidarium.mapping.files import output as files
from lidarium.mapping.files.output import remove_unfinished, write_whole


def test_a_file_is_whole_and_nothing_is_left_beside(tmp_path):
    path = tmp_path / "file"
    write_whole(path, b"one")
    write_whole(path, b"two")
    assert path.read_bytes() == b"two"
    assert os.listdir(tmp_path) == ["file"]


def test_where_renaming_fails_the_old_file_stays(tmp_path, monkeypatch):
    path = tmp_path / "file"
    write_whole(path, b"one")

    def refuse(*_):
        raise PermissionError("in use")

    monkeypatch.setattr(files.os, "replace", refuse)
    with pytest.raises(PermissionError):
        write_whole(path, b"two")
    assert path.read_bytes() == b"one"
    assert os.listdir(tmp_path) == ["file"]


@pytest.mark.skipif(os.name == "nt", reason="modes of files are those of Unix")
@pytest.mark.parametrize(("mask", "mode"), [(0o022, 0o644), (0o077, 0o600), (0o002, 0o664)])
def test_who_may_read_a_file_is_as_the_users_mask_says(tmp_path, mask, mode):
    before = os.umask(mask)
    try:
        write_whole(tmp_path / "file", b"one")
    finally:
        os.umask(before)
    assert (tmp_path / "file").stat().st_mode & 0o777 == mode


def test_a_link_is_replaced_and_what_it_leads_to_stays(tmp_path):
    (tmp_path / "theirs").write_bytes(b"theirs")
    (tmp_path / "file").symlink_to(tmp_path / "theirs")
    write_whole(tmp_path / "file", b"ours")
    assert (tmp_path / "theirs").read_bytes() == b"theirs"
    assert not (tmp_path / "file").is_symlink()


def test_what_cannot_be_brought_to_the_disk_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "file"
    write_whole(path, b"one")

    def refuse(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(files.os, "fsync", refuse)
    with pytest.raises(OSError, match=r"No space.*file"):
        write_whole(path, b"two")
    assert os.listdir(tmp_path) == ["file"]
    assert path.read_bytes() == b"one"


def test_what_a_killed_writer_left_is_removed_and_nothing_else(tmp_path):
    left = tmp_path / ".a.npz.0123abcd"
    others = [tmp_path / name for name in (".a.npz.backup01", ".a.npz.0123abcde", ".b.txt.0123abcd", "a.npz")]
    for path in (left, *others):
        path.write_bytes(b"half")
    (tmp_path / ".c.npz.0123abcd").mkdir()
    remove_unfinished(tmp_path, [".npz"])
    assert not left.exists()
    assert all(path.exists() for path in others)
    assert (tmp_path / ".c.npz.0123abcd").is_dir()
    remove_unfinished(tmp_path / "nowhere", [".npz"])
