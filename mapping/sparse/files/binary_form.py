"""Sparse maps as few bytes: boxes in whole centimetres.

They are rounded outward, so that no point leaves its box.

A header (magic, version, counts, length, checksum) and one deflated body: the floor with the settings that
are not defaults, as JSON; then low corners and sizes of boxes, free codes, nodes of the graph and its
edges, as differences along strips of ground. Weights, normals and frames are not kept.
"""

import json
import struct
import zlib
from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.files.guarded_reading import read_bytes, reading
from lidarium.mapping.files.output import write_whole
from lidarium.mapping.sparse.files.former_lists import WIDTHS as FORMER_WIDTHS
from lidarium.mapping.sparse.files.former_lists import former_lists
from lidarium.mapping.sparse.files.integer_columns import BYTES, column_blocks, deflated, lists_of_columns
from lidarium.mapping.sparse.files.integer_lists import IntegerLists, coded_edges, decoded_edges
from lidarium.mapping.sparse.files.strip_order import COLUMNS, places_of_strips, strip_columns, strip_order
from lidarium.mapping.sparse.floor_plane import FloorPlane
from lidarium.mapping.sparse.settings import FloorSettings, MapperSettings
from lidarium.mapping.sparse.sparse_map import SparseMap, free_codes, occupied_codes

MAGIC = b"LIDSPMAP"
VERSION = 2
FORMER_VERSION = 1
"""Files of it are read."""

STEPS_A_METRE = 100
FARTHEST_M = 1e6
"""Largest coordinate [m]."""

MOST_FILE_BYTES = 256 << 20
MOST_BODY_BYTES = 1 << 30
_MOST_DEFLATED = 1032
_HEADER = struct.Struct("<8sHHIIIIIII")
_WIDTHS = (COLUMNS + 3, COLUMNS, COLUMNS, 2)
"""Columns of boxes, free codes, nodes and edges."""


class GraphEdges(NamedTuple):
    """What a file keeps of a graph.

    Attributes
    ----------
    nodes : (N, 3) float64
        Nodes [m].
    edges : (E, 2) int64
        Numbers of the nodes at both ends of each edge.
    """

    nodes: NDArray[np.float64]
    edges: NDArray[np.int64]


def write_binary(path: Path, sparse_map: SparseMap, graph: GraphEdges | None = None) -> None:
    """Write a map in binary form, whole or not at all.

    Parameters
    ----------
    path : Path
        The file.
    sparse_map : SparseMap
        The map.
    graph : GraphEdges or None
        A graph to keep with it.

    Raises
    ------
    ValueError
        Where coordinates are too large, or edges end at no node.
    OSError
        Where nothing can be written there.
    """
    write_whole(path, binary_content(sparse_map, graph))


def binary_content(sparse_map: SparseMap, graph: GraphEdges | None = None) -> bytes:
    """Return the bytes of a map's binary form."""
    low, high = _outward(sparse_map.boxes)
    free, graph = _nearest(sparse_map.free), graph or GraphEdges(np.empty((0, 3)), np.empty((0, 2), np.int64))
    nodes = _nearest(graph.nodes)
    places = np.concatenate([low, free, nodes])
    origin = places.min(axis=0) if len(places) else np.zeros(3, np.int64)
    order = strip_order(low, origin)
    nodes, edges = _ordered_graph(nodes, graph.edges, origin)
    lists = [
        np.concatenate([strip_columns(low[order], origin), (high - low)[order]], axis=1),
        strip_columns(free[strip_order(free, origin)], origin),
        strip_columns(nodes, origin),
        coded_edges(edges),
    ]
    about = json.dumps(_about(sparse_map, origin), separators=(",", ":")).encode()
    blocks = [struct.pack("<I", len(about)) + about, *column_blocks(lists)]
    length, packed = sum(map(len, blocks)), deflated(blocks)
    counts = [len(each) for each in lists]
    return _HEADER.pack(MAGIC, VERSION, 0, *counts, length, len(packed), zlib.crc32(packed)) + packed


