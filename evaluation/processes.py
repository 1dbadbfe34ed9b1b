"""Processes and signals: interrupts that wait for the end of a step, workers, and how all of them end.

After a first Ctrl-C or SIGTERM, the step under way is finished and kept; a second one ends it at once. The
death of a worker process affects only its own task.
"""

import ctypes
import multiprocessing
import os
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from itertools import islice
from pathlib import Path
from types import FrameType, TracebackType
from typing import Any, TypeVar

from lidarium.mapping.kernels.interrupts import is_wrapped_interrupt
from lidarium.registry import import_own


class Termination:
    """Handler of a signal that acts as Ctrl-C does, and remembers that the signal came.

    Attributes
    ----------
    is_asked : bool
        Whether the signal came.
    """

    def __init__(self) -> None:
        self.is_asked = False

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Raise ``KeyboardInterrupt``."""
        self.is_asked = True
        raise KeyboardInterrupt


_entered: list["PatientInterrupt"] = []


def is_end_asked() -> bool:
    """Whether an entered ``PatientInterrupt`` has received a signal; callers within it should then not wait."""
    return any(interrupt.is_asked for interrupt in _entered)


class PatientInterrupt:
    """Context in which a first SIGINT is only noted, to be acted on between two steps.

    The same holds for a first SIGTERM if a ``Termination`` handles it. A second signal raises at once.

    An exception that is thrown into the middle of anything leaves it in the middle: a world half stepped, or
    Numba with a loader that has died for good, after which no kernel can be called. Work with results that are kept
    after an interrupt is therefore interrupted only between whole steps. Outside the main thread, or if an
    application handles a signal in its own way, nothing changes.
    """

    def __init__(self, grace_s: float = 0.0) -> None:
        self._is_asked, self._grace_s, self._asked_at = False, grace_s, 0.0
        self._before: dict[int, Any] = {}

    def __enter__(self) -> "PatientInterrupt":
        _entered.append(self)
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGINT, signal.SIGTERM):
                before = signal.getsignal(number)
                if before is signal.default_int_handler or isinstance(before, Termination):
                    self._before[number] = before
                    signal.signal(number, self._noting(before))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        _entered.remove(self)
        while self._before:
            signal.signal(*self._before.popitem())

    def _noting(self, before: Any) -> Callable[[int, FrameType | None], None]:  # noqa: ANN401
        def note(number: int, frame: FrameType | None) -> None:
            now = time.monotonic()
            if self._is_asked and now - self._asked_at >= self._grace_s:
                before(number, frame)
            if not self._is_asked:
                self._is_asked, self._asked_at = True, now
            if isinstance(before, Termination):
                before.is_asked = True

        return note

    @property
    def is_asked(self) -> bool:
        """Whether the user has asked for an end."""
        return self._is_asked


@contextmanager
def heard_termination() -> Iterator[Any]:
    """Let SIGTERM end the run as Ctrl-C does.

    Nothing changes outside the main thread, or if an application handles the signal in its own way.
    """
    termination = Termination()
    is_ours = (
        threading.current_thread() is threading.main_thread() and signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    )
    if is_ours:
        signal.signal(signal.SIGTERM, termination)
    try:
        yield termination
    finally:
        if is_ours and signal.getsignal(signal.SIGTERM) is termination:
            signal.signal(signal.SIGTERM, signal.SIG_DFL)


def leave_at_the_next(code: int) -> None:
    """Let the next Ctrl-C or SIGTERM end this process at once.

    Results are kept by now. Python would print a traceback.
    """
    if threading.current_thread() is not threading.main_thread():
        return

    def leave(number: int, frame: FrameType | None) -> None:
        with suppress(BaseException):  # any operation that the signal interrupted
            _kill_workers()
        os._exit(code)

    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, leave)


CLEANUP_IS_UNSAFE = threading.Event()
"""Set if Python would crash on its way out of this process, which then leaves without cleaning up."""

END_GRACE_S = 2.0
"""Wall time in which a process that was asked to end may do so [s]."""

_STOPPED = frozenset("Tt")
"""States of processes that run no more until they are continued, as the system names them."""


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Hold Ctrl-C and SIGTERM back while processes are begun: half-begun ones would complain.

    Ctrl-C is blocked, which they take over, and so hear nothing of it until they leave it to their parent.
    """
    if threading.current_thread() is not threading.main_thread() or not hasattr(signal, "pthread_sigmask"):
        yield
        return
    came: list[int] = []
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    for number, handler in handlers.items():
        if callable(handler):
            signal.signal(number, lambda number, _frame: came.append(number))
    try:
        yield
    finally:
        for number, handler in handlers.items():
            if callable(handler):
                signal.signal(number, handler)
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
        for each in came:
            signal.raise_signal(each)


