"""A full disk, a closed folder or a damaged file costs time to compile, and nothing else."""

import errno
import os
import warnings

import numba
import pytest
from numba.core import caching, config

from lidarium.mapping.kernels import compilation


def one_more(number):
    return number + 1


@pytest.fixture
def compiled(tmp_path, monkeypatch):
    """Return how to make a function anew whose compiled forms are kept in a folder of this test."""
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(compilation, "_has_warned", False)

    def make():
        made = numba.njit(one_more)
        compilation._keep(made)
        return made

    return make


def hits(made):
    """Return what the function says, and how often it was found compiled."""
    return made(1), sum(made.stats.cache_hits.values())


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EACCES, errno.EDQUOT])
@pytest.mark.parametrize("function", ["replace", "makedirs"])
def test_where_nothing_can_be_written_there_is_one_warning(compiled, monkeypatch, number, function):
    first, second = compiled(), compiled()

    def fail(*_given, **_named):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, function, fail)
    with pytest.warns(UserWarning, match=f"{os.strerror(number)}; make room") as told:
        found = hits(first), hits(second)
    assert found == ((2, 0), (2, 0))
    assert len(told) == 1


@pytest.mark.parametrize("content", [b"", b"\x00" * 64, b"\x80\x05X\x06\x00\x00\x000.65.1\x94.\xff\xff"])
@pytest.mark.parametrize("ending", ["nbi", "nbc"])
def test_a_damaged_file_is_made_anew(compiled, tmp_path, content, ending):
    assert hits(compiled()) == (2, 0)
    assert hits(compiled()) == (2, 1)
    (damaged,) = tmp_path.rglob(f"*.{ending}")
    whole = damaged.read_bytes()
    for harm in (content, whole[: len(whole) // 2]):
        damaged.write_bytes(harm)
        assert hits(compiled()) == (2, 0)
        assert hits(compiled()) == (2, 1)


def test_a_damaged_file_that_cannot_be_replaced_has_warned(compiled, tmp_path, monkeypatch):
    compiled()(1)
    (damaged,) = tmp_path.rglob("*.nbi")
    damaged.write_bytes(b"?")
    made = compiled()

    def fail(*_given):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    monkeypatch.setattr(caching.IndexDataCacheFile, "_open_for_write", fail)
    with pytest.warns(UserWarning, match="Permission denied"):
        assert hits(made) == (2, 0)


def test_a_folder_that_cannot_be_made_has_warned(tmp_path, compiled, monkeypatch):
    def fail(*_given):
        raise RuntimeError("no locator available for file")

    monkeypatch.setattr(caching.Cache, "__init__", fail)
    with pytest.warns(UserWarning, match="no locator available"):
        made = compiled()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert hits(made) == (2, 0)
        assert not list(tmp_path.rglob("*.nb?"))
