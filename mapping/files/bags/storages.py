"""Storages of bags: MCAP, sqlite and ROS 1 files, split or compressed, read within bounds.

A bag is made of one or more storages. MCAP files are read by ``mcap``, bags of ROS 1 and all messages by
``rosbags``, sqlite files by the standard library: their schema has two tables, and only there can the number
of its steps be limited.
"""

import bz2
import io
import os
import re
import sqlite3
import struct
import tempfile
import urllib.parse
from collections.abc import Callable, Collection, Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.reader import SeekingReader
from mcap.records import Chunk
from rosbags.rosbag1.reader import ChunkInfo, IndexData, Reader, ReaderError, decompressors
from rosbags.serde import SerdeError
from rosbags.typesys import TypesysError

from lidarium.mapping.files.bags.messages import BAG_SUFFIXES, READ, normalized
from lidarium.mapping.files.guarded_reading import (
    MAX_FILE_BYTES,
    max_unpacked,
    open_guarded,
    printable,
    read_text,
)

WANTED = "want a whole bag of ROS: .mcap, .db3, .bag, or a folder of these"
"""The cure that errors name."""

STORAGE_ERRORS = (
    AssertionError,
    McapError,
    ReaderError,
    SerdeError,
    TypesysError,
    sqlite3.Error,
    zstandard.ZstdError,
)
"""Errors that the libraries raise on damaged bags, besides those of ``guarded_reading``."""

_MCAP_BYTES = 64
"""An MCAP file has its magic bytes twice, a header and a footer."""

_RECORD_BYTES = 1 << 28
"""Maximum length of a record of an MCAP file."""

_MAP_RATIO = 2
"""Chunks also hold maps, which compress better than scans."""

_SQL_STEPS, _SQL_STEPS_PER_BYTE = 2_000_000, 30
"""Maximum number of steps of sqlite's virtual machine for a file: joins and views multiply rows."""

_MAX_TOPICS = 10_000

_ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
"""Begins a compressed message; messages in CDR begin with a zero."""

_LISTED = re.compile(r"^\s*-\s+(\S+\.(?:mcap|db3)(?:\.zstd)?)\s*$", re.MULTILINE)
"""Files that a metadata.yaml lists."""


class _Storage(NamedTuple):
    """One open file of a bag.

    Attributes
    ----------
    types : dict of str to str
        Type of the messages by topic, such as ``sensor_msgs/msg/LaserScan``.
    messages : callable
        Yields log time [ns], topic and bytes of the messages of some topics.
    is_ros1 : bool
        Whether messages are encoded as in ROS 1.
    """

    types: dict[str, str]
    messages: Callable[[Collection[str]], Iterator[tuple[int, str, bytes]]]
    is_ros1: bool = False


class _Budget:
    """Number of bytes that may still be unpacked."""

    def __init__(self, allowed: int, refusal: str) -> None:
        self.left = allowed
        self._refusal = refusal

    def take(self, count: int) -> None:
        """Count bytes; raise ValueError if there are too many."""
        self.left -= count
        if self.left < 0:
            raise ValueError(self._refusal)


@contextmanager
def open_storages(path: Path) -> Iterator[list[_Storage]]:
    """Open the storages of a bag: of a file, or of all files in a folder, in order of their names."""
    files = _storage_files(path)
    size = 0
    for file in files:
        with open_guarded(file) as opened:
            size += os.fstat(opened.fileno()).st_size
        if size > MAX_FILE_BYTES:
            raise ValueError(f"{path} has {size:,} bytes and more; want at most {MAX_FILE_BYTES:,}")
    allowed = max_unpacked(size)
    unpacked = _Budget(
        _MAP_RATIO * allowed, f"{path} has more than {_MAP_RATIO * allowed:,} bytes when unpacked; want fewer"
    )
    messages = _Budget(allowed, f"{path} packs its scans too well; want a bag of a robot")
    with ExitStack() as stack:
        storages = []
        for file in files:
            if file.suffix == ".zstd":
                folder = stack.enter_context(tempfile.TemporaryDirectory())
                file = _unpacked_file(file, Path(folder), unpacked)
            if file.suffix not in _OPENERS:
                raise ValueError(f"{path} is not a bag by its name; {WANTED}")
            storage = stack.enter_context(_OPENERS[file.suffix](file, unpacked))
            storages.append(storage._replace(messages=_within(storage, messages)))
        yield storages


