"""The kernels that a first start compiles in several processes."""

import json
import os
import subprocess
import sys
from collections import namedtuple

import pytest
from numba import types

from lidarium.mapping.kernels.first_start import compile_kernel, decode_type, encode_type
from lidarium.mapping.planning.search.search_state import _grown
from lidarium.scripts import first_start
from lidarium.scripts.first_start import LIST

Pair = namedtuple("Pair", "cells size")


@pytest.mark.parametrize(
    "kind",
    [
        types.int64,
        types.boolean,
        types.Array(types.float32, 2, "C"),
        types.Array(types.bool_, 1, "A", readonly=True),
        types.UniTuple(types.float64, 3),
        types.NamedTuple([types.Array(types.uint8, 2, "C"), types.int64], Pair),
    ],
)
def test_types_are_read_as_they_were_written(kind):
    assert decode_type(json.loads(json.dumps(encode_type(kind)))) == kind


def test_a_type_that_cannot_be_written_is_named():
    with pytest.raises(ValueError, match="unicode_type"):
        encode_type(types.unicode_type)


def test_every_listed_kernel_can_be_compiled_for_its_types():
    for entry in json.loads(LIST.read_text())["kernels"]:
        module, name = entry["name"].split(":")
        kernel = getattr(__import__(module, fromlist=[name]), name)
        arguments = [decode_type(each) for each in entry["signature"]]
        assert len(arguments) == kernel.py_func.__code__.co_argcount, entry["name"]


def test_a_kernel_is_compiled_for_what_it_is_called_with():
    entry = {"name": f"{_grown.__module__}:_grown", "signature": ["int32:2C", "int64"]}
    compile_kernel(entry)
    assert (types.Array(types.int32, 2, "C"), types.int64) in _grown.signatures


FIRST_START = """
import json, sys
from lidarium.scripts import first_start
if __name__ == "__main__":
    listed = json.loads(first_start.LIST.read_text())
    ends = (":window_words", ":within_quarter")
    small = [each for each in listed["kernels"] if each["name"].endswith(ends)]
    assert len(small) == 2
    first_start.LIST = first_start.Path(sys.argv[1])
    first_start.LIST.write_text(json.dumps({"compiled": 3, "kernels": small}))
    first_start.os.sched_getaffinity = lambda pid: {0, 1}
    first_start.compile_first(is_quiet=True)
"""


def test_an_empty_cache_is_filled_by_processes_and_a_full_one_left(tmp_path):
    script = tmp_path / "start.py"
    script.write_text(FIRST_START)
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "caches")}
    (tmp_path / "caches").mkdir()
    for expected in ("compiles kernels in 2 processes", "compiles"):
        process = subprocess.run(
            [sys.executable, str(script), str(tmp_path / "list.json")],
            env=environment,
            check=True,
            capture_output=True,
            text=True,
        )
        assert (expected in process.stderr) == (expected != "compiles")
        compiled = first_start.count_compiled(tmp_path / "caches")
        assert compiled >= 2


def test_a_kernel_that_is_gone_is_left_to_its_first_call(tmp_path):
    gone = [{"name": "lidarium.mapping.grids.grid_lines:no_such_kernel", "signature": []}]
    assert list(first_start._compiled(tmp_path, gone, 1)) == []