def read_binary(path: Path) -> tuple[SparseMap, GraphEdges | None]:
    """Read a map in binary form, with its graph where it has one.

    Raises
    ------
    FileNotFoundError
        Where there is none.
    ValueError
        Where it is no such file, of another version, damaged, or claims more than it holds.
    """
    content = read_bytes(path, MOST_FILE_BYTES)
    with reading(path, "a sparse map"):
        return parsed_binary(content)


def parsed_binary(content: bytes) -> tuple[SparseMap, GraphEdges | None]:
    """Return the map, and the graph or None, of the bytes of a binary form."""
    version, counts, body = _unpacked(content)
    (length,) = struct.unpack_from("<I", body)
    start = 4 + length
    if start + _bytes_of(counts, version) != len(body):
        raise ValueError("its counts do not fit its length")
    about = json.loads(body[4:start])
    floor, settings = _from_about(about)
    lists = (
        former_lists(body[start:], counts)
        if version == FORMER_VERSION
        else _lists(body[start:], counts, np.array(about["origin"], np.int64).reshape(3))
    )
    low, sizes = lists.boxes[:, :3], lists.boxes[:, 3:]
    sparse_map = SparseMap(
        occupied=occupied_codes(_checked(np.stack([low, low + sizes], axis=1) / STEPS_A_METRE)),
        ground=free_codes(_checked(lists.free / STEPS_A_METRE)),
        floor=floor,
        settings=settings,
    )
    if len(lists.nodes) == 0:
        return sparse_map, None
    _check_edges(lists.edges, len(lists.nodes))
    return sparse_map, GraphEdges(lists.nodes / STEPS_A_METRE, lists.edges)


def _lists(content: bytes, counts: Sequence[int], origin: NDArray[np.int64]) -> IntegerLists:
    """Return the lists of boxes, free codes, nodes and edges of columns."""
    boxes, free, nodes, edges = lists_of_columns(content, counts, _WIDTHS)
    low = places_of_strips(boxes[:, :COLUMNS], origin)
    return IntegerLists(
        boxes=np.concatenate([low, boxes[:, COLUMNS:]], axis=1),
        free=places_of_strips(free, origin),
        nodes=places_of_strips(nodes, origin),
        edges=decoded_edges(edges),
    )


def _bytes_of(counts: Sequence[int], version: int) -> int:
    """Return how many bytes so many boxes, free codes, nodes and edges are."""
    widths = FORMER_WIDTHS if version == FORMER_VERSION else _WIDTHS
    return BYTES * sum(count * width for count, width in zip(counts, widths, strict=True))


def _unpacked(content: bytes) -> tuple[int, list[int], bytes]:
    """Return the version and the counts of the header, and the body that it claims."""
    if content[: len(MAGIC)] != MAGIC:
        raise ValueError(f"it begins with {content[: len(MAGIC)]!r}; want {MAGIC!r}")
    if len(content) < _HEADER.size:
        raise ValueError(f"it has {len(content)} bytes; want a header of {_HEADER.size}")
    _, version, flags, *counts, length, packed_length, checksum = _HEADER.unpack_from(content)
    if version not in (FORMER_VERSION, VERSION) or flags != 0:
        raise ValueError(
            f"it is of version {version}, flags {flags}; want version {FORMER_VERSION} or {VERSION}, flags 0"
        )
    packed = content[_HEADER.size :]
    if len(packed) != packed_length:
        raise ValueError(f"it claims {packed_length:,} bytes after the header; there are {len(packed):,}")
    if zlib.crc32(packed) != checksum:
        raise ValueError("its checksum is wrong: it is damaged")
    if length > min(MOST_BODY_BYTES, _MOST_DEFLATED * (len(packed) + 1)):
        raise ValueError(f"it claims {length:,} bytes when unpacked; so few bytes cannot hold them")
    if _bytes_of(counts, version) > length:
        raise ValueError(
            f"it claims {sum(counts):,} codes, nodes and edges; {length:,} bytes cannot hold them"
        )
    unpacking = zlib.decompressobj()
    body = unpacking.decompress(packed, length + 1)
    if len(body) != length or not unpacking.eof:
        raise ValueError(f"it does not unpack to the {length:,} bytes that it claims")
    return version, counts, body


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
    order = strip_order(nodes, origin)
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
