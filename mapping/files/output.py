"""Files that are there whole or not at all."""

import os
import re
import secrets
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

_BESIDE = re.compile(r"\.(?P<name>.+)\.[0-9a-f]{8}")
"""Names under which ``write_whole`` writes."""


@contextmanager
def errors_named(path: Path) -> Iterator[None]:
    """Give errors of the system that name no file the name of the one that is written.

    A full disk, for instance, is reported of an open file, whose name the system does not report.
    """
    try:
        yield
    except OSError as error:
        if error.errno is None or error.filename is not None:
            raise
        raise OSError(error.errno, error.strerror, str(path)) from error


def write_whole(path: Path, content: bytes, *, is_lasting: bool = True) -> None:
    """Write a temporary file and rename it, so that nobody ever reads half of it.

    Of several writers the last one stays. Who may read it is determined by the umask. A link of that name is
    replaced, not followed.
    """
    beside = path.with_name(f".{path.name}.{secrets.token_hex(4)}")
    # Made here rather than by tempfile, whose files are for their owner alone: the system applies the mask.
    handle = os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o666)
    try:
        with errors_named(path), os.fdopen(handle, "wb") as file:
            file.write(content)
            if is_lasting:
                file.flush()
                os.fsync(file.fileno())
        os.replace(beside, path)
    except BaseException:
        Path(beside).unlink(missing_ok=True)
        raise


def remove_unfinished(folder: Path, suffixes: Sequence[str]) -> None:
    """Remove the files that ``write_whole`` left if its process was killed."""
    for path in folder.glob(".*"):
        named = _BESIDE.fullmatch(path.name)
        if named is not None and named["name"].endswith(tuple(suffixes)) and path.is_file():
            path.unlink(missing_ok=True)


def lock_file(handle: int, path: Path) -> None:
    """Take an open file for this process.

    The system gives it back when the process ends, however that comes about.
    """
    try:
        import fcntl
    except ImportError:  # there are no such locks on this system
        return
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        raise ValueError(
            f"{path} is being written to by another process; wait for it, or choose another folder"
        ) from error


@contextmanager
def only_writer(path: Path) -> Iterator[None]:
    """Take a file that is there for this process."""
    handle = os.open(path, os.O_RDONLY)
    try:
        lock_file(handle, path)
        yield
    finally:
        os.close(handle)
