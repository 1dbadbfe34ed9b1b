"""The kernels of a first reset."""

import json
import os
import subprocess
import sys

import pytest

from lidarium.envs.engine import first_reset
from lidarium.envs.engine.first_reset import LIST
from lidarium.mapping.kernels.first_start import SWITCH, decode_type

SCRIPT = """
import json, sys
from lidarium.envs.engine import first_reset
first_reset._cores = lambda: 2
first_reset.LIST = first_reset.Path(sys.argv[1])
first_reset.compile_first_reset()
first_reset.compile_first_reset()
"""
BIT = {"name": "lidarium.mapping.kernels.work_queue:take_next", "signature": ["int64:1C"], "needs": []}


def test_every_listed_kernel_can_be_compiled_for_its_types_after_what_it_calls():
    entries = json.loads(LIST.read_text())
    for number, entry in enumerate(entries):
        module, name = entry["name"].split(":")
        kernel = getattr(__import__(module, fromlist=[name]), name)
        arguments = [decode_type(each) for each in entry["signature"]]
        assert len(arguments) == kernel.py_func.__code__.co_argcount, entry["name"]
        assert number not in entry["needs"]
        assert all(set(entries[other]["needs"]) <= set(entry["needs"]) for other in entry["needs"])


@pytest.fixture
def start(tmp_path):
    """Run a first start in a process of its own; return what it says."""
    (tmp_path / "list.json").write_text(json.dumps([BIT]))
    (tmp_path / "caches").mkdir()

    def run(**environment):
        return subprocess.run(
            [sys.executable, "-c", SCRIPT, str(tmp_path / "list.json")],
            env={**os.environ, SWITCH: "", "NUMBA_CACHE_DIR": str(tmp_path / "caches"), **environment},
            check=True,
            capture_output=True,
            text=True,
        ).stderr

    return run


def test_an_empty_cache_is_filled_once_and_the_wait_explained(start, tmp_path):
    assert start().count("the first reset compiles kernels in 2 processes") == 1
    assert any("take_next" in path.name for path in (tmp_path / "caches").rglob("*.nbc"))
    assert not (tmp_path / "caches" / first_reset.LOCK).exists()
    assert start() == ""


def test_who_wants_no_processes_gets_none(start, tmp_path):
    assert start(**{SWITCH: "off"}) == ""
    (tmp_path / "caches" / first_reset.LOCK).touch()
    assert start() == "", "another process compiles already"
    assert not any((tmp_path / "caches").rglob("*.nbc"))
