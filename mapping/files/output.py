"""Files that are there whole or not at all."""

import errno
import io
import json
import os
import re
import secrets
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

_BESIDE = re.compile(r"\.(?P<name>.+)\.[0-9a-f]{8}")
"""Names under which ``write_whole`` writes."""


@contextmanager
def _errors_named(path: Path) -> Iterator[None]:
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
        with _errors_named(path), os.fdopen(handle, "wb") as file:
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


_UNFINISHED = re.compile(r"\.(?P<name>.+)\.[a-z0-9_]{8}")
"""Names of the folders in which ``whole_file`` writes."""


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Lend a name beside ``path`` to write to.

    It becomes ``path`` at the end, when it is on the disk, and is removed where writing fails. A link of that name
    is replaced, not followed.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=f".{path.name}.") as folder:
        beside = Path(folder) / path.name
        with _errors_named(path):
            yield beside
            _bring_to_disk(beside)
        beside.replace(path)


def _bring_to_disk(path: Path) -> None:
    """Wait until a file is on the disk: some report only then that they are full."""
    handle = os.open(path, os.O_RDWR)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def clear_unfinished(folder: Path, suffix: str) -> None:
    """Take away what ``whole_file`` left where its process was killed.

    Only what it made goes: a folder of its naming, no link, that holds at most the one file.
    """
    for rest in folder.glob(f".*{suffix}.*"):
        named = _UNFINISHED.fullmatch(rest.name)
        if named is None or not named["name"].endswith(suffix) or rest.is_symlink():
            continue
        with suppress(OSError):  # it is no folder, or cannot be read
            if set(os.listdir(rest)) <= {named["name"]}:
                (rest / named["name"]).unlink(missing_ok=True)
                rest.rmdir()


def check_written(folder: Path, names: Iterable[str]) -> None:
    """Check that the files that were written are still there."""
    for name in names:
        if not (Path(folder) / name).is_file():
            raise FileNotFoundError(
                errno.ENOENT,
                "was written, and somebody has removed it meanwhile; run the same command again",
                str(Path(folder) / name),
            )


def write_text(path: Path, text: str) -> None:
    """Write a text file (UTF-8)."""
    with whole_file(path) as beside:
        beside.write_text(text, encoding="utf-8")


def write_arrays(path: Path, arrays: Mapping[str, Any], *, is_compressed: bool = True) -> None:
    """Write arrays as a NumPy archive (.npz), without pickles."""
    import numpy as np

    content = io.BytesIO()
    save = np.savez_compressed if is_compressed else np.savez
    save(content, allow_pickle=False, **arrays)
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    write_whole(Path(path), content.getvalue())


def as_json(content: Mapping[str, Any]) -> str:
    """Return JSON text with a line feed at the end."""
    text = json.dumps(content, indent=2, allow_nan=False, ensure_ascii=False) + "\n"
    # Bytes of names that are no UTF-8 are escaped as JSON does it.
    return text.encode("utf-8", "backslashreplace").decode()


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Write a JSON file; raises as `as_json`."""
    write_text(path, as_json(content))


def check_not_read(read: Path | str, written: Iterable[Path | str | None]) -> None:
    """Check that a file that is read is none of those that are written."""
    for path in written:
        if path is not None and Path(path).resolve() == Path(read).resolve():
            raise ValueError(f"{path} is read, and would be overwritten; choose another name")


def check_writable(folder: Path) -> None:
    """Check that files can be written to a folder that need not exist yet.

    The check leaves nothing behind.
    """
    folder = Path(folder)
    nearest = folder.absolute()
    while not nearest.exists() and not nearest.is_symlink():
        nearest = nearest.parent
    if not nearest.is_dir():
        raise NotADirectoryError(f"cannot write to {folder}: {nearest} is not a folder; want a folder, or a new name")
    try:
        with tempfile.TemporaryDirectory(dir=nearest, prefix=".lidarium."):
            pass
    except OSError as error:
        raise PermissionError(
            f"cannot write to {folder}: {error.strerror or error}; want a folder that can be written to"
        ) from error
