"""Processes and signals: interrupts, workers, and how they end."""

import ctypes
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from lidarium.evaluation import processes
from lidarium.evaluation.processes import (
    PatientInterrupt,
    Termination,
    is_end_asked,
    shared_out,
    stopped_workers,
)

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals are sent as on Unix")


def test_a_patient_interrupt_notes_a_first_termination_and_raises_at_the_second():
    termination = Termination()
    before = signal.signal(signal.SIGTERM, termination)
    try:
        with PatientInterrupt() as interrupt:
            assert not interrupt.is_asked
            signal.raise_signal(signal.SIGTERM)
            assert interrupt.is_asked
            assert termination.is_asked
            with pytest.raises(KeyboardInterrupt):
                signal.raise_signal(signal.SIGTERM)
        assert signal.getsignal(signal.SIGTERM) is termination
    finally:
        signal.signal(signal.SIGTERM, before)


@pytest.fixture
def ctrl_c():
    """Python's own handler, whatever the process began with."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("ctrl_c")
def test_all_who_wait_within_learn_of_the_end_until_the_context_is_left():
    assert not is_end_asked()
    with PatientInterrupt():
        assert not is_end_asked()
        signal.raise_signal(signal.SIGINT)
        with PatientInterrupt():
            assert is_end_asked()
    assert not is_end_asked()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.usefixtures("ctrl_c")
def test_signals_within_the_grace_are_one_wish():
    with PatientInterrupt(grace_s=600.0) as interrupt:
        for _ in range(3):
            signal.raise_signal(signal.SIGINT)
        assert interrupt.is_asked


def test_a_handler_of_an_application_is_left_alone():
    heard = []
    before = signal.signal(signal.SIGINT, lambda number, frame: heard.append(number))
    try:
        with PatientInterrupt() as interrupt:
            signal.raise_signal(signal.SIGINT)
            assert not interrupt.is_asked
    finally:
        signal.signal(signal.SIGINT, before)
    assert heard == [signal.SIGINT]


linux_only = pytest.mark.skipif(
    not sys.platform.startswith("linux"), reason="the system does not tell which processes are stopped"
)

STOPS = "__import__('os').kill(__import__('os').getpid(), __import__('signal').SIGSTOP) or 7"


def continue_the_stopped(is_over):
    """Continue workers some time after they were stopped."""
    before = set()
    while not is_over.wait(1.5):
        stopped = set(stopped_workers())
        for number in stopped & before:
            os.kill(number, signal.SIGCONT)
        before = stopped


@linux_only
def test_a_stopped_worker_is_told_and_its_work_is_done_when_it_goes_on(monkeypatch):
    monkeypatch.setattr(processes, "CHECK_PERIOD_S", 0.2)
    is_over = threading.Event()
    helper = threading.Thread(target=continue_the_stopped, args=(is_over,))
    helper.start()
    with pytest.warns(UserWarning, match=r"worker process \d+ is stopped.*kill -CONT"):
        results = dict(shared_out(eval, [STOPS, "1 + 1", "1 + 2"], 2))
    is_over.set()
    helper.join()
    assert results == {STOPS: 7, "1 + 1": 2, "1 + 2": 3}


@linux_only
def test_who_stops_listening_is_not_held_up_by_a_stopped_worker():
    running = shared_out(eval, ["1 + 1", STOPS, STOPS], 2)
    next(running)
    began = time.monotonic()
    while not stopped_workers() and time.monotonic() < began + 60.0:
        time.sleep(0.05)
    (number, *_) = stopped_workers()
    running.close()
    with pytest.raises(ProcessLookupError):
        os.kill(number, 0)


IDLE = """
import os, signal
from lidarium.evaluation.processes import stopped_workers
from lidarium.evaluation import processes
from lidarium.evaluation.processes import shared_out
if __name__ == "__main__":
    pids = "__import__('os').getpid()"
    for _, number in shared_out(eval, [pids], 1, is_apart=True):
        os.kill(number, signal.SIGSTOP)
    print("over", flush=True)
"""


@linux_only
def test_a_worker_that_is_stopped_when_all_is_done_holds_nobody_up(tmp_path):
    (tmp_path / "idle.py").write_text(IDLE)
    told = subprocess.run([sys.executable, str(tmp_path / "idle.py")], capture_output=True, text=True, timeout=120)
    assert (told.returncode, told.stdout, told.stderr) == (0, "over\n", "")


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


class Interrupting:
    """Is interrupted while it is finalized, where Python loses exceptions."""

    def __del__(self):
        signal.raise_signal(signal.SIGINT)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_an_interrupt_that_is_lost_in_a_finalizer_ends_the_work():
    done = []

    def work(task):
        done.append(task)
        if task == 1:
            Interrupting()

    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # other tests may have left theirs
    try:
        with pytest.raises(KeyboardInterrupt):
            list(shared_out(work, range(5), workers=1))
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)
    assert done == [0, 1]


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
from lidarium.evaluation.processes import shared_out

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


BLOCKED = """
import ctypes, os, pathlib, sys
from lidarium.evaluation.processes import shared_out

def blocks(task):
    pathlib.Path(sys.argv[1], f"{task}.tmp").write_text(str(os.getpid()))
    os.replace(f"{sys.argv[1]}/{task}.tmp", f"{sys.argv[1]}/{task}.pid")
    ctypes.PyDLL(None).sleep(3600)  # holds the interpreter: no thread of Python runs meanwhile

if __name__ == "__main__":
    list(shared_out(blocks, [1, 2], 2))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="the kernel tells of a parent's end on Linux")
def test_workers_end_with_a_parent_that_is_killed_though_they_hold_the_interpreter(tmp_path):
    script = tmp_path / "blocked.py"
    script.write_text(BLOCKED)
    parent = subprocess.Popen([sys.executable, str(script), str(tmp_path)])
    files = [tmp_path / "1.pid", tmp_path / "2.pid"]
    waited(lambda: all(file.exists() for file in files) or parent.poll() is not None)
    numbers = [int(file.read_text()) for file in files]
    parent.kill()
    parent.wait()
    waited(lambda: not any(is_running(number) for number in numbers))


def test_a_program_that_starts_workers_as_it_is_loaded_is_told_how_to_guard_it(tmp_path):
    script = tmp_path / "unguarded.py"
    script.write_text("from lidarium.evaluation.processes import shared_out\nprint(list(shared_out(abs, [1, 2], 2)))\n")
    told = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, check=False)
    assert told.returncode == 1
    assert told.stdout == ""
    assert told.stderr.count("Traceback") == 1  # none of a worker
    assert 'put its calls below `if __name__ == "__main__":`, or use one worker' in told.stderr.splitlines()[-1]


def waited(condition):
    """Wait for a condition as long as a busy machine may take."""
    ends = time.monotonic() + 120.0
    while not condition():
        assert time.monotonic() < ends
        time.sleep(0.05)


def is_running(number):
    try:
        return Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False
