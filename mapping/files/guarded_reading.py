"""The one way in which files are opened: regular ones only, no more bytes than there is memory for.

Whatever a reader raises on bytes that are damaged, or made to harm, comes out as ``ValueError`` with the name
of the file and what to want.
"""

import errno
import gc
import gzip
import io
import lzma
import os
import stat
import struct
import threading
import tokenize
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO
from xml.etree.ElementTree import ParseError

MOST_FILE_BYTES = 1 << 31
"""Longest file that is read."""

MOST_MESSAGE = 500
"""Longest message of an error [characters]."""

LEAST_UNPACKED, UNPACKED_RATIO = 4 << 20, 16
"""A packed file may have the first many bytes when unpacked, or so many times its own."""

READING_ERRORS = (
    ArithmeticError,
    AttributeError,
    EOFError,
    LookupError,
    MemoryError,
    ParseError,
    RecursionError,
    NotImplementedError,
    RuntimeError,
    SyntaxError,
    TypeError,
    ValueError,
    gzip.BadGzipFile,
    lzma.LZMAError,
    struct.error,
    tokenize.TokenError,
    zipfile.BadZipFile,
    zipfile.LargeZipFile,
    zlib.error,
)
"""What readers raise on damaged bytes: those of gzip, zips, arrays, JSON, YAML, TOML, XML, and our own."""


def check_file(path: Path) -> None:
    """Raise FileNotFoundError where nothing is, ValueError where no regular file is."""
    with open_guarded(path):
        pass


@contextmanager
def open_guarded(path: Path, most: int = MOST_FILE_BYTES) -> Iterator[BinaryIO]:
    """Open a regular file of bounded size to read its bytes.

    A pipe is not waited for, and a device is not read from: what was opened is checked, not its name.

    Parameters
    ----------
    path : Path
        The file.
    most : int
        How many bytes it may have.

    Yields
    ------
    BinaryIO
        The open file.

    Raises
    ------
    FileNotFoundError
        Where nothing is.
    ValueError
        Where it is a folder, a pipe or a device, or too large.
    """
    name = shortened(str(path), MOST_MESSAGE - 100)
    try:
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    except (FileNotFoundError, NotADirectoryError) as error:
        raise FileNotFoundError(f"there is no file {name}") from error
    except IsADirectoryError as error:  # where folders cannot be opened
        raise ValueError(f"{name} is a folder; want a file") from error
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            raise FileNotFoundError(f"there is no file {name}: its name is too long") from error
        raise
    except ValueError as error:
        raise ValueError(f"{name!r} cannot be the name of a file: {error}") from error
    try:
        found = os.fstat(handle)
        if not stat.S_ISREG(found.st_mode):
            what = "a folder" if stat.S_ISDIR(found.st_mode) else "a pipe or a device"
            raise ValueError(f"{name} is {what}; want a file")
        if found.st_size > most:
            raise ValueError(f"{name} has {found.st_size:,} bytes; want at most {most:,}")
    except ValueError:
        os.close(handle)
        raise
    with os.fdopen(handle, "rb") as file:
        yield file


def read_bytes(path: Path, most: int = MOST_FILE_BYTES) -> bytes:
    """Read a file as it is.

    Raises
    ------
    FileNotFoundError, ValueError
        As ``open_guarded``.
    """
    with open_guarded(path, most) as file:
        content = file.read(most + 1)
    # A file that grows, or one of /proc, reports less than it holds.
    if len(content) > most:
        raise ValueError(f"{path} has more than {most:,} bytes; want at most so many")
    return content


def read_unpacked(path: Path, most: int = MOST_FILE_BYTES) -> bytes:
    """Read a file, unpacked where its name ends in .gz.

    Raises
    ------
    FileNotFoundError, ValueError
        As ``open_guarded``, and where it is damaged, or has too many bytes when unpacked.
    """
    content = read_bytes(path, most)
    if path.suffix.lower() != ".gz":
        return content
    allowed = min(most_unpacked(len(content)), most)
    with reading(path, "a whole packed file, but damaged or truncated"):
        pieces, length = [], 0
        with gzip.GzipFile(fileobj=io.BytesIO(content)) as unpacked:
            while piece := unpacked.read(1 << 20):
                pieces.append(piece)
                length += len(piece)
                if length > allowed:
                    raise ValueError(f"it has more than {allowed:,} bytes when unpacked")
        return b"".join(pieces)


