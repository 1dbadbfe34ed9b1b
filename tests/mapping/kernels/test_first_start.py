"""Kernels of lists are compiled by several processes, each after those that it calls."""

import fcntl
import io
import json
import os
import subprocess
import sys

import pytest
from numba.core import types

from lidarium.envs.engine.beginnings import KERNELS_OF_RESET
from lidarium.mapping.grids.scan_integration import SeenScan
from lidarium.mapping.kernels import first_start
from lidarium.mapping.kernels.first_start import (
    LOCK,
    SWITCH,
    _Plan,
    compile_in_processes,
    compile_kernel,
    decode_type,
    encode_type,
)
from lidarium.mapping.planning.search.search_state import _grown
from lidarium.scripts.common import KERNELS_OF_RUN

ARRAY = types.Array(types.int8, 2, "C")
CASES = [
    (types.int64, "int64"),
    (types.boolean, "bool"),
    (ARRAY, "int8:2C"),
    (types.Array(types.boolean, 1, "A"), "bool:1A"),
    (types.Array(types.float32, 1, "C", readonly=True), "float32:1C:readonly"),
    (types.UniTuple(types.float64, 3), ["float64"] * 3),
    (types.Tuple([ARRAY, types.int64]), ["int8:2C", "int64"]),
    (types.literal(True), {"literal": True}),
]
TAKE = {"name": "lidarium.mapping.kernels.work_queue:take_next", "signature": ["int64:1C"], "needs": []}
SCRIPT = f"""
import json, sys
from lidarium.mapping.kernels.first_start import compile_in_processes
module = "lidarium.mapping.planning.search.search_state:"
entries = [
    {{"name": module + "_grown", "signature": ["int32:2C", "int64"], "needs": [1]}},
    {TAKE},
    {{"name": module + "no_such_kernel", "signature": [], "needs": [0]}},
]
print(json.dumps(list(compile_in_processes(entries, int(sys.argv[1])))))
"""


@pytest.mark.parametrize(("argument", "text"), CASES)
def test_types_are_written_as_text_and_read_back(argument, text):
    assert encode_type(argument) == text
    assert decode_type(json.loads(json.dumps(text))) == argument


def test_named_tuples_come_back_with_their_class():
    words = types.Array(types.uint64, 2, "C")
    members = [words, words, types.UniTuple(types.int64, 4), ARRAY, ARRAY, types.int64, types.int64]
    argument = types.NamedTuple(members, SeenScan)
    text = encode_type(argument)
    assert text["class"] == "lidarium.mapping.grids.scan_integration:SeenScan"
    found = decode_type(text)
    assert found == argument
    assert found.instance_class is SeenScan


def test_a_type_that_cannot_be_written_is_named():
    with pytest.raises(ValueError, match=r"unicode_type.* cannot be written; want numbers or arrays"):
        encode_type(types.unicode_type)


def test_a_missing_kernel_is_an_error():
    for name in ("lidarium.mapping.kernels.views:no_such_kernel", "lidarium.no_such_module:kernel"):
        with pytest.raises((AttributeError, ImportError)):
            compile_kernel({"name": name, "signature": []})


def test_a_kernel_waits_for_those_that_it_calls():
    entries = [
        {"name": "whole", "needs": [1, 2]},
        {"name": "part", "needs": [2]},
        {"name": "leaf", "needs": []},
    ]
    plan, taken = _Plan(entries), []
    while (number := plan.take()) is not None:
        taken.append(entries[number]["name"])
        plan.finish(number)
    assert taken == ["leaf", "part", "whole"]


def test_a_plan_that_is_stopped_gives_out_nothing():
    plan = _Plan([{"name": "leaf", "needs": []}])
    plan.stop()
    assert plan.take() is None


def test_processes_fill_the_cache_and_skip_kernels_that_cannot_be_compiled(tmp_path):
    for processes in ("1", "2"):
        folder = tmp_path / processes
        folder.mkdir()
        output = subprocess.run(
            [sys.executable, "-c", SCRIPT, processes],
            env={**os.environ, "NUMBA_CACHE_DIR": str(folder)},
            check=True,
            capture_output=True,
            text=True,
        )
        names = [name.partition(":")[2] for name in json.loads(output.stdout)]
        assert sorted(names) == ["_grown", "no_such_kernel", "take_next"]
        assert names.index("take_next") < names.index("_grown")
        assert any("_grown" in path.name for path in folder.rglob("*.nbc"))
        assert any("take_next" in path.name for path in folder.rglob("*.nbc"))