def end_workers(grace_s: float = END_GRACE_S, *, are_ending: bool = False) -> None:
    """End all processes that this one has begun, and wait until they are gone.

    A stopped process does not receive the signal to end; it is killed.
    """
    processes = multiprocessing.active_children()
    if not are_ending:
        for process in processes:
            process.terminate()
    ends = time.monotonic() + grace_s
    for process in processes:
        process.join(max(ends - time.monotonic(), 0.0))
        if process.is_alive():
            with suppress(OSError):  # it has gone meanwhile
                process.kill()
            process.join()


def _end_pool(pool: ProcessPoolExecutor, *, are_ending: bool = False) -> None:
    """End a pool and its processes.

    Its thread is waited for: Python, on its way out, would write to a pipe that this thread closes just then.
    """
    inner: Any = pool
    thread: threading.Thread | None = inner._executor_manager_thread  # no public name
    # Not waited for without end: a worker that is stopped would never leave.
    pool.shutdown(wait=False, cancel_futures=True)
    end_workers(are_ending=are_ending)
    if thread is not None:
        thread.join(END_GRACE_S)


def _kill_workers() -> None:
    """End all child processes of this one at once."""
    for process in multiprocessing.active_children():
        with suppress(OSError):
            process.kill()


def stopped_workers() -> list[int]:
    """Return the numbers of workers that are stopped (SIGSTOP, Ctrl-Z).

    None if the system does not provide it.
    """
    numbers = [process.pid for process in multiprocessing.active_children() if process.pid is not None]
    return [number for number in numbers if _state(number) in _STOPPED]


def _state(number: int) -> str:
    try:
        status = Path(f"/proc/{number}/stat").read_text(encoding="utf-8", errors="replace")
    except OSError:  # it is gone, or the system has no such files
        return ""
    # The state is behind the program's name, which is in brackets and may hold any character.
    return status.rpartition(")")[2].strip()[:1]


Task = TypeVar("Task")
Result = TypeVar("Result")

_PR_SET_PDEATHSIG = 1
"""Request of prctl(2): the signal that a process gets when its parent ends."""

_TRIM = getattr(ctypes.CDLL(None), "malloc_trim", None) if os.name == "posix" else None
"""Gives freed memory back to the system, if the C library has that."""

WAITING_PER_WORKER = 2
"""Tasks that are handed over before a worker is free, so that it never waits."""

POLL_S = 0.2
"""Wall time after which an interrupt is acted on at the latest [s]."""

GRACE_S = 3.0
"""Wall time in which further interrupts are the same wish as the first [s]."""

CHECK_PERIOD_S = 10.0
"""Wall time between two checks whether a worker is stopped [s]."""


UNGUARDED = 86
"""Exit status of a worker whose program would start workers while it is loaded."""


class WorkerDiedError(RuntimeError):
    """Raised, as a task's result, if its process died whenever it was tried."""


