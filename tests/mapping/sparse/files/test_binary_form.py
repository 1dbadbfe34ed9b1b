"""Maps come back from their binary form to the stated precision, damaged files are refused."""

import base64
import struct
import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_sparse_maps import SETTINGS, TRIPLES, some_map

from lidarium.mapping.sparse.files.binary_form import (
    _HEADER,
    GraphEdges,
    binary_content,
    parsed_binary,
    read_binary,
)
from lidarium.mapping.sparse.files.map_files import read_sparse_map, write_sparse_map
from lidarium.mapping.sparse.floor_plane import FloorPlane
from lidarium.mapping.sparse.settings import MapperSettings
from lidarium.mapping.sparse.sparse_map import SparseMap, free_codes, occupied_codes

FORMER_FILE = (
    "Oi4sjP)$Kl0RR912mk;81^@s61ONa40{{R3lmP$$>i_@%QBXjqc-nJdU|^_LO3TU5FH*9KHqbNEG0-yrVhbQPj@3~rPAw_P%"
    "u6p;vZ_`pF38C&QL<7>$}h=K0!gK&C|Q};)=oTJ!1JR!%%6dQiIIVYnTY`nT<7BvT98xB#RO8o$iRp$e^EjxdA8uC6egf{Mn"
    ")zK{i~$<mT(x%c*4j8lm-HHc?P}%0#!y_`xt=o42&4s84P$HJUG<X5d$)v0SkE4c!E(kgMo>ekp)F_@wd=fA6S@x9zr#fg^`"
    "V$kqy(FIH}X07?~NFVf=mKao?CgVFCqnnEX$$qIe%+E)xq2oDBe4)-)a"
)
"""A map as version 1 of the form was written, in base 85."""


FORMER_BOXES = [
    [-73, -364, -361, 140, -364, -209],
    [-171, -357, -93, 98, -94, -87],
    [141, -351, 44, 212, -255, 284],
    [275, -86, -6, 485, 50, 234],
    [399, 122, -212, 531, 183, -115],
    [-183, 304, -349, -31, 457, -278],
    [244, 246, 12, 448, 507, 80],
    [-52, 379, 318, 190, 474, 364],
]
FORMER_FREE = [
    [113, -314, 2],
    [-208, 193, 1],
    [276, -106, 4],
    [147, -29, -2],
    [-388, 347, -3],
    [-80, 349, 0],
]
FORMER_NODES = [[175, 351, 718], [572, 339, 719], [342, 642, 551], [847, 893, 651]]


def sorted_rows(values):
    return values[np.lexsort(values.T)]


def outward_steps(box):
    """Whole centimetres of the smallest box that holds another one, low corner first."""
    low = [
        max(step for step in range(round(100 * x) - 2, round(100 * x) + 3) if step / 100 <= x) for x in box[0]
    ]
    high = [
        min(step for step in range(round(100 * x) - 2, round(100 * x) + 3) if step / 100 >= x) for x in box[1]
    ]
    return low + high


def rewritten(content, **changes):
    """Return a binary form with other fields in its header, the checksum put right."""
    names = ("magic", "version", "flags", "boxes", "free", "nodes", "edges", "length", "packed", "checksum")
    fields = dict(zip(names, _HEADER.unpack_from(content), strict=True))
    body = changes.pop("body", content[_HEADER.size :])
    fields |= {"packed": len(body), "checksum": zlib.crc32(body)} | changes
    return _HEADER.pack(*fields.values()) + body


@given(TRIPLES, TRIPLES, TRIPLES)
def test_binary_boxes_hold_what_they_held_to_a_centimetre(corners, others, free):
    count = min(len(corners), len(others))
    boxes = np.sort(np.stack([corners[:count], others[:count]], axis=1), axis=1)
    before = SparseMap(occupied=occupied_codes(boxes), ground=free_codes(free))
    after, graph = parsed_binary(binary_content(before))
    assert graph is None
    expected = sorted(outward_steps(box) for box in boxes)
    assert sorted(np.rint(100.0 * box).astype(int).ravel().tolist() for box in after.boxes) == expected
    np.testing.assert_array_equal(
        sorted_rows(np.rint(after.free * 100.0)), sorted_rows(np.rint(np.rint(free * 100.0)))
    )
    # What was read is written to the same bytes.
    assert binary_content(after) == binary_content(before)


