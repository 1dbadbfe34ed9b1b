"""Tasks are shared out; a task that fails or whose process dies concerns nobody else."""

import ctypes
import os
import subprocess
import sys

import pytest

from lidarium.evaluation.suites.workers import shared_out

DIES = "__import__('os').kill(__import__('os').getpid(), 9)"


@pytest.mark.parametrize("workers", [1, 2])
def test_every_task_has_its_result_or_its_error(workers):
    results = dict(shared_out(eval, ["1 * 1", "2 * 2", "1 / 0", "4 * 4", "5 * 5"], workers))
    assert isinstance(results.pop("1 / 0"), ZeroDivisionError)
    assert results == {"1 * 1": 1, "2 * 2": 4, "4 * 4": 16, "5 * 5": 25}


def test_an_interrupt_out_of_compiled_code_is_no_result():
    def kernel(_task):
        raise SystemError("returned a result with an exception set") from KeyboardInterrupt()

    with pytest.raises(KeyboardInterrupt):
        list(shared_out(kernel, [1, 2], 1))


def test_a_process_that_dies_takes_no_other_task_with_it():
    tasks = [str(number) for number in range(12)]
    results = dict(shared_out(eval, [*tasks[:5], DIES, *tasks[5:]], 2))
    assert isinstance(results.pop(DIES), RuntimeError)
    assert results == {task: int(task) for task in tasks}


def test_who_stops_listening_ends_the_work():
    running = shared_out(eval, iter(str(number) for number in range(10**9)), 2)
    next(running)
    running.close()


def test_one_worker_can_be_a_process_of_its_own_with_one_thread():
    tasks = ["__import__('os').getpid()", "__import__('os').environ['OPENBLAS_NUM_THREADS']"]
    results = dict(shared_out(eval, tasks, 1, is_apart=True))
    assert results[tasks[0]] != os.getpid()
    assert int(results[tasks[1]]) >= 1


HOLES = """
from pathlib import Path
import numpy as np
from lidarium.evaluation.suites.workers import shared_out

kept = []

def leaves_holes(_task):
    held = int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 2**20
    large = []
    for _ in range(300):
        large.append(np.ones(512 * 1024, np.uint8))
        kept.append(np.ones(600, np.uint8))
    return held

held = [result for _, result in shared_out(leaves_holes, range(6), 1)]
print(max(held[1:]) - held[0])
"""


HAS_TRIM = sys.platform.startswith("linux") and hasattr(ctypes.CDLL(None), "malloc_trim")


@pytest.mark.skipif(not HAS_TRIM, reason="this system's C library cannot be told to give freed memory back")
def test_what_a_task_has_freed_is_given_back():
    """Each task fills 150 MB and frees them, but for small arrays in between, which keep the heap from
    shrinking by itself."""
    found = subprocess.run([sys.executable, "-c", HOLES], capture_output=True, text=True, check=True)
    assert float(found.stdout) < 60.0
