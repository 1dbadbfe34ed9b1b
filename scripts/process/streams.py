"""Standard streams of a command.

Some may be closed, or have nobody who reads them.
"""

import os
import sys
from contextlib import suppress
from typing import TextIO


def open_closed_streams() -> None:
    """Give this process the standard streams that it was started without.

    They lead to nowhere. A file opened later would take their numbers else, and whatever is printed would be
    written into it.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115


def silence(stream: TextIO) -> None:
    """Lead a stream to nowhere.

    Its reader has left, and Python would complain at exit.
    """
    with suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


def print_result(text: str) -> None:
    """Print a result on standard output.

    Raises
    ------
    OSError
        Where it cannot be written; a reader who has left is no error.
    """
    try:
        sys.stdout.write(text)
        sys.stdout.flush()
    except BrokenPipeError:
        silence(sys.stdout)
    except OSError as error:
        silence(sys.stdout)
        message = f"the result cannot be written: {error.strerror}"
        raise OSError(error.errno, message, "standard output") from error


def flush_streams() -> None:
    """Write what is left in the buffers, as at exit, but without complaints."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (OSError, ValueError):
            silence(stream)
