"""Columns of numbers come back from their blocks, which have codes of their own."""

import os
import struct
import zlib
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from made_sparse_maps import SETTINGS, TRIPLES, some_map

from lidarium.mapping.sparse.floor_plane import FloorPlane
from lidarium.mapping.sparse.map_files import (
    _HEADER,
    _coded_edges,
    _column_blocks,
    _decoded_edges,
    _deflated,
    _GraphEdges,
    _lists_of_columns,
    _parsed_binary,
    _parsed_text,
    _places_of_strips,
    _read_binary,
    _read_text_map,
    _strip_columns,
    _strip_order,
    binary_content,
    read_sparse_map,
    text_content,
    write_sparse_map,
)
from lidarium.mapping.sparse.sparse_map import SparseMap, free_codes, occupied_codes


@given(
    st.lists(
        arrays(np.int64, st.tuples(st.integers(0, 9), st.integers(1, 6)), elements=st.integers(0, 2**32 - 1)),
        min_size=1,
    )
)
def test_columns_come_back(lists):
    blocks = _column_blocks(lists)
    content = zlib.decompress(_deflated(blocks))
    assert content == b"".join(blocks)
    assert len(content) == 4 * sum(each.size for each in lists)
    counts, widths = zip(*(each.shape for each in lists), strict=True)
    for found, expected in zip(_lists_of_columns(content, counts, widths), lists, strict=True):
        np.testing.assert_array_equal(found, expected)


def test_columns_of_unlike_numbers_have_codes_of_their_own():
    rng = np.random.default_rng(0)
    unlike = np.stack([rng.integers(0, 4, 2000), 100 + rng.integers(0, 64, 2000)], axis=1)
    blocks = _column_blocks([unlike])
    together = zlib.compress(b"".join(blocks), 9)
    assert len(_deflated(blocks)) < 0.9 * len(together)


@pytest.mark.parametrize("count", [0, 1, 200])
def test_edges_come_back(count):
    generator = np.random.default_rng(count)
    first = np.sort(generator.integers(0, 1000, count))
    edges = np.stack([first, first + generator.integers(1, 90, count)], axis=1)
    np.testing.assert_array_equal(_decoded_edges(_coded_edges(edges)), edges)


def test_edges_in_order_are_coded_by_small_numbers_from_zero():
    edges = np.array([[3, 7], [3, 9], [5, 6]])
    assert _coded_edges(edges).tolist() == [[3, 4], [0, 6], [2, 1]]


def sorted_rows(values):
    return values[np.lexsort(values.T)]


@given(arrays(np.int64, st.tuples(st.integers(0, 30), st.just(3)), elements=st.integers(-(10**8), 10**8)))
def test_places_come_back_from_strips(places):
    origin = np.full(3, -(10**8))
    ordered = places[_strip_order(places, origin)]
    columns = _strip_columns(ordered, origin)
    assert (columns >= 0).all()
    np.testing.assert_array_equal(_places_of_strips(columns, origin), ordered)
    np.testing.assert_array_equal(sorted_rows(ordered), sorted_rows(places))


def test_neighbours_are_near_in_strips():
    places = np.stack(np.meshgrid(*[np.arange(0, 200, 10)] * 2, [5]), axis=-1).reshape(-1, 3)
    steps = np.diff(places[_strip_order(places, np.zeros(3, np.int64))], axis=0)
    assert np.abs(steps[:, 0]).max() == 10
    assert np.abs(steps[:, 1]).max() == 30


def outward_steps(box):
    """Whole centimetres of the smallest box that holds another one, low corner first."""
    low = [max(step for step in range(round(100 * x) - 2, round(100 * x) + 3) if step / 100 <= x) for x in box[0]]
    high = [min(step for step in range(round(100 * x) - 2, round(100 * x) + 3) if step / 100 >= x) for x in box[1]]
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
    after, graph = _parsed_binary(binary_content(before))
    assert graph is None
    expected = sorted(outward_steps(box) for box in boxes)
    assert sorted(np.rint(100.0 * box).astype(int).ravel().tolist() for box in after.boxes) == expected
    np.testing.assert_array_equal(sorted_rows(np.rint(after.free * 100.0)), sorted_rows(np.rint(np.rint(free * 100.0))))
    # What was read is written to the same bytes.
    assert binary_content(after) == binary_content(before)


