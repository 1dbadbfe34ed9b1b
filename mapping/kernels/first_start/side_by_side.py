"""Compiles listed kernels in several processes, each after those that it calls."""

import json
import os
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from queue import SimpleQueue

from lidarium.mapping.kernels.first_start.listed_kernels import Entry

SWITCH = "LIDARIUM_FIRST_START"
"""Environment variable: ``off`` lets each kernel be compiled where it is called."""


class _Plan:
    """Which of the listed kernels is compiled next; shared by the threads that wait for processes."""

    def __init__(self, entries: Sequence[Entry]) -> None:
        self._entries, self._left = entries, list(range(len(entries)))
        self._done: set[int] = set()
        self._changed = threading.Condition()
        self._is_stopped = False

    def take(self) -> int | None:
        """Return the first kernel whose callees are compiled, once there is one; None where all are taken."""
        with self._changed:
            while self._left and not self._is_stopped:
                for number in self._left:
                    if self._done.issuperset(self._entries[number]["needs"]):
                        self._left.remove(number)
                        return number
                self._changed.wait()
            return None

    def finish(self, number: int) -> None:
        """Note that a kernel was compiled, or could not be."""
        with self._changed:
            self._done.add(number)
            self._changed.notify_all()

    def stop(self) -> None:
        """Give out no more kernels."""
        with self._changed:
            self._is_stopped = True
            self._changed.notify_all()


def compiled_side_by_side(entries: Sequence[Entry], processes: int) -> Iterator[str]:
    """Compile kernels in processes of their own; yield each one's name as it is done.

    Parameters
    ----------
    entries : sequence of Entry
        Each has besides ``needs``: numbers of those that it calls. The longest come first.
    processes : int
        How many at once.
    """
    plan, names = _Plan(entries), SimpleQueue[str | None]()
    workers = [_worker() for _ in range(min(processes, len(entries)))]
    threads = [
        threading.Thread(target=_drive, args=(worker, plan, entries, names), daemon=True)
        for worker in workers
    ]
    for thread in threads:
        thread.start()
    try:
        ended = 0
        while ended < len(threads):
            name = names.get()
            if name is None:
                ended += 1
            else:
                yield name
    finally:
        plan.stop()
        for worker in workers:
            worker.kill()
            worker.wait()


def _worker() -> "subprocess.Popen[str]":
    return subprocess.Popen(
        [sys.executable, "-m", "lidarium.mapping.kernels.first_start.worker"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={**os.environ, SWITCH: "off"},
        text=True,
    )


def _drive(
    worker: "subprocess.Popen[str]", plan: _Plan, entries: Sequence[Entry], names: "SimpleQueue[str | None]"
) -> None:
    """Give a process one kernel after the other."""
    assert worker.stdin is not None
    assert worker.stdout is not None
    with worker.stdin, worker.stdout:
        while (number := plan.take()) is not None:
            try:
                worker.stdin.write(json.dumps(entries[number]) + "\n")
                worker.stdin.flush()
                is_answered = worker.stdout.readline() != ""
            except (OSError, ValueError):  # the process has ended
                is_answered = False
            plan.finish(number)
            if not is_answered:
                break
            names.put(entries[number]["name"])
    names.put(None)
