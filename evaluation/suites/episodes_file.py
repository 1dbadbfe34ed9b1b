"""A file of finished episodes, one JSON object a line.

They are written at once, never in part, by one writer at a time.

Existing lines stay. A line that was cut off when its writer was killed is dropped, with a
warning; anything else that is wrong is reported and left to the user, and so is a file that no writer of
episodes has made. An episode counts as kept when it is on the disk, in the file that bears the name.
"""

import errno
import json
import os
import stat
import warnings
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from lidarium.mapping.files.guarded_reading import read_bytes, read_text, reading, reason
from lidarium.mapping.files.output import lock_file
from lidarium.mapping.geometry.bounds import shown

KEY = "key"
"""Key of an episode in its file."""

TIMINGS = ("decision_ms", "tick_ms", "steps_per_s", "wall_s", "peak_mb")
"""Keys that differ between two runs of the same episode."""


FAILURES_FILE = "failed.json"
"""Errors of the episodes that failed in the last call, by their keys."""


def read_failures(folder: Path) -> dict[str, str]:
    """Return the errors of episodes that failed, and have not finished since, by their keys."""
    path = folder / FAILURES_FILE
    if not path.exists():
        return {}
    with reading(path, "errors of episodes", "move it away, or choose another folder"):
        found = json.loads(read_text(path))
        if not (isinstance(found, dict) and found and all(isinstance(why, str) for why in found.values())):
            raise ValueError("no evaluation has written it")
        return found


def read_episodes(path: Path) -> list[dict[str, Any]]:
    """Read all episodes of a file, in its order; none if there is no file."""
    return _parsed(path)[0]


_FIRST = f'{{"{KEY}":'.encode()
"""Beginning of each line."""

_NOT_FOLLOWED = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
"""How the file is opened: no link, and without waiting for the other end of a pipe."""


@dataclass(frozen=True, slots=True)
class _Lines:
    """The lines of a file of episodes.

    Attributes
    ----------
    numbered : list of (int, dict)
        Whole lines and their numbers, from 1 on.
    whole : int
        Bytes of the file up to the end of the last whole line.
    cut_off : (int, int) or None
        Number and bytes of a last line that breaks off.
    """

    numbered: list[tuple[int, dict[str, Any]]]
    whole: int
    cut_off: tuple[int, int] | None = None


def read_lines(path: Path) -> _Lines:
    """Read the lines of a file; none if there is no file."""
    path = Path(path)
    if not path.exists():
        return _Lines([], 0)
    lines = read_bytes(path).split(b"\n")
    numbered: list[tuple[int, dict[str, Any]]] = []
    whole = 0
    for number, line in enumerate(lines, 1):
        is_last = number == len(lines)
        if line.strip():
            try:
                episode = json.loads(line)
            except (ValueError, RecursionError) as error:
                # Without a line feed behind it, writing was broken off there.
                if is_last:
                    return _Lines(numbered, whole, (number, len(line)))
                raise ValueError(
                    f"{path}, line {number} is not JSON ({reason(error)}); want one episode a line"
                ) from error
            if not isinstance(episode, dict):
                raise ValueError(f"{path}, line {number} is not a JSON object; want one episode a line")
            numbered.append((number, episode))
        whole += len(line) + (0 if is_last else 1)
    return _Lines(numbered, whole)


def _parsed(path: Path) -> tuple[list[dict[str, Any]], int]:
    """Read the episodes, and how many bytes of the file hold whole lines."""
    lines = read_lines(path)
    if lines.cut_off is not None:
        _check_ours(path, lines.whole)
    episodes: dict[str, dict[str, Any]] = {}
    for number, episode in lines.numbered:
        if not isinstance(episode.get(KEY), str):
            raise ValueError(
                f"{path}, line {number} has the key {shown(episode.get(KEY))}; want text that tells its "
                "episode from all others"
            )
        known = episodes.setdefault(episode[KEY], episode)
        if known is not episode:
            if _lasting(known) != _lasting(episode):
                raise ValueError(
                    f"{path}, line {number}: episode {episode[KEY]!r} is there before, with another end; "
                    "take one of them out"
                )
            warnings.warn(
                f"{path}, line {number}: episode {episode[KEY]!r} is there before; counted once", stacklevel=3
            )
    if lines.cut_off is not None:
        warnings.warn(
            f"{path}, line {lines.cut_off[0]}: the last line was cut off and is left out; its episode runs again",
            stacklevel=3,
        )
    return list(episodes.values()), lines.whole


