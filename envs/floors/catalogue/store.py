"""A store on disk that all processes share.

It has arrays that are expensive to make and small to keep, found by their inputs.

An entry is one file of compressed arrays. It is written to a temporary file and renamed, so that it appears whole; it
carries a hash of its key and content, so that one that is damaged, cut short or another's is seen and made
again. Keys hold a hash of the code and libraries that make the arrays, so that a stale entry is never found.
Only files with names of entries are read and removed, and nothing is reached through links.

The entries lie in a few folders, each bounded by its share of the whole: a process that writes makes room in
one of them without reading the others, independent of what other processes write. The entry used
longest ago goes first; a process that is reading it can continue. A process lists a folder again only
after it has written a part of the free space: listing thousands of entries takes half as long as making a floor.
"""

import contextlib
import hashlib
import json
import os
import platform
import re
import stat
import zlib
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import scipy
from numpy.typing import NDArray

from lidarium.mapping.files.output import write_whole
from lidarium.mapping.kernels.cache_folders import cache_folder

Arrays = Mapping[str, NDArray[Any]]
"""Arrays by name, as entries hold them."""

FOLDER_VARIABLE = "LIDARIUM_FLOOR_STORE"
"""Environment variable: the store's folder, or ``off``."""

SIZE_VARIABLE = "LIDARIUM_FLOOR_STORE_MIB"
"""Environment variable: the most that the store takes on disk [MiB]."""

DEFAULT_MIB = 1024.0
"""Default of the maximum size of the store on disk [MiB]."""

PARTS = 16
"""Number of folders that the entries are spread over.

They are chosen by the first digit of the hash of their keys.
"""

SHARERS = 4
"""Number of processes that can write between two listings without exceeding a folder's limit."""

SPARED = 1.0 / 16.0
"""Share of a full folder that is freed in addition to what the new entry needs."""

_MAGIC = b"lidarium"
_DIGEST_BYTES = 32
_BLOCK = 4096
_NAME = re.compile(r"[0-9a-f]{32}|\.[0-9a-f]{32}\.\w{1,16}")
"""Names that the store makes: of entries, and of those that are being written."""

_PACKAGE = Path(__file__).resolve().parents[3]


class Store:
    """Arrays by key, on disk.

    Parameters
    ----------
    folder : Path or None
        Folder of the entries; None for a store that keeps nothing. A folder that cannot be written to is read
        from.
    max_bytes : int
        The most that the entries take on disk.
    """

    def __init__(self, folder: Path | None, max_bytes: int) -> None:
        self.folder, self.max_bytes = folder, max_bytes
        self._unseen: dict[Path, int] = {}  # bytes that may be written before the next listing

    def load(self, key: str) -> Arrays | None:
        """Return the arrays of a key, read-only.

        None if no complete arrays are stored.
        """
        if self.folder is None:
            return None
        path = self._path(key)
        try:
            content = _content(path)
        except OSError:
            return None
        head = len(_MAGIC) + _DIGEST_BYTES
        if content[:head] != _MAGIC + _digest(key, content[head:]):
            return None
        with contextlib.suppress(OSError):
            os.utime(path)
        return _unpacked(content[head:])

    def save(self, key: str, arrays: Arrays) -> None:
        """Keep arrays, if there is room and the folder can be written to."""
        if self.folder is None:
            return
        packed = _packed(arrays)
        content = _MAGIC + _digest(key, packed) + packed
        path, size, most = self._path(key), _on_disk(len(content)), self.max_bytes // PARTS
        if size > most:
            return
        part = path.parent
        with contextlib.suppress(OSError):
            part.mkdir(parents=True, exist_ok=True)
            if part.is_symlink():
                return
            unseen = self._unseen.get(part, 0) - size
            if unseen < 0:
                unseen = (most - size - _shrink(part, most - size)) // SHARERS
            write_whole(path, content, is_lasting=False)
            self._unseen[part] = unseen

    def size(self) -> int:
        """Return how many bytes the entries take."""
        return 0 if self.folder is None else sum(size for part in self.folder.glob("?") for _, size, _ in _files(part))

    def _path(self, key: str) -> Path:
        assert self.folder is not None
        name = hashlib.blake2b(key.encode(), digest_size=16).hexdigest()
        return self.folder / name[0] / name


