"""Files that are there whole or not at all: written beside, then renamed."""

import json
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Lend a name beside ``path`` to write to.

    It becomes ``path`` at the end, and is removed where writing fails.

    Parameters
    ----------
    path : Path
        The file that shall be; its folder is made if absent. The lent name ends as this one does.

    Yields
    ------
    Path
        Where to write.

    Raises
    ------
    OSError
        Where nothing can be written there.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=f".{path.name}.") as folder:
        beside = Path(folder) / path.name
        yield beside
        beside.replace(path)


def write_text(path: Path, text: str) -> None:
    """Write a text file (UTF-8)."""
    with whole_file(path) as beside:
        beside.write_text(text, encoding="utf-8")


def as_json(content: Mapping[str, Any]) -> str:
    """Return JSON text with a line feed at the end.

    Raises
    ------
    ValueError
        Where a number is not finite: JSON has no such numbers.
    """
    text = json.dumps(content, indent=2, allow_nan=False, ensure_ascii=False) + "\n"
    # Bytes of names that are no UTF-8 are escaped as JSON does it.
    return text.encode("utf-8", "backslashreplace").decode()


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Write a JSON file; raises as `as_json`."""
    write_text(path, as_json(content))


def check_writable(folder: Path) -> None:
    """Check that files can be written to a folder that need not exist yet.

    The check leaves nothing behind.

    Raises
    ------
    NotADirectoryError
        Where the folder, or one above it, is a file.
    PermissionError
        Where nothing can be written there.
    """
    folder = Path(folder)
    nearest = folder.absolute()
    while not nearest.exists() and not nearest.is_symlink():
        nearest = nearest.parent
    if not nearest.is_dir():
        raise NotADirectoryError(
            f"cannot write to {folder}: {nearest} is not a folder; want a folder, or a new name"
        )
    try:
        with tempfile.TemporaryDirectory(dir=nearest, prefix=".lidarium."):
            pass
    except OSError as error:
        raise PermissionError(
            f"cannot write to {folder}: {error.strerror or error}; want a folder that can be written to"
        ) from error
