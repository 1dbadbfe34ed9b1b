"""Guarded reading of files: regular files only, of a bounded size, within the memory there is.

Sizes of arrays are read from headers before memory is allocated. Errors that readers raise on damaged or
harmful bytes become ``ValueError``, which names the file and the cure.
"""

import codecs
import errno
import gc
import gzip
import io
import lzma
import math
import os
import re
import stat
import struct
import threading
import tokenize
import unicodedata
import zipfile
import zlib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO
from xml.etree.ElementTree import ParseError

import numpy as np
from numpy.typing import NDArray

MAX_FILE_BYTES = 1 << 31
"""Longest file that is read."""

MAX_MESSAGE = 500
"""Longest message of an error [characters]."""

MIN_UNPACKED, UNPACKED_RATIO = 4 << 20, 16
"""Maximum size of a packed file when unpacked [bytes]: the first number, or a multiple of its own size."""

_GZIP = b"\x1f\x8b"
"""First bytes of a packed file."""

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
"""Errors of readers on damaged bytes: of gzip, zips, arrays, JSON, YAML, TOML, XML, and our own."""


def check_file(path: Path) -> None:
    """Raise FileNotFoundError if nothing is, ValueError if no regular file is."""
    with open_guarded(path):
        pass


@contextmanager
def open_guarded(path: Path, maximum: int = MAX_FILE_BYTES) -> Iterator[BinaryIO]:
    """Open a regular file of bounded size to read its bytes.

    A pipe is not waited for, and a device is not read from: the open file is checked, not its name.
    """
    name = shortened(str(path), MAX_MESSAGE - 100)
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
        if found.st_size > maximum:
            raise ValueError(f"{name} has {found.st_size:,} bytes; want at most {maximum:,}")
    except ValueError:
        os.close(handle)
        raise
    with os.fdopen(handle, "rb") as file:
        yield file


def read_bytes(path: Path, maximum: int = MAX_FILE_BYTES) -> bytes:
    """Read a file as it is."""
    with open_guarded(path, maximum) as file:
        content = file.read(maximum + 1)
    # A file that grows, or one of /proc, reports less than it holds.
    if len(content) > maximum:
        raise ValueError(f"{path} has more than {maximum:,} bytes; want at most so many")
    return content


def _read_unpacked(path: Path, maximum: int = MAX_FILE_BYTES) -> bytes:
    """Read a file, unpacked if its name ends in .gz."""
    content = read_bytes(path, maximum)
    if path.suffix.lower() != ".gz":
        return content
    allowed = min(max_unpacked(len(content)), maximum)
    with reading(path, "a whole packed file, but damaged or truncated"):
        pieces, length = [], 0
        with gzip.GzipFile(fileobj=io.BytesIO(content)) as unpacked:
            while piece := unpacked.read(1 << 20):
                pieces.append(piece)
                length += len(piece)
                if length > allowed:
                    raise ValueError(f"it has more than {allowed:,} bytes when unpacked")
        return b"".join(pieces)


def read_text(path: Path, maximum: int = MAX_FILE_BYTES) -> str:
    """Read a text file (UTF-8, or UTF-16 with its mark), unpacked if its name ends in .gz."""
    content = _read_unpacked(path, maximum)
    try:
        return content.decode(encoding_of(content[:_HEAD_BYTES]))
    except UnicodeDecodeError as error:
        raise ValueError(f"{path} is not a text file: {error.reason} at byte {error.start}") from error


_HEAD_BYTES = 200
_DECLARED = re.compile(rb"<\?xml[^>]*encoding\s*=\s*[\"'](iso-8859-1|iso-8859-15|windows-1252)[\"']", re.IGNORECASE)


def encoding_of(begin: bytes) -> str:
    """Return the encoding of a text by its first bytes; programs of Windows write UTF-16, XML declares others."""
    if begin[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE):
        return "utf-16"
    declared = _DECLARED.match(begin)
    return declared[1].decode() if declared else "utf-8-sig"


def without_mark(content: bytes) -> bytes:
    """Return the bytes of a text in UTF-8 without its mark; other bytes as they are."""
    if encoding_of(content[:2]) == "utf-16":
        return content.decode("utf-16").encode()
    return content.removeprefix(codecs.BOM_UTF8)


def read_lines(path: Path, longest: int) -> Iterator[str]:
    """Yield the lines of a text file, plain or packed, one after the other.

    Bytes that are no text become replacement characters.
    """
    with open_guarded(path) as file:
        is_packed = file.read(2) == _GZIP
        file.seek(0)
        allowed = max_unpacked(os.fstat(file.fileno()).st_size) if is_packed else MAX_FILE_BYTES
        length = 0
        # Lines of a packed file are found ten times as fast in a buffer.
        buffer = io.BufferedReader(gzip.GzipFile(fileobj=file) if is_packed else file)  # type: ignore[type-var]
        encoding = encoding_of(buffer.peek(2)[:2])
        with io.TextIOWrapper(buffer, encoding, "replace", newline="\n") as lines:
            while line := lines.readline(longest + 1):
                length += len(line)
                if len(line) > longest:
                    raise ValueError(f"{path} has a line of more than {longest:,} bytes; want a log")
                if length > allowed:
                    raise ValueError(f"{path} has more than {allowed:,} bytes when unpacked; want fewer")
                yield line


