"""Lets a first Ctrl-C or SIGTERM wait for the end of a step.

What is kept is whole then.
"""

import signal
import threading
import time
from collections.abc import Callable
from types import FrameType, TracebackType
from typing import Any


class Termination:
    """Handler of SIGTERM that acts as Ctrl-C does, and remembers that it was SIGTERM.

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


def is_wrapped_interrupt(error: Exception) -> bool:
    """Whether an error is an interrupt that compiled code has passed on as a ``SystemError``.

    Numba calls the interpreter while a kernel returns; an interrupt that is raised there comes out so.

    Parameters
    ----------
    error : Exception
        Whatever was raised.
    """
    cause: BaseException | None = error
    while isinstance(cause, SystemError):
        cause = cause.__cause__ or cause.__context__
    return isinstance(cause, KeyboardInterrupt)


_entered: list["PatientInterrupt"] = []


def is_end_asked() -> bool:
    """Whether a ``PatientInterrupt`` that is entered has noted a signal: who waits within should not."""
    return any(interrupt.is_asked for interrupt in _entered)


class PatientInterrupt:
    """Context in which a first SIGINT is only noted, to be acted on between two steps.

    So is a first SIGTERM, where a ``Termination`` handles it. A second one raises at once.

    An exception that is thrown into the middle of anything leaves it in the middle: a world half stepped, or
    Numba with a loader that has died for good, after which no kernel can be called. What is to be kept after
    an interrupt is therefore broken off where it is whole. Outside the main thread, and where an application
    handles a signal in its own way, nothing is changed.

    Parameters
    ----------
    grace_s : float
        For how long after the first signal further ones are taken for the same wish [s].
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
