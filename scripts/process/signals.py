"""Signals that end a command.

A first one keeps what is finished, a second one ends it at once.
"""

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any

from lidarium.scripts.common import INTERRUPTED, TERMINATED


@contextmanager
def heard_termination() -> Iterator[Any]:
    """Let SIGTERM end what runs as Ctrl-C does.

    Nothing changes outside the main thread, and where an application handles the signal in its own way.

    Yields
    ------
    Termination
        Whether the signal came.
    """
    from lidarium.evaluation.episodes.interrupts import Termination

    termination = Termination()
    is_ours = (
        threading.current_thread() is threading.main_thread()
        and signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    )
    if is_ours:
        signal.signal(signal.SIGTERM, termination)
    try:
        yield termination
    finally:
        if is_ours and signal.getsignal(signal.SIGTERM) is termination:
            signal.signal(signal.SIGTERM, signal.SIG_DFL)


def code_of(is_terminated: bool) -> int:
    """Return the exit code of what was broken off."""
    return TERMINATED if is_terminated else INTERRUPTED


def leave_at_the_next(code: int) -> None:
    """Let the next Ctrl-C or SIGTERM end this process at once.

    What is to be kept is kept by now. Python would answer with lines on where it was.
    """
    if threading.current_thread() is not threading.main_thread():
        return

    def leave(number: int, frame: FrameType | None) -> None:
        with suppress(BaseException):  # whatever was under way when the signal came
            if "multiprocessing" in sys.modules:
                from lidarium.evaluation.suites.processes import kill_workers

                kill_workers()
        os._exit(code)

    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, leave)


def end_all_workers() -> None:
    """End the processes that were begun here and are still there."""
    if "multiprocessing" in sys.modules:
        from lidarium.evaluation.suites.processes import end_workers

        end_workers()
