"""Whatever a reader raises names the file and what to want."""

import gzip
import io
import zipfile
import zlib
from pathlib import Path

import numpy as np
import pytest

from lidarium.mapping.files import guarded_reading
from lidarium.mapping.files.guarded_reading import (
    MAX_MESSAGE,
    READING_ERRORS,
    UNKNOWN,
    GuardedArchive,
    max_unpacked,
    printable,
    read_arrays,
    read_bytes,
    read_lines,
    read_text,
    reading,
    reason,
    shortened,
)


def test_whatever_a_reader_raises_comes_out_as_one_error_that_names_the_file(tmp_path):
    for kind in READING_ERRORS:
        error = zlib.error("x") if kind is zlib.error else kind("x" * 5000)
        with (
            pytest.raises(ValueError, match=r"f\.npz is not a log") as caught,
            reading(tmp_path / "f.npz", "a log", "want another"),
        ):
            raise error
        assert len(str(caught.value)) <= MAX_MESSAGE
    with pytest.raises(KeyboardInterrupt), reading(tmp_path, "a log"):
        raise KeyboardInterrupt


def test_a_message_is_cut_in_its_middle():
    assert shortened("a" * 400 + "b" * 400).startswith("aaa")
    assert shortened("a" * 400 + "b" * 400).endswith("bbb")
    assert len(shortened("a" * 10_000)) <= MAX_MESSAGE


def test_a_file_of_proc_that_tells_no_length_is_read_to_its_cap():
    assert read_bytes(Path("/proc/self/cmdline"))
    with pytest.raises(ValueError, match="more than 2 bytes"):
        read_bytes(Path("/proc/self/cmdline"), 2)


def test_files_are_read_plain_and_packed(tmp_path):
    (tmp_path / "a.txt").write_bytes(b"\xef\xbb\xbfone\ntwo\n")
    (tmp_path / "a.txt.gz").write_bytes(gzip.compress(b"one\ntwo\n"))
    for name in ("a.txt", "a.txt.gz"):
        assert read_text(tmp_path / name) == "one\ntwo\n"
    assert list(read_lines(tmp_path / "a.txt.gz", 10)) == ["one\n", "two\n"]


def test_lines_before_a_damage_are_read(tmp_path):
    lines = b"".join(b"line %d\n" % k for k in range(20_000))
    (tmp_path / "a.log.gz").write_bytes(gzip.compress(lines)[:-2000])
    found = []
    with pytest.raises((EOFError, zlib.error)):
        found.extend(read_lines(tmp_path / "a.log.gz", 100))
    (tmp_path / "b.log").write_bytes(b"caf\xe9\n" + b"x" * 200)
    lines = read_lines(tmp_path / "b.log", 100)
    assert next(lines) == "caf\N{REPLACEMENT CHARACTER}\n"
    with pytest.raises(ValueError, match=r"b\.log has a line of more than 100 bytes"):
        next(lines)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda path: None, "there is no file"),
        (lambda path: path.mkdir(), "is a folder; want a file"),
        (lambda path: path.write_bytes(bytes(101)), "has 101 bytes; want at most 100"),
        (lambda path: path.write_bytes(b"\xfe\xfa"), "is not a text file: .* at byte 0"),
    ],
)
def test_what_is_no_text_is_refused_by_name(tmp_path, make, message):
    make(tmp_path / "a")
    with pytest.raises((ValueError, FileNotFoundError), match=message):
        read_text(tmp_path / "a", 100)


def test_reasons_are_short_lines():
    assert reason(RecursionError()) == "it is nested too deeply"
    assert reason(MemoryError()) == "it needs more memory than there is"
    assert reason(KeyError("a\n  b")) == "a b"
    assert reason(EOFError()) == "EOFError"
    assert max_unpacked(1) < max_unpacked(1 << 30) == 16 << 30


def npz(**arrays):
    file = io.BytesIO()
    np.savez_compressed(file, **arrays)
    return file.getvalue()


@pytest.mark.parametrize(
    "values",
    [
        np.arange(12.0).reshape(3, 4),
        np.zeros((0, 3), np.int8),
        np.array("a text"),
        np.asfortranarray(np.eye(3)),
    ],
)
def test_arrays_come_back_alone_and_by_name(tmp_path, values):
    np.save(tmp_path / "a.npy", values)
    np.savez(tmp_path / "b.npz", values=values, other=np.ones(2))
    alone, named = read_arrays(tmp_path / "a.npy", "an array"), read_arrays(tmp_path / "b.npz", "an npz file")
    np.testing.assert_array_equal(alone, values)
    np.testing.assert_array_equal(named["values"], values)
    assert set(named) == {"values", "other"}


def test_objects_are_refused(tmp_path):
    np.save(tmp_path / "a.npy", np.array([{}], object), allow_pickle=True)
    with pytest.raises(ValueError, match=r"a\.npy is not an array"):
        read_arrays(tmp_path / "a.npy", "an array")


@pytest.mark.parametrize("kept", [3, 40, -8])
def test_a_file_that_is_cut_off_is_refused_by_name(tmp_path, kept):
    np.save(tmp_path / "a.npy", np.arange(100.0))
    (tmp_path / "a.npy").write_bytes((tmp_path / "a.npy").read_bytes()[:kept])
    with pytest.raises(ValueError, match=r"a\.npy is not an array"):
        read_arrays(tmp_path / "a.npy", "an array")


def test_members_of_an_archive_have_one_room_together(monkeypatch):
    monkeypatch.setattr(guarded_reading, "MIN_ARRAYS", 20_000)
    monkeypatch.setattr(guarded_reading, "max_unpacked", lambda packed: 0)
    archive = GuardedArchive(npz(a=np.zeros(1500), b=np.zeros(1500)))
    assert archive.array("a").shape == (1500,)
    with pytest.raises(ValueError, match=r"b\.npy has 12,128 bytes when unpacked; there is room for 7,872"):
        archive.array("b.npy")


def test_too_many_members_and_other_ways_to_pack_are_refused():
    many, packed = io.BytesIO(), io.BytesIO()
    with zipfile.ZipFile(many, "w") as archive:
        for k in range(1001):
            archive.writestr(str(k), b"")
    with pytest.raises(ValueError, match="it has 1,001 members; want at most 1,000"):
        GuardedArchive(many.getvalue())
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_BZIP2) as archive:
        archive.writestr("a", b"abc" * 50)
    with pytest.raises(ValueError, match="a is packed in a way that is not read"):
        GuardedArchive(packed.getvalue()).read("a")
    with pytest.raises(KeyError):
        GuardedArchive(npz(a=np.ones(1))).array("b")


@pytest.mark.parametrize("name", ["flat 3", "étage", "床", "a\N{COMBINING ACUTE ACCENT}", ""])
def test_names_of_any_language_stay(name):
    assert printable(name) == name


def test_what_controls_a_terminal_or_is_no_letter_is_replaced():
    assert printable("a\x1b[31mb\n") == f"a{UNKNOWN}[31mb{UNKNOWN}"
    assert printable(b"caf\xe9".decode("utf-8", "surrogateescape")) == f"caf{UNKNOWN}"
    printable("x\udcff").encode()