def test_a_caller_that_goes_away_ends_the_processes():
    names = compile_in_processes([TAKE, {**TAKE, "name": "lidarium.mapping.kernels.views:none"}], 1)
    assert next(names).endswith("take_next")
    names.close()


def test_a_process_that_has_ended_leaves_the_kernels_to_their_first_calls(monkeypatch):
    def ended():
        worker = subprocess.Popen([sys.executable, "-c", ""], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        worker.wait()
        return worker

    monkeypatch.setattr(first_start, "_start_worker", ended)
    assert list(compile_in_processes([TAKE], 1)) == []


def test_each_kernel_is_answered_and_one_that_fails_is_left_out(monkeypatch, capsys):
    asked = []

    def compiled(entry):
        asked.append(entry["name"])
        if entry["name"] == "a:bad":
            raise AttributeError("there is none")

    monkeypatch.setattr(first_start, "compile_kernel", compiled)
    entries = [json.dumps({"name": name, "signature": []}) for name in ("a:good", "a:bad", "b:good")]
    monkeypatch.setattr("sys.stdin", io.StringIO("\n".join([*entries[:2], "no json", entries[2]]) + "\n"))
    first_start.main()
    assert asked == ["a:good", "a:bad", "b:good"]
    assert capsys.readouterr().out.splitlines() == [
        "compiled",
        "left out: AttributeError",
        "left out: JSONDecodeError",
        "compiled",
    ]


def test_a_kernel_is_compiled_for_what_it_is_called_with():
    compile_kernel({"name": f"{_grown.__module__}:_grown", "signature": ["int32:2C", "int64"]})
    assert (types.Array(types.int32, 2, "C"), types.int64) in _grown.signatures


@pytest.mark.parametrize("path", [KERNELS_OF_RUN, KERNELS_OF_RESET], ids=["run", "reset"])
def test_every_listed_kernel_can_be_compiled_for_its_types_after_what_it_calls(path):
    entries = json.loads(path.read_text())
    assert len(entries) > 20
    for number, entry in enumerate(entries):
        module, name = entry["name"].split(":")
        kernel = getattr(__import__(module, fromlist=[name]), name)
        arguments = [decode_type(each) for each in entry["signature"]]
        assert len(arguments) == kernel.py_func.__code__.co_argcount, entry["name"]
        assert number not in entry["needs"]
        assert all(set(entries[other]["needs"]) <= set(entry["needs"]) for other in entry["needs"])


START = """
import sys
from pathlib import Path
from lidarium.mapping.kernels import first_start
first_start._cores = lambda: 2
first_start.compile_listed(Path(sys.argv[1]), "the first start")
"""


@pytest.fixture
def start(tmp_path):
    """Run a first start in a new process; return its messages."""
    (tmp_path / "list.json").write_text(json.dumps([TAKE]))

    def run(**environment):
        return subprocess.run(
            [sys.executable, "-c", START, str(tmp_path / "list.json")],
            env={**os.environ, SWITCH: "", "NUMBA_CACHE_DIR": str(tmp_path / "caches"), **environment},
            check=True,
            capture_output=True,
            text=True,
        ).stderr

    return run


def test_an_empty_cache_is_filled_once_and_the_wait_explained(start, tmp_path):
    assert start() == "lidarium: the first start compiles kernels in 2 processes; later ones find them\n"
    assert any("take_next" in path.name for path in (tmp_path / "caches").rglob("*.nbc"))
    assert start() == ""


def test_who_wants_no_processes_gets_none_and_two_starts_share_them(start, tmp_path):
    (tmp_path / "caches").mkdir()
    assert start(**{SWITCH: "off"}) == ""
    with (tmp_path / "caches" / LOCK).open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        assert start() == "", "another process compiles already"
    assert not any((tmp_path / "caches").rglob("*.nbc"))
    assert start() != ""
