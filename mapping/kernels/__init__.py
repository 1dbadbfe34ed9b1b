"""Compiled functions: their decorator, cache, views of arrays, work queue.

The decorator, the kernel cache, views of arrays at addresses, and work for threads.
"""

from typing import Any


def __getattr__(name: str) -> Any:  # noqa: ANN401
    """Return a name that has moved; it warns."""
    from lidarium.moved import moved_name

    return moved_name(__name__, name)
