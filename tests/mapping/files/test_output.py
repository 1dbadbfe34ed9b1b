"""Folders that can be written to, and files that are there whole or not at all."""

import os

import pytest

from lidarium.mapping.files import output as files
from lidarium.mapping.files.output import write_whole
from lidarium.mapping.kernels.cache_folders import first_writable, is_writable, user_cache_folder


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


def test_a_folder_is_writable_where_it_can_be_made(tmp_path):
    (tmp_path / "file").write_bytes(b"")
    assert is_writable(tmp_path / "new" / "folder")
    assert not is_writable(tmp_path / "file" / "folder")
    assert first_writable([tmp_path / "file", tmp_path / "other"]) == tmp_path / "other"
    assert first_writable([tmp_path / "file"]) is None


def test_the_users_cache_is_where_the_system_says(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert user_cache_folder() == tmp_path
    monkeypatch.delenv("XDG_CACHE_HOME")
    assert user_cache_folder().name == ".cache"
