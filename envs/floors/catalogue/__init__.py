"""Floors by name."""

from typing import Any


def __getattr__(name: str) -> Any:  # noqa: ANN401
    """Return a name that has moved; it warns."""
    from lidarium.moved import moved_name

    return moved_name(__name__, name)