def _lasting(episode: Mapping[str, Any]) -> dict[str, Any]:
    """Return the entries that are the same whenever the episode is run."""
    return {name: value for name, value in episode.items() if name not in TIMINGS}


class EpisodesFile:
    """Appends episodes to a file; the only writer while it is open.

    Attributes
    ----------
    episodes : list of dict
        Episodes that the file had when it was opened; a last line that was cut off is taken out of the file.
    """

    def __init__(self, path: Path) -> None:
        self.path = Path(path)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self._handle = _opened(self.path)
        try:
            lock_file(self._handle, self.path)
            self.episodes, whole = _parsed(self.path)
            os.ftruncate(self._handle, whole)
            self._size = whole
            if whole and not self._ends_a_line():
                self._append(b"\n")
        except BaseException:
            os.close(self._handle)
            raise

    def append(self, episode: Mapping[str, Any]) -> None:
        """Add an episode; when this returns it is on the disk."""
        if not isinstance(episode.get(KEY), str):
            raise ValueError(f"the episode has the key {episode.get(KEY)!r}; want text that tells it from all others")
        line = json.dumps(episode, allow_nan=False, ensure_ascii=False, separators=(",", ":"))
        # Bytes of names that are no UTF-8 are escaped as JSON does it.
        self._append(line.encode("utf-8", "backslashreplace") + b"\n")
        self.check_in_place()

    def check_in_place(self) -> None:
        """Check that the file is still the one of its name."""
        ours = os.fstat(self._handle)
        try:
            named = os.lstat(self.path)
        except FileNotFoundError:
            named = None
        if named is None or (named.st_dev, named.st_ino) != (ours.st_dev, ours.st_ino):
            what = "removed" if named is None else "replaced by another"
            raise OSError(
                errno.ESTALE,
                f"was {what} while episodes were written to it, which are lost; leave the folder in its "
                "place and run the same command again",
                str(self.path),
            )

    def _append(self, content: bytes) -> None:
        try:
            written = os.write(self._handle, content)
            if written != len(content):
                raise OSError(errno.ENOSPC, "the disk is full", str(self.path))
            os.fsync(self._handle)
        except OSError as error:
            with suppress(OSError):  # the next reader detects and skips the cut-off line
                os.ftruncate(self._handle, self._size)
            raise OSError(
                error.errno,
                f"{error.strerror or error}; the episodes before are kept, the same command goes on from there",
                str(self.path),
            ) from error
        self._size += len(content)

    def _ends_a_line(self) -> bool:
        return os.pread(self._handle, 1, self._size - 1) == b"\n"

    def close(self) -> None:
        """Let others write."""
        os.close(self._handle)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _opened(path: Path) -> int:
    """Open a file to be read and added to, made if absent; a plain file and no link."""
    try:
        handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND | _NOT_FOLLOWED, 0o666)
    except OSError as error:
        if path.is_symlink():
            raise _not_plain(path, "a link") from error
        raise
    if not stat.S_ISREG(os.fstat(handle).st_mode):
        os.close(handle)
        raise _not_plain(path, "no plain file")
    return handle


def _not_plain(path: Path, what: str) -> ValueError:
    return ValueError(f"{path} is {what}; episodes are written to plain files only, choose another folder")


def _check_ours(path: Path, whole: int) -> None:
    """Check that the cut-off line is the beginning of an episode."""
    with path.open("rb") as file:
        file.seek(whole)
        rest = file.read(64).replace(b" ", b"").strip(b"\0\r\n\t")
    # Some file systems leave zeros at the end of an interrupted write.
    if not (rest.startswith(_FIRST) or _FIRST.startswith(rest)):
        raise ValueError(
            f"{path} ends with {rest[:20]!r}, which no evaluation has written; move the file away, or choose "
            "another folder"
        )