def floor_store() -> Store:
    """Return the store of floors, as the environment variables want it."""
    return _store(os.environ.get(FOLDER_VARIABLE, ""), mebibytes(SIZE_VARIABLE, DEFAULT_MIB))


@lru_cache(maxsize=8)
def _store(folder: str, max_bytes: int) -> Store:
    if folder == "off":
        return Store(None, max_bytes)
    if folder:
        return Store(_chosen(folder), max_bytes)
    return Store(cache_folder("floors"), max_bytes)


def _chosen(folder: str) -> Path:
    try:
        return Path(folder).expanduser().absolute()
    except RuntimeError as error:
        raise ValueError(
            f"environment variable {FOLDER_VARIABLE} is {folder!r}, and this user has no home; want a folder "
            "without '~', or off"
        ) from error


def mebibytes(variable: str, default: float) -> int:
    """Read a size in MiB from an environment variable; returns bytes."""
    text = os.environ.get(variable, "")
    try:
        size = float(text or default)
    except ValueError:
        size = -1.0
    if not 0.0 <= size < float("inf"):
        raise ValueError(f"environment variable {variable} is {text!r}; want a size in MiB, such as {default:g}")
    return int(size * 2**20)


@lru_cache(maxsize=8)
def hash_of_code(*sources: str) -> str:
    """Hash the inputs of an entry's arrays.

    These are sources of the package, files or whole folders, with the libraries and the processor's kind.
    """
    libraries = (platform.machine(), np.__version__, scipy.__version__, cv2.__version__)
    digest = hashlib.blake2b(" ".join(libraries).encode(), digest_size=16)
    for source in sources:
        path = _PACKAGE / source
        for file in sorted(path.rglob("*.py")) if path.is_dir() else [path]:
            digest.update(file.relative_to(_PACKAGE).as_posix().encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()


def _digest(key: str, packed: bytes) -> bytes:
    digest = hashlib.blake2b(key.encode() + b"\0", digest_size=_DIGEST_BYTES)
    digest.update(packed)
    return digest.digest()


def _packed(arrays: Arrays) -> bytes:
    """Return a line of JSON, then the arrays, each compressed by itself.

    The line has name, type, shape and length of each array.
    """
    streams = [zlib.compress(np.ascontiguousarray(array).tobytes()) for array in arrays.values()]
    table = [
        (name, array.dtype.str, array.shape, len(stream))
        for (name, array), stream in zip(arrays.items(), streams, strict=True)
    ]
    return json.dumps(table).encode() + b"\n" + b"".join(streams)


def _unpacked(packed: bytes) -> Arrays:
    place = packed.index(b"\n") + 1
    arrays = {}
    for name, kind, shape, length in json.loads(packed[:place]):
        arrays[name] = np.frombuffer(zlib.decompress(packed[place : place + length]), kind).reshape(shape)
        place += length
    return arrays


def _on_disk(length: int) -> int:
    """Return the size of a file of that length in the blocks of usual file systems."""
    return -(-length // _BLOCK) * _BLOCK


def _content(path: Path) -> bytes:
    """Read an entry: a plain file, in a folder, neither of them a link."""
    if path.parent.is_symlink() or not stat.S_ISREG(os.lstat(path).st_mode):
        raise FileNotFoundError(f"{path} is no entry")
    return path.read_bytes()


def _files(folder: Path) -> list[tuple[float, int, str]]:
    """Return time of last use, size and path of a folder's entries.

    Unfinished writes of broken processes are included. Others' files are not, nor are links.
    """
    files: list[tuple[float, int, str]] = []
    if folder.is_symlink():
        return files
    with contextlib.suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            if not _NAME.fullmatch(entry.name):
                continue
            with contextlib.suppress(OSError):
                status = entry.stat(follow_symlinks=False)
                if stat.S_ISREG(status.st_mode):
                    files.append((status.st_mtime, _on_disk(status.st_size), entry.path))
    return files


def _shrink(folder: Path, max_bytes: int) -> int:
    """Remove the least recently used entries if a folder is larger than that; return its size then."""
    files = _files(folder)
    size = sum(size for _, size, _ in files)
    if size <= max_bytes:
        return size
    for _, length, path in sorted(files):
        if size <= max_bytes - int(SPARED * max_bytes) // _BLOCK * _BLOCK:
            break
        with contextlib.suppress(OSError):
            os.unlink(path)
        size -= length
    return size
