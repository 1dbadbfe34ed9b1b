"""Kernels as lists name them."""

import json

import pytest
from numba.core import types

from lidarium.mapping.grids.scan_integration import SeenScan
from lidarium.mapping.kernels.first_start.listed_kernels import compile_kernel, decode_type, encode_type

ARRAY = types.Array(types.int8, 2, "C")
CASES = [
    (types.int64, "int64"),
    (types.boolean, "bool"),
    (ARRAY, "int8:2C"),
    (types.Array(types.boolean, 1, "A"), "bool:1A"),
    (types.Array(types.float32, 1, "C", readonly=True), "float32:1C:readonly"),
    (types.UniTuple(types.float64, 3), ["float64"] * 3),
    (types.Tuple([ARRAY, types.int64]), ["int8:2C", "int64"]),
]


@pytest.mark.parametrize(("kind", "text"), CASES)
def test_types_are_written_as_text_and_read_back(kind, text):
    assert encode_type(kind) == text
    assert decode_type(json.loads(json.dumps(text))) == kind


def test_named_tuples_come_back_with_their_class():
    words = types.Array(types.uint64, 2, "C")
    members = [words, words, types.UniTuple(types.int64, 4), ARRAY, ARRAY, types.int64, types.int64]
    kind = types.NamedTuple(members, SeenScan)
    text = encode_type(kind)
    assert text["class"] == "lidarium.mapping.grids.scan_integration:SeenScan"
    found = decode_type(text)
    assert found == kind
    assert found.instance_class is SeenScan


def test_a_type_that_cannot_be_written_is_named():
    with pytest.raises(ValueError, match=r"unicode_type.* cannot be written; want numbers or arrays"):
        encode_type(types.unicode_type)


def test_a_kernel_that_there_is_not_is_an_error():
    for name in ("lidarium.mapping.kernels.views:no_such_kernel", "lidarium.no_such_module:kernel"):
        with pytest.raises((AttributeError, ImportError)):
            compile_kernel({"name": name, "signature": []})
