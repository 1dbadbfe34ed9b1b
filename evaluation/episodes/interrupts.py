"""Lets a first Ctrl-C wait for the end of a step, so that what is kept is whole."""

import signal
import threading
from types import FrameType, TracebackType


class PatientInterrupt:
    """Context in which a first SIGINT is only noted, to be acted on between two steps.

    A second one raises at once.

    An exception that is thrown into the middle of anything leaves it in the middle: a world half stepped, or
    Numba with a loader that has died for good, after which no kernel can be called. What is to be kept after
    an interrupt is therefore broken off where it is whole. Outside the main thread, and where an application
    handles SIGINT in its own way, nothing is changed.
    """

    def __init__(self) -> None:
        self._is_asked = False
        self._is_installed = False

    def __enter__(self) -> "PatientInterrupt":
        is_ours = (
            threading.current_thread() is threading.main_thread()
            and signal.getsignal(signal.SIGINT) is signal.default_int_handler
        )
        if is_ours:
            signal.signal(signal.SIGINT, self._note)
            self._is_installed = True
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._is_installed:
            signal.signal(signal.SIGINT, signal.default_int_handler)

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self._is_asked:
            raise KeyboardInterrupt
        self._is_asked = True

    @property
    def is_asked(self) -> bool:
        """Whether the user has asked for an end."""
        return self._is_asked