def max_unpacked(packed: int) -> int:
    """Return how many bytes a packed file may have when unpacked."""
    return max(MIN_UNPACKED, UNPACKED_RATIO * packed)


class _Collection:
    """The garbage collector, which is paused while any thread parses a file.

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
    """Turn errors of parsers into ``ValueError`` with the name of the file and its expected content."""
    try:
        with _COLLECTION.paused():
            yield
    except READING_ERRORS as error:
        text = reason(error)
        named = path is None or text.startswith(str(path))
        if named and isinstance(error, ValueError) and len(str(error)) <= MAX_MESSAGE:
            raise
        whole = text if named else f"{path} is not {what}: {text}"
        raise ValueError(shortened(f"{whole}; {cure}" if cure and not named else whole)) from error


def reason(error: BaseException) -> str:
    """Return the message of an error, in one line that is not too long."""
    if isinstance(error, RecursionError):
        return "it is nested too deeply"
    if isinstance(error, MemoryError):
        return "it needs more memory than there is"
    text = str(error.args[0]) if isinstance(error, KeyError) and error.args else str(error)
    return shortened(" ".join(text.split()) or type(error).__name__, MAX_MESSAGE - 100)


def shortened(text: str, maximum: int = MAX_MESSAGE) -> str:
    """Return a text with its middle left out if it is too long."""
    if len(text) <= maximum:
        return text
    half = (maximum - 5) // 2
    return f"{text[:half]} ... {text[-half:]}"


MIN_ARRAYS = 128 << 20
"""Minimum limit of the total size of the arrays of an archive [bytes]."""

MAX_MEMBERS = 1000
"""Most members of an archive."""

_MAGIC = b"\x93NUMPY"
_KINDS = "biufcSU"


class GuardedArchive:
    """A zip of arrays and texts, read member by member as long as there is room.

    Parameters
    ----------
    content : bytes
        The whole file.
    """

    def __init__(self, content: bytes) -> None:
        self._archive = zipfile.ZipFile(io.BytesIO(content))
        members = self._archive.infolist()
        if len(members) > MAX_MEMBERS:
            raise ValueError(f"it has {len(members):,} members; want at most {MAX_MEMBERS:,}")
        self._left = min(max(MIN_ARRAYS, max_unpacked(len(content))), MAX_FILE_BYTES)
        self.names = [member.filename for member in members]

    def read(self, name: str) -> bytes:
        """Return the bytes of a member, checked against its checksum."""
        member = self._archive.getinfo(name)
        if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise ValueError(f"{name} is packed in a way that is not read; want stored or deflated")
        if member.file_size > self._left:
            raise ValueError(f"{name} has {member.file_size:,} bytes when unpacked; there is room for {self._left:,}")
        self._left -= member.file_size
        return self._archive.read(member)

    def array(self, name: str) -> NDArray[Any]:
        """Return the array of a member by its name, with or without ``.npy``."""
        return _array_of(self.read(name if name in self.names else f"{name}.npy"))


def read_arrays(path: Path, what: str) -> NDArray[Any] | dict[str, NDArray[Any]]:
    """Read an ``.npy`` or ``.npz`` file."""
    content = read_bytes(path)
    with reading(path, what):
        if content[: len(_MAGIC)] == _MAGIC:
            return _array_of(content)
        archive = GuardedArchive(content)
        return _named_arrays(archive, archive.names)


def _named_arrays(archive: GuardedArchive, names: Iterable[str]) -> dict[str, NDArray[Any]]:
    """Return the arrays of an archive by their names without ``.npy``."""
    return {name.removesuffix(".npy"): archive.array(name) for name in names}


def _array_of(content: bytes) -> NDArray[Any]:
    """Return the array of the bytes of an ``.npy`` file."""
    file = io.BytesIO(content)
    major, _ = np.lib.format.read_magic(file)
    read_header = {1: np.lib.format.read_array_header_1_0, 2: np.lib.format.read_array_header_2_0}.get(major)
    if read_header is None:
        raise ValueError(f"its array is of version {major}; want 1 or 2")
    shape, is_fortran, kind = read_header(file)
    if kind.kind not in _KINDS or kind.itemsize == 0:
        raise ValueError(f"its array is of {kind}; want numbers")
    size, there = math.prod(shape) * kind.itemsize, len(content) - file.tell()
    if min(shape, default=0) < 0 or size != there:
        raise ValueError(f"its array claims {size:,} bytes of shape {shape}, there are {there:,}")
    flat = np.frombuffer(content, kind, offset=file.tell())
    return np.array(flat.reshape(shape, order="F" if is_fortran else "C"), order="C")


UNKNOWN = "\N{REPLACEMENT CHARACTER}"


def printable(name: str) -> str:
    """Return a name in which bytes that are no UTF-8, and control characters, are replaced."""
    return "".join(UNKNOWN if unicodedata.category(letter) in ("Cc", "Cs", "Co") else letter for letter in name)
