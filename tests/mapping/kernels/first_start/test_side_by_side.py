"""Kernels are compiled by several processes, each after those that it calls."""

import json
import os
import subprocess
import sys

from lidarium.mapping.kernels.first_start.side_by_side import _Plan, compiled_side_by_side

SCRIPT = """
import json, sys
from lidarium.mapping.kernels.first_start.side_by_side import compiled_side_by_side
place = "lidarium.mapping.planning.search.search_targets:"
entries = [
    {"name": place + "_grown", "signature": ["int32:2C", "int64"], "needs": [1]},
    {"name": "lidarium.mapping.kernels.bit_words:first_bit", "signature": ["uint64"], "needs": []},
    {"name": place + "no_such_kernel", "signature": [], "needs": [0]},
]
print(json.dumps(list(compiled_side_by_side(entries, int(sys.argv[1])))))
"""


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


def test_processes_fill_the_cache_and_leave_out_what_cannot_be_compiled(tmp_path):
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
        assert sorted(names) == ["_grown", "first_bit", "no_such_kernel"]
        assert names.index("first_bit") < names.index("_grown")
        assert any("_grown" in path.name for path in folder.rglob("*.nbc"))
        assert any("first_bit" in path.name for path in folder.rglob("*.nbc"))


def test_a_caller_that_goes_away_ends_the_processes():
    entries = [
        {"name": "lidarium.mapping.kernels.bit_words:first_bit", "signature": ["uint64"], "needs": []},
        {"name": "lidarium.mapping.kernels.bit_words:last_bit", "signature": ["uint64"], "needs": []},
    ]
    names = compiled_side_by_side(entries, 1)
    assert next(names).endswith("first_bit")
    names.close()
