"""Folders in which caches can be kept."""

import os
import tempfile
from collections.abc import Iterable
from pathlib import Path


def user_cache_folder() -> Path:
    """Return the folder in which the user's programs keep what they can make anew."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")


def is_writable(folder: Path) -> bool:
    """Return whether files can be written to a folder, which is made if absent."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def first_writable(candidates: Iterable[Path]) -> Path | None:
    """Return the first folder that can be written to, or None."""
    return next((folder for folder in candidates if is_writable(folder)), None)
