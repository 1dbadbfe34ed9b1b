"""Arrays of numpy from files that may lie: sizes are found from headers before memory is asked for."""

import io
import math
import zipfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.files.guarded_reading import MOST_FILE_BYTES, most_unpacked, read_bytes, reading

LEAST_ARRAYS = 128 << 20
"""The arrays of an archive may have so many bytes, however well they are packed."""

MOST_MEMBERS = 1000
"""Most members of an archive."""

_MAGIC = b"\x93NUMPY"
_KINDS = "biufcSU"


class GuardedArchive:
    """A zip of arrays and texts, read member by member as long as there is room.

    Parameters
    ----------
    content : bytes
        The whole file.

    Raises
    ------
    ValueError
        Where it has too many members.
    zipfile.BadZipFile
        Where it is no zip.
    """

    def __init__(self, content: bytes) -> None:
        self._archive = zipfile.ZipFile(io.BytesIO(content))
        members = self._archive.infolist()
        if len(members) > MOST_MEMBERS:
            raise ValueError(f"it has {len(members):,} members; want at most {MOST_MEMBERS:,}")
        self._left = min(max(LEAST_ARRAYS, most_unpacked(len(content))), MOST_FILE_BYTES)
        self.names = [member.filename for member in members]

    def read(self, name: str) -> bytes:
        """Return the bytes of a member, checked against its checksum.

        Raises
        ------
        ValueError
            Where it is packed in another way than zips of numpy are, or there is no room left.
        KeyError
            Where there is no such member.
        """
        member = self._archive.getinfo(name)
        if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise ValueError(f"{name} is packed in a way that is not read; want stored or deflated")
        if member.file_size > self._left:
            raise ValueError(
                f"{name} has {member.file_size:,} bytes when unpacked; there is room for {self._left:,}"
            )
        self._left -= member.file_size
        return self._archive.read(member)

    def array(self, name: str) -> NDArray[Any]:
        """Return the array of a member by its name, with or without ``.npy``."""
        return array_of(self.read(name if name in self.names else f"{name}.npy"))


def read_arrays(path: Path, what: str) -> NDArray[Any] | dict[str, NDArray[Any]]:
    """Read an ``.npy`` or ``.npz`` file.

    Parameters
    ----------
    path : Path
        The file.
    what : str
        What it should be, for messages: ``an npz file``.

    Returns
    -------
    array or dict of arrays
        The array of an ``.npy``; the arrays of an ``.npz`` by their names.

    Raises
    ------
    FileNotFoundError, ValueError
        Where there is no such file, or it is no whole one, or claims more than it holds.
    """
    content = read_bytes(path)
    with reading(path, what):
        if content[: len(_MAGIC)] == _MAGIC:
            return array_of(content)
        archive = GuardedArchive(content)
        return named_arrays(archive, archive.names)


def named_arrays(archive: GuardedArchive, names: Iterable[str]) -> dict[str, NDArray[Any]]:
    """Return the arrays of an archive by their names without ``.npy``."""
    return {name.removesuffix(".npy"): archive.array(name) for name in names}


def array_of(content: bytes) -> NDArray[Any]:
    """Return the array of the bytes of an ``.npy`` file.

    Raises
    ------
    ValueError
        Where it claims another size than it has, or holds anything but numbers and text.
    """
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
