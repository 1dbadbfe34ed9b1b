"""Workers that are stopped are told, and end when the work does."""

import os
import signal
import subprocess
import sys
import threading
import time

import pytest

from lidarium.evaluation.suites import workers
from lidarium.evaluation.suites.processes import stopped_workers
from lidarium.evaluation.suites.workers import shared_out

pytestmark = pytest.mark.skipif(
    not sys.platform.startswith("linux"), reason="the system does not tell which processes are stopped"
)

STOPS = "__import__('os').kill(__import__('os').getpid(), __import__('signal').SIGSTOP) or 7"


def continue_the_stopped(is_over):
    """Continue workers some time after they were stopped."""
    while not is_over.wait(1.5):
        for number in stopped_workers():
            os.kill(number, signal.SIGCONT)


def test_a_stopped_worker_is_told_and_its_work_is_done_when_it_goes_on(monkeypatch):
    monkeypatch.setattr(workers, "CHECK_PERIOD_S", 0.2)
    is_over = threading.Event()
    helper = threading.Thread(target=continue_the_stopped, args=(is_over,))
    helper.start()
    with pytest.warns(UserWarning, match=r"worker process \d+ is stopped.*kill -CONT"):
        results = dict(shared_out(eval, [STOPS, "1 + 1", "1 + 2"], 2))
    is_over.set()
    helper.join()
    assert results == {STOPS: 7, "1 + 1": 2, "1 + 2": 3}


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
from lidarium.evaluation.suites.processes import stopped_workers
from lidarium.evaluation.suites.workers import shared_out
if __name__ == "__main__":
    pids = "__import__('os').getpid()"
    for _, number in shared_out(eval, [pids], 1, is_apart=True):
        os.kill(number, signal.SIGSTOP)
    print("over", flush=True)
"""


def test_a_worker_that_is_stopped_when_all_is_done_holds_nobody_up(tmp_path):
    (tmp_path / "idle.py").write_text(IDLE)
    told = subprocess.run(
        [sys.executable, str(tmp_path / "idle.py")], capture_output=True, text=True, timeout=120
    )
    assert (told.returncode, told.stdout, told.stderr) == (0, "over\n", "")