@given(TRIPLES)
def test_no_point_leaves_its_box(corners):
    for corner in corners:
        box = np.stack([corner, corner])[None]
        after, _ = _parsed_binary(binary_content(SparseMap(occupied=occupied_codes(box), ground=free_codes([]))))
        assert (after.boxes[0, 0] <= corner).all()
        assert (after.boxes[0, 1] >= corner).all()


def test_floor_and_settings_come_back():
    after, _ = _parsed_binary(binary_content(some_map()))
    assert after.floor == FloorPlane(0.6, 0.0, 0.8, 0.3)
    assert after.settings == SETTINGS


def test_a_graph_comes_back_with_its_edges(tmp_path):
    rng = np.random.default_rng(1)
    nodes = np.rint(rng.uniform(0.0, 900.0, (50, 3))) / 100.0
    edges = np.array([(i, j) for i in range(50) for j in range(i + 1, 50) if rng.random() < 0.1])
    path = tmp_path / "room.smap"
    write_sparse_map(path, some_map(), _GraphEdges(nodes, edges))
    _, graph = read_sparse_map(path)
    assert graph is not None

    def ends(nodes, edges):
        return {frozenset([tuple(nodes[a].tolist()), tuple(nodes[b].tolist())]) for a, b in edges.tolist()}

    assert ends(graph.nodes, graph.edges) == ends(nodes, edges)
    with pytest.raises(ValueError, match="edges end at nodes"):
        write_sparse_map(path, some_map(), _GraphEdges(nodes[:10], edges))


@given(st.data())
def test_a_damaged_binary_file_is_refused(data):
    content = bytearray(binary_content(some_map(10)))
    if data.draw(st.booleans()):
        content = content[: data.draw(st.integers(0, len(content) - 1))]
    else:
        place = data.draw(st.integers(0, len(content) - 1))
        content[place] ^= data.draw(st.integers(1, 255))
    with pytest.raises((ValueError, struct.error)):
        _parsed_binary(bytes(content))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"version": 3}, "version 3"),
        ({"boxes": 2**32 - 1}, "cannot hold them"),
        ({"length": 2**32 - 1, "boxes": 10**8}, "claims 4,294,967,295 bytes when unpacked, too many"),
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
        _read_binary(path)
    assert str(path) in str(caught.value)


def test_a_small_file_that_unpacks_to_millions_of_codes_is_refused(tmp_path):
    content = binary_content(some_map())
    body = zlib.compress(bytes(64 << 20), 9)
    path = tmp_path / "bomb.smap"
    path.write_bytes(rewritten(content, length=64 << 20, body=body, free=10**6))
    with pytest.raises(ValueError, match=r"bomb.smap.* claims 67,108,864 bytes when unpacked, too many for"):
        _read_binary(path)


def test_a_binary_file_with_a_place_too_far_away_is_refused_by_its_name(tmp_path):
    content = binary_content(SparseMap(occupied=occupied_codes(np.zeros((1, 2, 3))), ground=free_codes([])))
    body = zlib.decompress(content[_HEADER.size :]).replace(b'"origin":[0,0,0]', b'"origin":[9e9,0,0]')
    (length,) = struct.unpack_from("<I", body)
    body = struct.pack("<I", length + 2) + body[4:]
    path = tmp_path / "far.smap"
    path.write_bytes(rewritten(content, length=len(body), body=zlib.compress(body)))
    with pytest.raises(ValueError, match=r"far.smap.*not within 1,000,000 m"):
        _read_binary(path)


def test_text_is_as_the_thesis_has_it():
    boxes = np.array([[[3.0, 0, 0], [3, 0, 0]], [[1.0, 2, 2], [1, 2, 2]], [[0, 0, -3.0], [0, 0, -3]]])
    found = text_content(SparseMap(occupied=occupied_codes(boxes), ground=free_codes([[0.5, -0.25, 0.0]])))
    assert found.splitlines() == [
        "# sparse-map v1 3 1",
        "3.000000 0.000000 0.000000",
        "1.000000 2.000000 2.000000",
        "0.000000 0.000000 -3.000000",
        "0.500000 -0.250000 0.000000",
    ]


