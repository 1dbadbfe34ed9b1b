"""Whatever a reader raises names the file and what to want."""

import gzip
import zlib
from pathlib import Path

import pytest

from lidarium.mapping.files.guarded_reading import (
    MOST_MESSAGE,
    READING_ERRORS,
    most_unpacked,
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
        assert len(str(caught.value)) <= MOST_MESSAGE
    with pytest.raises(KeyboardInterrupt), reading(tmp_path, "a log"):
        raise KeyboardInterrupt


def test_a_message_is_cut_in_its_middle():
    assert shortened("a" * 400 + "b" * 400).startswith("aaa")
    assert shortened("a" * 400 + "b" * 400).endswith("bbb")
    assert len(shortened("a" * 10_000)) <= MOST_MESSAGE


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
        (lambda path: path.write_bytes(b"\xff\xfe"), "is not a text file: .* at byte 0"),
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
    assert most_unpacked(1) < most_unpacked(1 << 30) == 16 << 30
