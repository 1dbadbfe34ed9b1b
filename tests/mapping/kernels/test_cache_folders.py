"""Caches lie in folders that are ours alone: what someone else could have put there is never loaded."""

import os
import subprocess
import sys

import pytest

from lidarium.mapping.kernels import cache_folders
from lidarium.mapping.kernels.cache_folders import (
    cache_folder,
    is_writable,
    trusted_folder,
    user_cache_folder,
)

pwd = pytest.importorskip("pwd", reason="owners and modes are those of Unix")

OTHER = 65534
"""Number of another user, who has next to nothing on this machine."""

as_root = pytest.mark.skipif(
    getattr(os, "geteuid", lambda: 1)() != 0,
    reason="only the administrator can make folders of other users",
)


@pytest.fixture
def shared(tmp_path, monkeypatch):
    """A temporary folder as ``/tmp``, for a user without a home."""
    folder = tmp_path / "shared"
    folder.mkdir()
    folder.chmod(0o1777)
    monkeypatch.setattr(cache_folders.tempfile, "gettempdir", lambda: str(folder))
    monkeypatch.setattr(cache_folders, "user_cache_folder", lambda: None)
    return folder


def mode(folder):
    return folder.stat().st_mode & 0o7777


def own_name():
    return f"lidarium-{os.geteuid()}"


def test_a_folder_is_writable_where_it_can_be_made(tmp_path):
    (tmp_path / "file").write_bytes(b"")
    assert is_writable(tmp_path / "new" / "folder")
    assert not is_writable(tmp_path / "file" / "folder")
    assert not is_writable(None)


def test_the_users_cache_is_where_the_system_says(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert user_cache_folder() == tmp_path
    for ignored in ("relative/cache", ""):
        monkeypatch.setenv("XDG_CACHE_HOME", ignored)
        assert user_cache_folder().name == ".cache"


def test_a_user_without_a_home_has_no_cache_folder(monkeypatch):
    def unknown(_):
        raise KeyError("no such user")

    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.delenv("HOME", raising=False)
    monkeypatch.setattr(pwd, "getpwuid", unknown)
    assert user_cache_folder() is None


def test_a_cache_is_made_for_its_owner_alone_whatever_the_mask(shared):
    before = os.umask(0)
    try:
        folder = cache_folder("kernels", "key")
    finally:
        os.umask(before)
    assert folder == shared.resolve() / own_name() / "kernels" / "key"
    assert {mode(each) for each in (folder, folder.parent, folder.parent.parent)} == {0o700}
    assert cache_folder("kernels", "key") == folder


def test_the_order_is_beside_the_source_then_the_users_then_the_temporary_folder(tmp_path, monkeypatch):
    for name in ("package", "home", "temporary"):
        (tmp_path / name).mkdir()
    source = tmp_path / "package" / "source.py"
    source.write_text("")
    monkeypatch.setattr(cache_folders.tempfile, "gettempdir", lambda: str(tmp_path / "temporary"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    for wanted in ("package/__pycache__/k", "home/lidarium/k", f"temporary/{own_name()}/k"):
        assert cache_folder("k", beside=source) == tmp_path / wanted
        top = tmp_path / wanted
        while top.parent.name != wanted.split("/")[0]:
            top = top.parent
        top.rename(tmp_path / f"{top.name}.old")
        top.write_bytes(b"in the way")
    assert cache_folder("k", beside=source) is None


@as_root
@pytest.mark.parametrize("place", [0, 1, 2])
def test_a_folder_that_someone_else_made_before_is_not_taken(shared, place):
    """The attack that was found: a name that can be foreseen, made first and open to all."""
    parts = [own_name(), "kernels", "key"][: place + 1]
    folder = shared
    for part in parts:
        folder = folder / part
        folder.mkdir(mode=0o700)
    folder.chmod(0o777)
    os.chown(folder, OTHER, OTHER)
    (folder / "planted.nbi").write_bytes(b"code of someone else")
    assert cache_folder("kernels", "key") is None
    assert (folder / "planted.nbi").exists()
    assert mode(folder) == 0o777


@as_root
def test_another_user_does_not_take_what_the_administrator_left_open(shared, tmp_path):
    for each in (tmp_path, *tmp_path.parents):
        if mode(each) & 0o001 == 0:
            each.chmod(mode(each) | 0o011)
    (shared / f"lidarium-{OTHER}").mkdir()
    (shared / f"lidarium-{OTHER}").chmod(0o777)
    os.seteuid(OTHER)
    try:
        assert cache_folder("kernels") is None
        assert trusted_folder(shared, ["mine"]) == shared.resolve() / "mine"
    finally:
        os.seteuid(0)
    assert (shared / "mine").stat().st_uid == OTHER


@pytest.mark.parametrize("place", [0, 1])
def test_a_link_is_not_followed(shared, tmp_path, place):
    aim = tmp_path / "aim"
    aim.mkdir(mode=0o700)
    above = [shared, shared / own_name()][place]
    above.mkdir(mode=0o700, exist_ok=True)
    (above / [own_name(), "kernels"][place]).symlink_to(aim)
    assert cache_folder("kernels") is None
    assert not list(aim.iterdir())


def test_what_others_can_write_to_is_not_taken_and_the_folders_above_are_closed(shared):
    folder = cache_folder("kernels", "key")
    folder.parent.chmod(0o775)
    assert cache_folder("kernels", "key") == folder
    assert mode(folder.parent) == 0o755
    folder.chmod(0o775)
    assert cache_folder("kernels", "key") is None


def test_a_shared_folder_in_which_others_can_rename_is_not_used(shared):
    shared.chmod(0o777)
    assert cache_folder("kernels") is None
    below = shared / "own"
    below.mkdir(mode=0o700)
    assert trusted_folder(below, ["kernels"]) is None


@as_root
def test_the_cache_beside_a_source_may_be_of_the_sources_owner(tmp_path):
    source = tmp_path / "source.py"
    source.write_text("")
    os.chown(source, OTHER, OTHER)
    folder = tmp_path / "__pycache__" / "kernels"
    folder.mkdir(parents=True)
    os.chown(folder, OTHER, OTHER)
    assert cache_folder("kernels", beside=source) == folder
    os.chown(source, 0, 0)
    assert cache_folder("kernels", beside=source) != folder


PROGRAM = """
import os, pwd, sys
def unknown(_):
    raise KeyError("no such user")
pwd.getpwuid = unknown
from lidarium.scripts.main import main
sys.exit(main())
"""


def test_commands_work_without_a_home_and_without_an_entry_of_the_user(tmp_path):
    kept = {name: value for name, value in os.environ.items() if name not in ("HOME", "XDG_CACHE_HOME", "USER")}
    arguments = ["floors", "generate", "--out", str(tmp_path / "out")]
    told = subprocess.run(
        [sys.executable, "-c", PROGRAM, *arguments],
        env={**kept, "TMPDIR": str(tmp_path), "LIDARIUM_FLOOR_STORE": ""},
        capture_output=True,
        text=True,
    )
    assert told.returncode == 0, told.stderr
    assert "Traceback" not in told.stderr
    assert list((tmp_path / "out").glob("*.json"))