@given(TRIPLES, TRIPLES)
def test_text_comes_back_to_six_decimals(occupied, free):
    codes = occupied_codes(np.stack([occupied, occupied], axis=1))
    after = _parsed_text(text_content(SparseMap(occupied=codes, ground=free_codes(free))))
    for found, expected in ((after.centres, occupied), (after.free, free)):
        order = np.argsort(np.linalg.norm(expected, axis=1), kind="stable")
        np.testing.assert_allclose(found, expected[order], atol=5.1e-7, rtol=0.0)
    np.testing.assert_array_equal(after.boxes[:, 0], after.boxes[:, 1])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "it begins with ''"),
        ("# map v1 0 0\n", "want '# sparse-map v1"),
        ("# sparse-map v2 0 0\n", "version 'v2'"),
        ("# sparse-map v1 -1 0\n", "two whole numbers"),
        ("# sparse-map v1 999999999 1\n1 2 3\n", "cannot hold them"),
        ("# sparse-map v1 2 0\n1.000000 2.000000 3.000000\n", "claims 2 codes"),
        ("# sparse-map v1 1 0\n1 2 3\n4 5 6\n", "there are 2 lines"),
        ("# sparse-map v1 1 0\n1.0 2.0\n", "line 2 is '1.0 2.0'"),
        ("# sparse-map v1 1 0\n1.0 2.0 x\n", "want three numbers"),
        ("# sparse-map v1 1 0\n1.0 2.0 nan\n", "within 1,000,000 m"),
    ],
)
def test_a_text_that_is_no_map_is_refused_by_its_name(tmp_path, text, message):
    path = tmp_path / "map.txt"
    path.write_text(text)
    with pytest.raises(ValueError, match=message) as caught:
        _read_text_map(path)
    assert str(path) in str(caught.value)


def test_binary_is_a_third_of_the_thesis_form():
    known = some_map(400)
    assert 3 * len(binary_content(known)) < len(text_content(known))


def test_names_say_the_form(tmp_path):
    known = some_map()
    with pytest.raises(
        ValueError, match=r"room\.txt is a text, .* and \d+ boxes of the map have a size; want .*\.smap"
    ):
        write_sparse_map(tmp_path / "room.txt", known)
    centres = np.repeat(known.centres[:, None], 2, axis=1)
    known = replace(known, occupied=occupied_codes(centres))
    for name in ("room.txt", "room.smap"):
        write_sparse_map(tmp_path / name, known)
        assert len(read_sparse_map(tmp_path / name)[0].occupied) == 60
    with pytest.raises(ValueError, match=r"want one that ends in \.smap or \.txt"):
        write_sparse_map(tmp_path / "room.map", known)
    with pytest.raises(ValueError, match="keeps no graph"):
        write_sparse_map(tmp_path / "g.txt", known, _GraphEdges(np.zeros((1, 3)), np.empty((0, 2), int)))
    assert sorted(os.listdir(tmp_path)) == ["room.smap", "room.txt"]
    with pytest.raises(FileNotFoundError, match="there is no file"):
        read_sparse_map(tmp_path / "none.smap")


def test_a_map_that_cannot_be_written_leaves_nothing(tmp_path):
    far = SparseMap(occupied=occupied_codes(np.full((1, 2, 3), 1e7)), ground=free_codes([]))
    for name in ("far.smap", "far.txt"):
        with pytest.raises(ValueError, match="1,000,000 m"):
            write_sparse_map(tmp_path / name, far)
    assert os.listdir(tmp_path) == []


def test_a_text_with_the_name_of_a_binary_file_is_refused(tmp_path):
    path = tmp_path / "map.smap"
    path.write_text(text_content(some_map()))
    with pytest.raises(ValueError, match="it begins with"):
        read_sparse_map(path)