@given(TRIPLES)
def test_no_point_leaves_its_box(corners):
    for corner in corners:
        box = np.stack([corner, corner])[None]
        after, _ = parsed_binary(
            binary_content(SparseMap(occupied=occupied_codes(box), ground=free_codes([])))
        )
        assert (after.boxes[0, 0] <= corner).all()
        assert (after.boxes[0, 1] >= corner).all()


def test_floor_and_settings_come_back():
    after, _ = parsed_binary(binary_content(some_map()))
    assert after.floor == FloorPlane(0.6, 0.0, 0.8, 0.3)
    assert after.settings == SETTINGS


def test_a_graph_comes_back_with_its_edges(tmp_path):
    rng = np.random.default_rng(1)
    nodes = np.rint(rng.uniform(0.0, 900.0, (50, 3))) / 100.0
    edges = np.array([(i, j) for i in range(50) for j in range(i + 1, 50) if rng.random() < 0.1])
    path = tmp_path / "room.smap"
    write_sparse_map(path, some_map(), GraphEdges(nodes, edges))
    _, graph = read_sparse_map(path)
    assert graph is not None

    def ends(nodes, edges):
        return {frozenset([tuple(nodes[a].tolist()), tuple(nodes[b].tolist())]) for a, b in edges.tolist()}

    assert ends(graph.nodes, graph.edges) == ends(nodes, edges)
    with pytest.raises(ValueError, match="edges end at nodes"):
        write_sparse_map(path, some_map(), GraphEdges(nodes[:10], edges))


@given(st.data())
def test_a_damaged_binary_file_is_refused(data):
    content = bytearray(binary_content(some_map(10)))
    if data.draw(st.booleans()):
        content = content[: data.draw(st.integers(0, len(content) - 1))]
    else:
        place = data.draw(st.integers(0, len(content) - 1))
        content[place] ^= data.draw(st.integers(1, 255))
    with pytest.raises((ValueError, struct.error)):
        parsed_binary(bytes(content))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"version": 3}, "version 3"),
        ({"boxes": 2**32 - 1}, "cannot hold them"),
        ({"length": 2**32 - 1, "boxes": 10**8}, "so few bytes cannot hold them"),
        ({"boxes": 59}, "do not fit its length"),
        ({"checksum": 1}, "checksum"),
        ({"packed": 5}, "claims 5 bytes"),
        ({"length": 5000}, "does not unpack"),
        ({"body": b"no zlib", "length": 2500}, "header check"),
    ],
)
def test_a_binary_file_that_lies_is_refused_by_its_name(tmp_path, changes, message):
    path = tmp_path / "lie.smap"
    path.write_bytes(rewritten(binary_content(some_map()), **changes))
    with pytest.raises(ValueError, match=message) as caught:
        read_binary(path)
    assert str(path) in str(caught.value)


def test_a_binary_file_with_a_place_too_far_away_is_refused_by_its_name(tmp_path):
    content = binary_content(SparseMap(occupied=occupied_codes(np.zeros((1, 2, 3))), ground=free_codes([])))
    body = zlib.decompress(content[_HEADER.size :]).replace(b'"origin":[0,0,0]', b'"origin":[9e9,0,0]')
    (length,) = struct.unpack_from("<I", body)
    body = struct.pack("<I", length + 2) + body[4:]
    path = tmp_path / "far.smap"
    path.write_bytes(rewritten(content, length=len(body), body=zlib.compress(body)))
    with pytest.raises(ValueError, match=r"far.smap.*not within 1,000,000 m"):
        read_binary(path)


def test_files_of_the_first_version_are_read():
    former, graph = parsed_binary(base64.b85decode(FORMER_FILE))
    assert np.rint(100.0 * former.boxes).astype(int).reshape(-1, 6).tolist() == FORMER_BOXES
    assert np.rint(100.0 * former.free).astype(int).tolist() == FORMER_FREE
    assert former.floor == FloorPlane(0.6, 0.0, 0.8, 0.3)
    assert former.settings == MapperSettings(split="both", seed=7)
    assert np.rint(100.0 * graph.nodes).astype(int).tolist() == FORMER_NODES
    assert graph.edges.tolist() == [[0, 1], [0, 2], [1, 3]]
    again, _ = parsed_binary(binary_content(former, graph))
    np.testing.assert_array_equal(
        sorted_rows(again.boxes.reshape(-1, 6)), sorted_rows(former.boxes.reshape(-1, 6))
    )
