"""Interrupts that come while a kernel takes its arguments or gives its result.

Numba calls the interpreter then, and passes an interrupt that is raised there on as a ``SystemError``.
"""

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

Given = ParamSpec("Given")
Returned = TypeVar("Returned")


def is_wrapped_interrupt(error: Exception) -> bool:
    """Whether an error is an interrupt that compiled code has passed on as a ``SystemError``."""
    cause: BaseException | None = error
    while isinstance(cause, SystemError):
        cause = cause.__cause__ or cause.__context__
    return isinstance(cause, KeyboardInterrupt)


def interruptible(function: Callable[Given, Returned]) -> Callable[Given, Returned]:
    """Let interrupts of a function that calls kernels be ``KeyboardInterrupt``, as those of others are."""

    @wraps(function)
    def called(*given: Given.args, **named: Given.kwargs) -> Returned:
        try:
            return function(*given, **named)
        except SystemError as error:
            if is_wrapped_interrupt(error):
                raise KeyboardInterrupt from error
            raise

    return called
