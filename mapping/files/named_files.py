"""Files that options name, and their hashes: results that depend on them are not pooled with those of others."""

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path


def named_files(options: object) -> list[Path]:
    """Return the files that options name, at any depth and also as ``NAME=FILE``."""
    if isinstance(options, str):
        return [Path(text) for text in (options, options.partition("=")[2]) if _is_file(text)]
    if isinstance(options, Mapping):
        options = list(options.values())
    return [file for each in options for file in named_files(each)] if isinstance(options, list | tuple) else []


def _is_file(text: str) -> bool:
    try:
        return bool(text) and Path(text).is_file()
    except (OSError, ValueError):  # no name of a file
        return False


def hash_of(files: Sequence[Path]) -> str:
    """Return a hash of the content of files."""
    return hashlib.sha256(b"".join(hashlib.sha256(file.read_bytes()).digest() for file in files)).hexdigest()
