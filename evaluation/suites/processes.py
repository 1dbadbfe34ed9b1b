"""Processes of workers: how they are begun and ended, and which of them are stopped."""

import multiprocessing
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

GRACE_S = 2.0
"""Wall time in which a process that was asked to end may do so [s]."""

_STOPPED = frozenset("Tt")
"""States of processes that run no more until they are continued, as the system names them."""


@contextmanager
def interrupts_held() -> Iterator[None]:
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


def end_workers(grace_s: float = GRACE_S, *, are_ending: bool = False) -> None:
    """End all processes that this one has begun, and wait until they are gone.

    A process that is stopped does not hear that it is to end; it is killed.

    Parameters
    ----------
    grace_s : float
        Wall time in which they may end by themselves [s].
    are_ending : bool
        Whether they know already that they are to end.
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


def kill_workers() -> None:
    """End all processes that this one has begun, at once, whatever they do."""
    for process in multiprocessing.active_children():
        with suppress(OSError):
            process.kill()


def stopped_workers() -> list[int]:
    """Return the numbers of workers that are stopped (SIGSTOP, Ctrl-Z).

    None where the system does not say.
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