def _storage_files(path: Path) -> list[Path]:
    if not path.is_dir():
        return [path]
    files = sorted(
        (file for file in path.iterdir() if file.name.endswith(BAG_SUFFIXES)),
        # Parts are numbered without leading zeros.
        key=lambda file: [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", file.name)],
    )
    metadata = path / "metadata.yaml"
    listed = _LISTED.findall(read_text(metadata, 1 << 22)) if metadata.exists() else []
    missing = {Path(name).name for name in listed} - {file.name for file in files}
    if missing:
        raise ValueError(f"{path} has no {printable(min(missing))}, which its metadata.yaml lists; {WANTED}")
    if not files:
        raise ValueError(f"{path} is a folder without a bag; {WANTED}")
    return files


def _within(storage: _Storage, budget: _Budget) -> Callable[[Collection[str]], Iterator[tuple[int, str, bytes]]]:
    """Return the messages of a storage, unpacked and counted."""

    def messages(topics: Collection[str]) -> Iterator[tuple[int, str, bytes]]:
        for time, topic, content in storage.messages(topics):
            if not storage.is_ros1 and content[:4] == _ZSTD_MAGIC:
                content = _unpacked("zstd", content, budget)
            else:
                budget.take(len(content))
            yield time, topic, content

    return messages


def _zstd_stream(file: BinaryIO) -> BinaryIO:
    stream: BinaryIO = zstandard.ZstdDecompressor().stream_reader(file, read_across_frames=True)
    return stream


_STREAMS: dict[str, Callable[[BinaryIO], Any]] = {
    "": lambda file: file,
    "none": lambda file: file,
    "bz2": bz2.BZ2File,
    "lz4": lz4.frame.LZ4FrameFile,
    "zstd": _zstd_stream,
}


def _unpacked(compression: str, content: bytes, budget: _Budget) -> bytes:
    """Return decompressed bytes; no more of them are made than the budget allows, plus one."""
    found: bytes = _STREAMS[compression](io.BytesIO(content)).read(budget.left + 1)
    budget.take(len(found))
    return found


def _unpacked_file(path: Path, folder: Path, budget: _Budget) -> Path:
    """Decompress a file into a folder."""
    whole = folder / path.stem
    with open_guarded(path) as packed, whole.open("wb") as file:
        stream = _zstd_stream(packed)
        while piece := stream.read(1 << 20):
            budget.take(len(piece))
            file.write(piece)
    return whole


@contextmanager
def _open_mcap(path: Path, budget: _Budget) -> Iterator[_Storage]:
    with open_guarded(path) as file:
        if file.seek(0, os.SEEK_END) < _MCAP_BYTES:
            raise ValueError(f"{path} is not a whole bag, it is cut off; {WANTED}")
        file.seek(0)
        reader = SeekingReader(file, validate_crcs=True, record_size_limit=_RECORD_BYTES)
        summary = reader.get_summary()
        if summary is None:
            raise ValueError(f"{path} has no index at its end, it is cut off; {WANTED}")
        for index in summary.chunk_indexes:
            file.seek(index.chunk_start_offset + 9)  # after the record's type and length
            chunk = Chunk.read(ReadDataStream(file))
            budget.take(chunk.uncompressed_size)
            if not _has_stated_size(chunk):
                raise ValueError(f"{path} has a chunk of another size than it says; {WANTED}")
        file.seek(0)
        types, encodings = {}, set()
        for channel in summary.channels.values():
            schema = summary.schemas.get(channel.schema_id)
            types[channel.topic] = "" if schema is None else normalized(schema.name)
            if types[channel.topic] in READ:
                encodings.add(channel.message_encoding)
        if encodings not in ({"cdr"}, {"ros1"}, set()):
            raise ValueError(f"{path} has messages in {', '.join(map(printable, sorted(encodings)))}; {WANTED}")

        def messages(topics: Collection[str]) -> Iterator[tuple[int, str, bytes]]:
            # Sorted by the caller: the reader's own queue takes half as long as decoding.
            for _, channel, message in reader.iter_messages(topics, log_time_order=False):
                yield message.log_time, channel.topic, message.data

        yield _Storage(types, messages, encodings == {"ros1"})


def _encoded_otherwise(path: Path, encodings: Collection[str]) -> str:
    return f"{path} has messages in {', '.join(map(printable, sorted(encodings)))}; {WANTED}"


def _has_stated_size(chunk: Chunk) -> bool:
    """Whether a chunk of an MCAP file has as many bytes as it says: it is unpacked without a limit."""
    if chunk.compression == "zstd":
        return zstandard.frame_content_size(chunk.data) in (-1, chunk.uncompressed_size)
    if chunk.compression == "lz4":
        stream = lz4.frame.LZ4FrameFile(io.BytesIO(chunk.data))
        return len(stream.read(chunk.uncompressed_size + 1)) == chunk.uncompressed_size
    return True


def _check_whole_sqlite(path: Path) -> None:
    """Refuse a database that lacks pages, or whose last messages are in a log beside it: both would be missing.

    Page size and count are at bytes 16 and 28 (SQLite, "Database File Format", 1.3).
    """
    with open_guarded(path) as file:
        header = file.read(100)
        size = file.seek(0, os.SEEK_END)
    if len(header) == 100:
        side, pages = struct.unpack(">H10xI", header[16:32])
        if size < pages * (65536 if side == 1 else side):
            raise ValueError(f"{path} is not a whole bag, it is cut off; {WANTED}")
    log = path.with_name(f"{path.name}-wal")
    if log.is_file() and log.stat().st_size:
        raise ValueError(
            f"{path} was not closed, its last messages are in {log.name}; want them in it, as by "
            f"sqlite3 {path.name} 'PRAGMA wal_checkpoint(TRUNCATE)'"
        )


@contextmanager
def _open_sqlite(path: Path, budget: _Budget) -> Iterator[_Storage]:
    _check_whole_sqlite(path)
    size = path.stat().st_size
    steps = iter(range((_SQL_STEPS + _SQL_STEPS_PER_BYTE * size) // 10_000))
    uri = f"file:{urllib.parse.quote(str(path.absolute()))}?mode=ro&immutable=1"
    with closing(sqlite3.connect(uri, uri=True)) as database:
        database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, max(budget.left, 1))
        database.set_progress_handler(lambda: next(steps, None) is None, 10_000)
        database.execute("PRAGMA trusted_schema = OFF")
        rows = database.execute(
            "SELECT id, name, type, serialization_format FROM topics LIMIT ?", (_MAX_TOPICS,)
        ).fetchall()
        names = {identifier: str(name) for identifier, name, *_ in rows}
        types = {str(name): normalized(str(kind)) for _, name, kind, _ in rows}
        formats = {str(encoding) for _, name, _, encoding in rows if types[str(name)] in READ}
        if formats - {"cdr"}:
            raise ValueError(_encoded_otherwise(path, formats))

        def messages(topics: Collection[str]) -> Iterator[tuple[int, str, bytes]]:
            for identifier, time, content in database.execute("SELECT topic_id, timestamp, data FROM messages"):
                if names.get(identifier) in topics:
                    yield int(time), names[identifier], bytes(memoryview(content))

        yield _Storage(types, messages)


class _Ros1Reader(Reader):
    """Reads no index twice: chunks that share one would multiply its entries."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._positions: set[int] = set()
        self._left = path.stat().st_size

    def read_chunk_info(self) -> ChunkInfo:
        info = super().read_chunk_info()
        if info.pos in self._positions:
            raise ReaderError("its index lists a chunk twice")
        self._positions.add(info.pos)
        return info

    def read_index_data(self, pos: int, indexes: dict[int, list[IndexData]]) -> None:
        assert self.bio is not None
        before = self.bio.tell()
        super().read_index_data(pos, indexes)
        self._left -= self.bio.tell() - before
        if self._left < 0:
            raise ReaderError("its index is longer than the file")


@contextmanager
def _open_ros1(path: Path, budget: _Budget) -> Iterator[_Storage]:
    with _Ros1Reader(path) as reader:
        compressions = {function: name for name, function in decompressors.items()}
        for pos, chunk in reader.chunks.items():
            # Bounded here, and again each time that messages alternate between chunks.
            unpack = _bounded(compressions[chunk.decompressor], budget)
            reader.chunks[pos] = chunk._replace(decompressor=unpack)

        def messages(topics: Collection[str]) -> Iterator[tuple[int, str, bytes]]:
            wanted = [each for each in reader.connections if each.topic in topics]
            for connection, time, content in reader.messages(wanted) if wanted else ():
                yield time, connection.topic, content

        types = {each.topic: normalized(each.msgtype) for each in reader.connections}
        yield _Storage(types, messages, is_ros1=True)


def _bounded(compression: str, budget: _Budget) -> Callable[[bytes], bytes]:
    return lambda content: _unpacked(compression, content, budget)


_OPENERS = {".mcap": _open_mcap, ".db3": _open_sqlite, ".bag": _open_ros1}
