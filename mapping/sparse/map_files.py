"""Sparse maps as files: a compact binary form, and the text of the thesis.

References
----------
Sparse mapper, section 4, step 4.
"""

import json
import math
import struct
import zlib
from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.files.guarded_reading import open_guarded, read_bytes, read_text, reading
from lidarium.mapping.files.output import write_whole
from lidarium.mapping.sparse.floor_plane import FloorPlane
from lidarium.mapping.sparse.seen_floor import MAX_CELLS, MAX_STEP_CM, UNSEEN, SeenFloor
from lidarium.mapping.sparse.settings import FloorSettings, MapperSettings
from lidarium.mapping.sparse.sparse_map import SparseMap, free_codes, occupied_codes

BYTES = 4
"""Of a number."""


def _column_blocks(lists: Sequence[NDArray[np.int64]]) -> list[bytes]:
    """Return the columns of lists (N, C) of numbers from 0 to below 2^32, as blocks of bytes."""
    lowest, upper = [], []
    for numbers in lists:
        for column in numbers.T:
            planes = column.astype("<u4").view(np.uint8).reshape(-1, BYTES).T
            lowest.append(planes[0].tobytes())
            upper.append(planes[1:].tobytes())
    return [*lowest, b"".join(upper)]


def _lists_of_columns(content: bytes, counts: Sequence[int], widths: Sequence[int]) -> list[NDArray[np.int64]]:
    """Return the lists (count, width) whose blocks, joined, are the content."""
    sizes = [count * width for count, width in zip(counts, widths, strict=True)]
    whole = np.frombuffer(content, np.uint8)
    lowest, upper = np.split(whole, [sum(sizes)])
    ends = np.cumsum(sizes)[:-1]
    lists = []
    for low, high, count, width in zip(
        np.split(lowest, ends), np.split(upper, (BYTES - 1) * ends), counts, widths, strict=True
    ):
        planes = np.concatenate([low.reshape(width, 1, count), high.reshape(width, BYTES - 1, count)], axis=1)
        numbers = np.ascontiguousarray(planes.transpose(0, 2, 1)).view("<u4").reshape(width, count)
        lists.append(numbers.T.astype(np.int64))
    return lists


def _deflated(blocks: Sequence[bytes]) -> bytes:
    """Return blocks as one stream of zlib, in which each has codes of its own."""
    packing = zlib.compressobj(9, strategy=zlib.Z_FILTERED)
    parts = [packing.compress(block) + packing.flush(zlib.Z_BLOCK) for block in blocks]
    return b"".join(parts) + packing.flush()


class _IntegerLists(NamedTuple):
    """Boxes, free codes and graph of a map, in whole steps.

    Attributes
    ----------
    boxes : (M, 6) int64
        Low corners, then sizes.
    free : (N, 3) int64
        Free codes.
    nodes : (P, 3) int64
        Nodes of the graph.
    edges : (E, 2) int64
        Numbers of the nodes at both ends, the lower one first, in order.
    """

    boxes: NDArray[np.int64]
    free: NDArray[np.int64]
    nodes: NDArray[np.int64]
    edges: NDArray[np.int64]


