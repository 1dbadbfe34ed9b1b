"""The command ``lidarium``, which Ctrl-C ends without a traceback from its first moment.

It is no part of the package: that is imported when the command begins, and takes a while.
"""

import os
import signal
import sys
from collections.abc import Sequence
from types import FrameType

INTERRUPTED = 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Import the command line and run it; return its exit code.

    The arguments are those of the process if None is given.

    While it is imported nothing is under way that could be kept, so that Ctrl-C ends the process at once.
    """
    is_usual = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if is_usual:
        signal.signal(signal.SIGINT, _leave)
    from lidarium.scripts.main import main as run

    try:
        if is_usual:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        return run(arguments)
    except KeyboardInterrupt:  # before or after the command line hears it itself
        return INTERRUPTED


def _leave(_number: int, _frame: FrameType | None) -> None:
    os.write(2, b"interrupted\n")
    os._exit(INTERRUPTED)


if __name__ == "__main__":
    sys.exit(main())
