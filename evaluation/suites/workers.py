"""Work distributed to processes, with results as they are ready.

The death of a worker affects only its own task.
"""

import ctypes
import multiprocessing
import os
import signal
import threading
import time
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from itertools import islice
from typing import TypeVar

from lidarium.evaluation.episodes.interrupts import PatientInterrupt, is_wrapped_interrupt
from lidarium.evaluation.suites.processes import end_workers, interrupts_held, stopped_workers

Task = TypeVar("Task")
Result = TypeVar("Result")

_TRIM = getattr(ctypes.CDLL(None), "malloc_trim", None) if os.name == "posix" else None
"""Gives freed memory back to the system, where the C library has that."""

WAITING_PER_WORKER = 2
"""Tasks that are handed over before a worker is free, so that it never waits."""

POLL_S = 0.2
"""Wall time after which an interrupt is acted on at the latest [s]."""

GRACE_S = 3.0
"""Wall time in which further interrupts are the same wish as the first [s]."""

CHECK_PERIOD_S = 10.0
"""Wall time between two checks whether a worker is stopped [s]."""


class WorkerDiedError(RuntimeError):
    """Raised, as a task's result, where its process died whenever it was tried."""


def shared_out(
    work: Callable[[Task], Result], tasks: Iterable[Task], workers: int, *, is_apart: bool = False
) -> Generator[tuple[Task, Result | Exception], None, None]:
    """Do tasks in this process or in several; yield each with its result when ready.

    One worker means this process, more mean processes of their own.

    Parameters
    ----------
    work : callable
        Does a task; a function of a module, as processes import it.
    tasks : iterable
        Tasks and results go between processes, so they can be pickled.
    workers : int
        How many processes.
    is_apart : bool
        Whether one worker, too, is a process of its own, in which libraries keep to one thread: for what is
        timed.

    Yields
    ------
    task, result
        An exception that the task has raised is its result. A task whose process died has a
        ``WorkerDiedError``; those that were under way beside it are done again.

    Warns
    -----
    UserWarning
        Where a worker is stopped from outside: its task waits until it is continued.
    """
    if workers <= 1 and not is_apart:
        for task in tasks:
            yield task, _attempted(work, task)
        return
    pending = iter(tasks)
    suspects: list[Task] = []
    while True:
        lost = yield from _in_pool(work, pending, max(workers, 1))
        for suspect in lost:
            # Who brought the others down does it again, alone.
            suspects = yield from _in_pool(work, iter([suspect]), 1)
            if suspects:
                reason = "its process died, twice: out of memory, or killed from outside"
                yield suspect, WorkerDiedError(reason)
        if not lost:
            return


def _in_pool(
    work: Callable[[Task], Result], tasks: Iterator[Task], workers: int
) -> Generator[tuple[Task, Result | Exception], None, list[Task]]:
    """Do tasks in a pool of processes.

    Returns those that were lost because a process died.
    """
    context = multiprocessing.get_context("spawn")
    lost: list[Task] = []
    running: dict[Future[Result], Task] = {}
    # Linear algebra reads its number of threads when it is loaded.
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    # Raised where it comes, an interrupt may fall into a callback of the pool, and be lost there.
    with PatientInterrupt(GRACE_S) as interrupt:
        pool = ProcessPoolExecutor(workers, mp_context=context, initializer=_begin_worker)
        is_whole, watch = False, _Watch()
        try:
            for task in islice(tasks, WAITING_PER_WORKER * workers):
                with interrupts_held():
                    running[pool.submit(_done, work, task)] = task
            while running:
                ready = wait(running, POLL_S, FIRST_COMPLETED).done
                if interrupt.is_asked:
                    raise KeyboardInterrupt
                watch.check()
                for future in ready:
                    task = running.pop(future)
                    error = future.exception()
                    if isinstance(error, BrokenProcessPool):
                        lost.append(task)
                        continue
                    if error is not None and not isinstance(error, Exception):
                        raise error
                    yield task, future.result() if error is None else error
                    if lost:
                        continue
                    for following in islice(tasks, 1):
                        try:
                            with interrupts_held():
                                running[pool.submit(_done, work, following)] = following
                        except BrokenProcessPool:
                            lost.append(following)
            is_whole = True
        finally:
            # Not waited for without end: a worker that is stopped would never leave.
            pool.shutdown(wait=False, cancel_futures=True)
            end_workers(are_ending=is_whole)
    return lost


class _Watch:
    """Warns of workers that are stopped, once of each."""

    def __init__(self) -> None:
        self._named: set[int] = set()
        self._checked_at = time.monotonic()

    def check(self) -> None:
        """Check whether a worker is stopped, if the last check was long ago."""
        if time.monotonic() - self._checked_at < CHECK_PERIOD_S:
            return
        self._checked_at = time.monotonic()
        for number in stopped_workers():
            if number not in self._named:
                self._named.add(number)
                warnings.warn(
                    f"worker process {number} is stopped, and its work waits; continue it with `kill -CONT "
                    f"{number}`, or end this command with Ctrl-C",
                    stacklevel=2,
                )


def _attempted(work: Callable[[Task], Result], task: Task) -> Result | Exception:
    try:
        return _done(work, task)
    except Exception as error:  # whatever it is, it is the task's result
        if is_wrapped_interrupt(error):
            raise KeyboardInterrupt from error
        return error


def _done(work: Callable[[Task], Result], task: Task) -> Result:
    """Do a task and give the memory that it has freed back to the system.

    Between maps of all sizes, the C library's heap only grows.
    """
    try:
        return work(task)
    finally:
        if _TRIM is not None:
            _TRIM(0)


def _begin_worker() -> None:
    """Leave interrupts to the parent, and keep libraries to one thread.

    There are as many processes as cores.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    import cv2

    cv2.setNumThreads(1)
    threading.Thread(target=_leave_with_parent, daemon=True).start()


def _leave_with_parent() -> None:
    """End this process when its parent is gone.

    The parent may have been killed, which leaves nobody to take the results.
    """
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