def _coded_edges(edges: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return edges as differences of first nodes and distances to second ones."""
    return np.stack([np.diff(edges[:, 0], prepend=0), edges[:, 1] - edges[:, 0]], axis=1)


def _decoded_edges(coded: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the edges that `_coded_edges` was given."""
    first = np.cumsum(coded[:, 0])
    return np.stack([first, first + coded[:, 1]], axis=1)


STRIP = 40
"""Width of a strip [steps]: narrower ones have longer steps, in wider ones more lies across."""

COLUMNS = 4


def _strip_order(places: NDArray[np.int64], origin: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the order of places (N, 3) along the strips of an origin (3,), (N,)."""
    x, y, z = (places - origin).T
    strips = y // STRIP
    return np.lexsort((z, y, x * _directions(strips), strips))


def _strip_columns(places: NDArray[np.int64], origin: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return ordered places (N, 3), none below the origin (3,), as columns (N, 4) that are not negative."""
    x, y, z = (places - origin).T
    strips = y // STRIP
    steps = np.diff(x, prepend=0) * _directions(strips)
    return np.stack([(steps << 1) ^ (steps >> 63), y % STRIP, np.diff(strips, prepend=0), z], axis=1)


def _places_of_strips(columns: NDArray[np.int64], origin: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the places (N, 3) that `_strip_columns` was given."""
    coded, across, farther, z = columns.T
    strips = np.cumsum(farther)
    x = np.cumsum(((coded >> 1) ^ -(coded & 1)) * _directions(strips))
    return np.stack([x, strips * STRIP + across, z], axis=1) + origin


def _directions(strips: NDArray[np.int64]) -> NDArray[np.int64]:
    return 1 - 2 * (strips % 2)


MAGIC = b"LIDSPMAP"
VERSION = 2
"""Files of it are read."""

HAS_FLOOR = 1
"""Flag of files with the cells of the floor that was seen; others do not know them."""

STEPS_A_METRE = 100
FARTHEST_M = 1e6
"""Largest coordinate [m]."""

MAX_FILE_BYTES = 256 << 20
MAX_BODY_BYTES = 32 << 20
"""Longest body, unpacked: a code takes some ten times as much in memory."""

MIN_BODY_BYTES, BODY_RATIO = 4 << 20, 64
"""Longest body of any file, and its length for each packed byte: maps of rooms have 5 to 16."""

MIN_CELL_M = 0.01
"""Smallest cell of a floor [m]."""

_HEADER = struct.Struct("<8sHHIIIIIII")
_WIDTHS = (COLUMNS + 3, COLUMNS, COLUMNS, 2)
"""Columns of boxes, free codes, nodes and edges."""


class _GraphEdges(NamedTuple):
    """The graph as a file keeps it.

    Attributes
    ----------
    nodes : (N, 3) float64
        Nodes [m].
    edges : (E, 2) int64
        Numbers of the nodes at both ends of each edge.
    """

    nodes: NDArray[np.float64]
    edges: NDArray[np.int64]


def _write_binary(path: Path, sparse_map: SparseMap, graph: _GraphEdges | None = None) -> None:
    """Write a map in binary form, whole or not at all."""
    write_whole(path, binary_content(sparse_map, graph))


def binary_content(sparse_map: SparseMap, graph: _GraphEdges | None = None) -> bytes:
    """Return the bytes of a map's binary form."""
    low, high = _outward(sparse_map.boxes)
    graph = graph or _GraphEdges(np.empty((0, 3)), np.empty((0, 2), np.int64))
    free = _nearest(sparse_map.free)
    nodes = _nearest(graph.nodes)
    places = np.concatenate([low, free, nodes])
    origin = places.min(axis=0) if len(places) else np.zeros(3, np.int64)
    order = _strip_order(low, origin)
    nodes, edges = _ordered_graph(nodes, graph.edges, origin)
    lists = [
        np.concatenate([_strip_columns(low[order], origin), (high - low)[order]], axis=1),
        _strip_columns(free[_strip_order(free, origin)], origin),
        _strip_columns(nodes, origin),
        _coded_edges(edges),
    ]
    about = json.dumps(_about(sparse_map, origin), separators=(",", ":")).encode()
    seen = sparse_map.seen_floor
    blocks = [struct.pack("<I", len(about)) + about, *_column_blocks(lists), *([_row_changes(seen)] if seen else [])]
    length, packed = sum(map(len, blocks)), _deflated(blocks)
    counts = [len(each) for each in lists]
    return (
        _HEADER.pack(MAGIC, VERSION, HAS_FLOOR if seen else 0, *counts, length, len(packed), zlib.crc32(packed))
        + packed
    )


def _read_binary(path: Path) -> tuple[SparseMap, _GraphEdges | None]:
    """Read a map in binary form, with its graph if it has one."""
    content = read_bytes(path, MAX_FILE_BYTES)
    with reading(path, "a sparse map"):
        return _parsed_binary(content)


def _parsed_binary(content: bytes) -> tuple[SparseMap, _GraphEdges | None]:
    """Return the map, and the graph or None, of the bytes of a binary form."""
    flags, counts, body = _unpacked(content)
    (length,) = struct.unpack_from("<I", body)
    start = 4 + length
    end = start + _bytes_of(counts)
    if end > len(body):
        raise ValueError("its counts do not fit its length")
    about = json.loads(body[4:start])
    floor, settings = _from_about(about)
    seen = _seen_floor(about["cells"], body[end:]) if flags == HAS_FLOOR else None
    if seen is None and end != len(body):
        raise ValueError("its counts do not fit its length")
    lists = _lists(body[start:end], counts, np.array(about["origin"], np.int64).reshape(3))
    low, sizes = lists.boxes[:, :3], lists.boxes[:, 3:]
    sparse_map = SparseMap(
        occupied=occupied_codes(_checked(np.stack([low, low + sizes], axis=1) / STEPS_A_METRE)),
        ground=free_codes(_checked(lists.free / STEPS_A_METRE)),
        floor=floor,
        settings=settings,
        seen_floor=seen,
    )
    if len(lists.nodes) == 0:
        return sparse_map, None
    _check_edges(lists.edges, len(lists.nodes))
    return sparse_map, _GraphEdges(lists.nodes / STEPS_A_METRE, lists.edges)


def _lists(content: bytes, counts: Sequence[int], origin: NDArray[np.int64]) -> _IntegerLists:
    """Return the lists of boxes, free codes, nodes and edges of columns."""
    boxes, free, nodes, edges = _lists_of_columns(content, counts, _WIDTHS)
    low = _places_of_strips(boxes[:, :COLUMNS], origin)
    return _IntegerLists(
        boxes=np.concatenate([low, boxes[:, COLUMNS:]], axis=1),
        free=_places_of_strips(free, origin),
        nodes=_places_of_strips(nodes, origin),
        edges=_decoded_edges(edges),
    )


def _bytes_of(counts: Sequence[int]) -> int:
    """Return the number of bytes of boxes, free codes, nodes and edges, by their counts."""
    return BYTES * sum(count * width for count, width in zip(counts, _WIDTHS, strict=True))


def _row_changes(seen: SeenFloor) -> bytes:
    """Return the cells of a floor as their differences from the row before: most are zero."""
    return np.diff(seen.steps, axis=0, prepend=np.uint8(0)).tobytes()


def _seen_floor(about: list[Any], content: bytes) -> SeenFloor:
    """Return the floor whose cells `_row_changes` gave, by first column and row, rows, columns and side of a cell."""
    if len(about) != 5 or not all(isinstance(number, int) for number in about[:4]):
        raise ValueError(f"the cells of its floor are {about}; want four whole numbers and their side")
    low, (rows, columns), cell = about[:2], about[2:4], float(about[4])
    if not (rows >= 1 and columns >= 1 and rows * columns <= MAX_CELLS and rows * columns == len(content)):
        raise ValueError(f"its floor has {rows} x {columns} cells in {len(content):,} bytes; want as many of both")
    first = _checked(np.array(low, np.float64) * cell)
    _checked(first + np.array([columns, rows]) * cell)
    if not MIN_CELL_M <= cell <= FARTHEST_M:
        raise ValueError(f"its floor has cells of {cell} m; want at least {MIN_CELL_M} m")
    steps = np.cumsum(np.frombuffer(content, np.uint8).reshape(rows, columns), axis=0, dtype=np.uint8)
    if not ((steps <= MAX_STEP_CM) | (steps == UNSEEN)).all():
        raise ValueError(f"its floor has steps of more than {MAX_STEP_CM} cm: it is damaged")
    return SeenFloor(steps, np.array(low, np.int64), cell)


def _unpacked(content: bytes) -> tuple[int, list[int], bytes]:
    """Return the flags and counts of the header, and the body that it claims."""
    if content[: len(MAGIC)] != MAGIC:
        raise ValueError(f"it begins with {content[: len(MAGIC)]!r}; want {MAGIC!r}")
    if len(content) < _HEADER.size:
        raise ValueError(f"it has {len(content)} bytes; want a header of {_HEADER.size}")
    _, version, flags, *counts, length, packed_length, checksum = _HEADER.unpack_from(content)
    if version != VERSION or flags not in (0, HAS_FLOOR):
        raise ValueError(f"it is of version {version}, flags {flags}; want version {VERSION}, flags 0 or {HAS_FLOOR}")
    packed = content[_HEADER.size :]
    if len(packed) != packed_length:
        raise ValueError(f"it claims {packed_length:,} bytes after the header; there are {len(packed):,}")
    if zlib.crc32(packed) != checksum:
        raise ValueError("its checksum is wrong: it is damaged")
    if length > min(MAX_BODY_BYTES, max(MIN_BODY_BYTES, BODY_RATIO * len(packed))):
        raise ValueError(f"it claims {length:,} bytes when unpacked, too many for {len(packed):,} packed ones")
    if _bytes_of(counts) > length:
        raise ValueError(f"it claims {sum(counts):,} codes, nodes and edges; {length:,} bytes cannot hold them")
    unpacking = zlib.decompressobj()
    body = unpacking.decompress(packed, length + 1)
    if len(body) != length or not unpacking.eof:
        raise ValueError(f"it does not unpack to the {length:,} bytes that it claims")
    return flags, counts, body


def _checked(places: NDArray[np.float64]) -> NDArray[np.float64]:
    if not (np.abs(places) <= FARTHEST_M).all():
        raise ValueError(f"a coordinate of the map is not within {FARTHEST_M:,.0f} m; want metres")
    return places


def _nearest(points: NDArray[np.float64]) -> NDArray[np.int64]:
    return np.rint(_checked(points) * STEPS_A_METRE).astype(np.int64)


def _outward(boxes: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return low and high corners in steps, as read never inside the box."""
    low, high = _nearest(boxes[:, 0]), _nearest(boxes[:, 1])
    low -= low / STEPS_A_METRE > boxes[:, 0]
    high += high / STEPS_A_METRE < boxes[:, 1]
    return low, high


def _ordered_graph(
    nodes: NDArray[np.int64], edges: NDArray[np.int64], origin: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return nodes in strips, with the edges between them in order."""
    _check_edges(edges, len(nodes))
    order = _strip_order(nodes, origin)
    numbers = np.empty(len(order), np.int64)
    numbers[order] = np.arange(len(order))
    renumbered = np.sort(numbers[edges], axis=1)
    return nodes[order], renumbered[np.lexsort((renumbered[:, 1], renumbered[:, 0]))]


def _check_edges(edges: NDArray[np.int64], count: int) -> None:
    if len(edges) and not (edges.min() >= 0 and edges.max() < count):
        raise ValueError(f"edges end at nodes {edges.min()} to {edges.max()}; want some of {count}")


def _about(sparse_map: SparseMap, origin: NDArray[np.int64]) -> dict[str, Any]:
    """Return origin and floor, and the settings that are not defaults."""
    floor, settings = sparse_map.floor, asdict(sparse_map.settings)
    plain = asdict(MapperSettings())
    about: dict[str, Any] = {
        "origin": origin.tolist(),
        "floor": [floor.x, floor.y, floor.z, floor.offset],
    }
    seen = sparse_map.seen_floor
    if seen is not None:
        about["cells"] = [*seen.low.tolist(), *seen.steps.shape, seen.cell_m]
    about["settings"] = {name: value for name, value in settings.items() if value != plain[name]}
    return about


def _from_about(about: dict[str, Any]) -> tuple[FloorPlane, MapperSettings]:
    given = dict(about["settings"])
    names = {each.name for each in fields(MapperSettings)}
    if not set(given) <= names:
        raise ValueError(f"it has settings {sorted(set(given) - names)}; want some of {sorted(names)}")
    if "floor" in given:
        given["floor"] = FloorSettings(**given["floor"])
    return FloorPlane(*map(float, about["floor"])), MapperSettings(**given)


TITLE = "# sparse-map"
TEXT_VERSION = "v1"
DECIMALS = 6


_MIN_LINE = len("0 0 0")


def _write_text(path: Path, sparse_map: SparseMap) -> None:
    """Write the codes of a map as text, whole or not at all."""
    write_whole(path, text_content(sparse_map).encode())


def text_content(sparse_map: SparseMap) -> str:
    """Return a map's codes as text."""
    occupied, free = _by_distance(sparse_map.centres), _by_distance(sparse_map.free)
    lines = [f"{TITLE} {TEXT_VERSION} {len(occupied)} {len(free)}"]
    for x, y, z in np.concatenate([occupied, free]).tolist():
        lines.append(f"{x:.{DECIMALS}f} {y:.{DECIMALS}f} {z:.{DECIMALS}f}")
    return "\n".join(lines) + "\n"


def _read_text_map(path: Path) -> SparseMap:
    """Read a map that was written as text: its boxes have no size, its floor is z = 0."""
    text = read_text(path, MAX_FILE_BYTES)
    with reading(path, "a sparse map"):
        return _parsed_text(text)


def _parsed_text(text: str) -> SparseMap:
    """Return the map of a text."""
    head, _, rest = text.partition("\n")
    occupied_count, free_count = _counts(head)
    count = occupied_count + free_count
    if count * (_MIN_LINE + 1) > len(rest) + 1:
        raise ValueError(f"it claims {count:,} codes; {len(rest):,} letters cannot hold them")
    lines = rest.splitlines()
    if len(lines) != count:
        raise ValueError(f"it claims {count:,} codes; there are {len(lines):,} lines")
    points = np.empty((count, 3))
    for place, line in enumerate(lines):
        points[place] = _point(line, place + 2)
    occupied = points[:occupied_count]
    return SparseMap(
        occupied=occupied_codes(np.stack([occupied, occupied], axis=1)),
        ground=free_codes(points[occupied_count:]),
        settings=MapperSettings(mode="thesis"),
    )


def _counts(head: str) -> tuple[int, int]:
    """Return how many occupied and free codes the first line claims."""
    words = head.split()
    if words[:2] != TITLE.split() or len(words) != 5:
        raise ValueError(f"it begins with {head[:60]!r}; want '{TITLE} {TEXT_VERSION} n_occ n_free'")
    if words[2] != TEXT_VERSION:
        raise ValueError(f"it is of version {words[2][:20]!r}; want {TEXT_VERSION}")
    if not all(word.isascii() and word.isdigit() and len(word) <= 9 for word in words[3:]):
        raise ValueError(f"its counts are {' '.join(words[3:])[:60]!r}; want two whole numbers")
    return int(words[3]), int(words[4])


def _point(line: str, number: int) -> tuple[float, float, float]:
    words = line.split()
    try:
        x, y, z = map(float, words)
    except ValueError:
        raise ValueError(f"line {number} is {line[:60]!r}; want three numbers x y z") from None
    if not all(math.isfinite(value) and abs(value) <= FARTHEST_M for value in (x, y, z)):
        raise ValueError(f"line {number} is {line[:60]!r}; want numbers within {FARTHEST_M:,.0f} m")
    return x, y, z


def _by_distance(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sort points (N, 3) by their distance to the origin; equal ones stay in order."""
    if not (np.abs(points) <= FARTHEST_M).all():
        raise ValueError(f"a coordinate of the map is not within {FARTHEST_M:,.0f} m; want metres")
    return points[np.argsort(np.linalg.norm(points, axis=1), kind="stable")]


TEXT_SUFFIX, BINARY_SUFFIX = ".txt", ".smap"

_LARGEST_POINT_M = 0.02
"""Maximum side of a point's box, which the binary form rounds outwards to centimetres [m]."""


def write_sparse_map(path: Path, sparse_map: SparseMap, graph: _GraphEdges | None = None) -> None:
    """Write a map, whole or not at all.

    The thesis's text if the name ends in ``.txt``, the binary form if it ends in ``.smap``. A map with boxes that have
    a size does not fit into a text: paths would lead through them.
    """
    if path.suffix == BINARY_SUFFIX:
        _write_binary(path, sparse_map, graph)
    elif path.suffix != TEXT_SUFFIX:
        raise ValueError(f"{path} is no name for a sparse map; want one that ends in {BINARY_SUFFIX} or {TEXT_SUFFIX}")
    elif graph is not None:
        raise ValueError(f"{path} is a text, which keeps no graph; want a name that ends in {BINARY_SUFFIX}")
    elif sized := int((np.ptp(sparse_map.boxes, axis=1) > _LARGEST_POINT_M).any(axis=1).sum()):
        raise ValueError(
            f"{path} is a text, which keeps the centres of boxes alone, and {sized:,} boxes of the map have a size; "
            f"want a name that ends in {BINARY_SUFFIX}"
        )
    else:
        _write_text(path, sparse_map)


def read_sparse_map(path: Path) -> tuple[SparseMap, _GraphEdges | None]:
    """Read a map, with the graph if the file has one."""
    with open_guarded(path) as file:
        is_binary = file.read(len(MAGIC)) == MAGIC
    return _read_binary(path) if is_binary or path.suffix == BINARY_SUFFIX else (_read_text_map(path), None)