def read_text(path: Path, most: int = MOST_FILE_BYTES) -> str:
    """Read a text file (UTF-8), unpacked where its name ends in .gz.

    Raises
    ------
    FileNotFoundError, ValueError
        As ``read_unpacked``, and where it is no text.
    """
    try:
        return read_unpacked(path, most).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError(f"{path} is not a text file: {error.reason} at byte {error.start}") from error


def read_lines(path: Path, longest: int) -> Iterator[str]:
    """Yield the lines of a text file, plain or packed, one after the other.

    Bytes that are no text become replacement characters.

    Parameters
    ----------
    path : Path
        The file; with ``.gz`` at its end it is unpacked.
    longest : int
        Most bytes of a line.

    Raises
    ------
    ValueError
        Where a line is longer, or the file has too many bytes when unpacked.
    EOFError, zlib.error, gzip.BadGzipFile
        Where it is cut off or damaged; the lines before have been yielded.
    """
    with open_guarded(path) as file:
        is_packed = path.suffix.lower() == ".gz"
        allowed = most_unpacked(os.fstat(file.fileno()).st_size) if is_packed else MOST_FILE_BYTES
        length = 0
        # Lines of a packed file are found ten times as fast in a buffer.
        with io.BufferedReader(gzip.GzipFile(fileobj=file)) if is_packed else file as lines:
            while line := lines.readline(longest + 1):
                length += len(line)
                if len(line) > longest:
                    raise ValueError(f"{path} has a line of more than {longest:,} bytes; want a log")
                if length > allowed:
                    raise ValueError(f"{path} has more than {allowed:,} bytes when unpacked; want fewer")
                yield line.decode("utf-8", "replace")


def most_unpacked(packed: int) -> int:
    """Return how many bytes a packed file may have when unpacked."""
    return max(LEAST_UNPACKED, UNPACKED_RATIO * packed)


class _Collection:
    """The garbage collector, which stands still while any thread parses a file.

    It looks at all that a parser makes, again and again: half of the time of a log of many lines.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._pauses = 0
        self._was_enabled = False

    @contextmanager
    def paused(self) -> Iterator[None]:
        with self._lock:
            if not self._pauses:
                self._was_enabled = gc.isenabled()
                gc.disable()
            self._pauses += 1
        try:
            yield
        finally:
            with self._lock:
                self._pauses -= 1
                if not self._pauses and self._was_enabled:
                    gc.enable()


_COLLECTION = _Collection()


@contextmanager
def reading(path: Path | None, what: str, cure: str = "") -> Iterator[None]:
    """Turn whatever parsers raise into ``ValueError`` with the name of the file and what it should be.

    Parameters
    ----------
    path : Path or None
        The file; None where messages name it already, and only their length and kind are checked.
    what : str
        What it should be: ``a whole episode record``.
    cure : str
        What to do about it.

    Raises
    ------
    ValueError
        In place of all of ``READING_ERRORS``. Those that name the file already are left as they are.
    """
    try:
        with _COLLECTION.paused():
            yield
    except READING_ERRORS as error:
        text = reason(error)
        named = path is None or text.startswith(str(path))
        if named and isinstance(error, ValueError) and len(str(error)) <= MOST_MESSAGE:
            raise
        whole = text if named else f"{path} is not {what}: {text}"
        raise ValueError(shortened(f"{whole}; {cure}" if cure and not named else whole)) from error


def reason(error: BaseException) -> str:
    """Return what an error says, in one line that is not too long."""
    if isinstance(error, RecursionError):
        return "it is nested too deeply"
    if isinstance(error, MemoryError):
        return "it needs more memory than there is"
    text = str(error.args[0]) if isinstance(error, KeyError) and error.args else str(error)
    return shortened(" ".join(text.split()) or type(error).__name__, MOST_MESSAGE - 100)


def shortened(text: str, most: int = MOST_MESSAGE) -> str:
    """Return a text with its middle left out where it is too long."""
    if len(text) <= most:
        return text
    half = (most - 5) // 2
    return f"{text[:half]} ... {text[-half:]}"