def shared_out(
    work: Callable[[Task], Result], tasks: Iterable[Task], workers: int, *, is_apart: bool = False
) -> Generator[tuple[Task, Result | Exception], None, None]:
    """Do tasks in this process or in several; yield each with its result when ready.

    One worker means this process, more mean processes of their own. Raises RuntimeError if the program starts
    workers as it is loaded: each of them loads it, too.
    """
    if workers <= 1 and not is_apart:
        with _remembered_interrupts() as handlers:
            for task in tasks:
                yield task, _attempted(work, task)
                if any(handler.is_asked for handler in handlers):
                    raise KeyboardInterrupt
        return
    pending = iter(tasks)
    suspects: list[Task] = []
    while True:
        lost = yield from _in_pool(work, pending, max(workers, 1))
        for suspect in lost:
            # The task that broke the other workers runs again, alone.
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
    if getattr(multiprocessing.current_process(), "_inheriting", False):  # as multiprocessing asks itself
        sys.exit(UNGUARDED)
    context = multiprocessing.get_context("spawn")
    lost: list[Task] = []
    running: dict[Future[Result], Task] = {}
    # Linear algebra reads its number of threads when it is loaded.
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    # Raised at once, an interrupt could fall into a callback of the pool, and be lost there.
    with PatientInterrupt(GRACE_S) as interrupt:
        pool = ProcessPoolExecutor(workers, mp_context=context, initializer=_begin_worker)
        inner: Any = pool
        is_whole, watch = False, _Watch()

        def hand_over(maximum: int) -> None:
            for task in islice(tasks, maximum):
                try:
                    with _interrupts_held():
                        running[pool.submit(_done, work, task)] = task
                except BrokenProcessPool:
                    lost.append(task)
                    return

        try:
            hand_over(WAITING_PER_WORKER * workers)
            while running:
                ready = wait(running, POLL_S, FIRST_COMPLETED).done
                if interrupt.is_asked:
                    raise KeyboardInterrupt
                watch.check()
                for future in ready:
                    task = running.pop(future)
                    error = future.exception()
                    if isinstance(error, BrokenProcessPool):
                        # The pool is broken as soon as a process closes its end, before its exit status is there.
                        inner._executor_manager_thread.join(END_GRACE_S)
                        if UNGUARDED in (process.exitcode for process in inner._processes.values()):
                            raise RuntimeError(
                                "workers load the program that starts them, and would start workers of their own; "
                                'put its calls below `if __name__ == "__main__":`, or use one worker'
                            )
                        lost.append(task)
                        continue
                    if error is not None and not isinstance(error, Exception):
                        raise error
                    yield task, future.result() if error is None else error
                    if not lost:
                        hand_over(1)
            is_whole = True
        finally:
            _end_pool(pool, are_ending=is_whole)
    return lost


@contextmanager
def _remembered_interrupts() -> Iterator[list[Termination]]:
    """Yield the handlers of Ctrl-C and SIGTERM, which raise at once and remember it.

    An interrupt that falls into a finalizer or a callback is lost there: Python prints it and goes on.
    """
    is_ours = (
        threading.current_thread() is threading.main_thread()
        and signal.getsignal(signal.SIGINT) is signal.default_int_handler
    )
    if is_ours:
        signal.signal(signal.SIGINT, Termination())
    found = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    try:
        yield [handler for handler in found if isinstance(handler, Termination)]
    finally:
        if is_ours and signal.getsignal(signal.SIGINT) is found[0]:
            signal.signal(signal.SIGINT, signal.default_int_handler)


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
    except Exception as error:  # any error is the task's result
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
    _leave_with_parent()
    import_own()


def _leave_with_parent() -> None:
    """Let this process end when its parent is gone, whatever it waits for.

    The parent may have been killed, so that the results are not read. On Linux the kernel sends the signal; a thread
    that waits for the parent would not run while a library waits for a lock and holds the interpreter.
    """
    parent = multiprocessing.parent_process()
    if parent is None:
        return
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        if not parent.is_alive():  # it was gone before
            os._exit(1)

    def leave() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=leave, daemon=True).start()
