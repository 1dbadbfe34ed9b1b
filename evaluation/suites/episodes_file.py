"""A file of finished episodes, one JSON object a line.

They are written at once, never in part, by one writer at a time.

What is in the file stays there. A line that was cut off when its writer was killed is dropped, with a
warning; anything else that is wrong is told and left to the user.
"""

import json
import os
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from lidarium.mapping.files.guarded_reading import read_bytes, reason
from lidarium.mapping.geometry.bounds import shown

KEY = "key"
"""What tells an episode from all others of its file."""

TIMINGS = ("decision_ms", "tick_ms", "steps_per_s", "wall_s", "peak_mb")
"""What differs between two runs of the same episode."""


def read_episodes(path: Path) -> list[dict[str, Any]]:
    """Read all episodes of a file, in its order; none where there is no file.

    Raises
    ------
    ValueError
        Where a line other than the last is no episode, or two of the same key have come to different ends;
        the line is named.

    Warns
    -----
    UserWarning
        Where the last line was cut off, or an episode is there twice; it is left out.
    """
    return _parsed(path)[0]


@dataclass(frozen=True, slots=True)
class Lines:
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


def read_lines(path: Path) -> Lines:
    """Read the lines of a file; none where there is no file.

    Raises
    ------
    ValueError
        Where a line other than the last is no JSON object; the line is named.
    """
    path = Path(path)
    if not path.exists():
        return Lines([], 0)
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
                    return Lines(numbered, whole, (number, len(line)))
                raise ValueError(
                    f"{path}, line {number} is not JSON ({reason(error)}); want one episode a line"
                ) from error
            if not isinstance(episode, dict):
                raise ValueError(f"{path}, line {number} is not a JSON object; want one episode a line")
            numbered.append((number, episode))
        whole += len(line) + (0 if is_last else 1)
    return Lines(numbered, whole)


def _parsed(path: Path) -> tuple[list[dict[str, Any]], int]:
    """Read the episodes, and how many bytes of the file hold whole lines."""
    lines = read_lines(path)
    if lines.cut_off is not None:
        warnings.warn(
            f"{path}, line {lines.cut_off[0]}: the last line was cut off and is left out; its episode runs "
            "again",
            stacklevel=3,
        )
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
    return list(episodes.values()), lines.whole


def _lasting(episode: Mapping[str, Any]) -> dict[str, Any]:
    """Return what is the same whenever the episode is run."""
    return {name: value for name, value in episode.items() if name not in TIMINGS}


class EpisodesFile:
    """Appends episodes to a file; the only writer while it is open.

    Parameters
    ----------
    path : Path
        The file; made where absent, with its folder.

    Attributes
    ----------
    episodes : list of dict
        What was there when the file was opened; a last line that was cut off is taken out of the file.

    Raises
    ------
    ValueError
        As ``read_episodes``; and where another process has the file open.
    OSError
        Where the file cannot be written to.
    """

    def __init__(self, path: Path) -> None:
        self.path = Path(path)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self._handle = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o644)
        try:
            _lock(self._handle, self.path)
            self.episodes, whole = _parsed(self.path)
            os.ftruncate(self._handle, whole)
            self._size = whole
            if whole and not self._ends_a_line():
                self._append(b"\n")
        except BaseException:
            os.close(self._handle)
            raise

    def append(self, episode: Mapping[str, Any]) -> None:
        """Add an episode; when this returns it is on the disk.

        Raises
        ------
        ValueError
            Where it has no key, or holds a number that is not finite.
        OSError
            Where it cannot be written, such as on a full disk; the file is as it was before.
        """
        if not isinstance(episode.get(KEY), str):
            raise ValueError(
                f"the episode has the key {episode.get(KEY)!r}; want text that tells it from all others"
            )
        line = json.dumps(episode, allow_nan=False, ensure_ascii=False, separators=(",", ":"))
        # Bytes of names that are no UTF-8 are escaped as JSON does it.
        self._append(line.encode("utf-8", "backslashreplace") + b"\n")

    def _append(self, content: bytes) -> None:
        try:
            written = os.write(self._handle, content)
            if written != len(content):
                raise OSError(28, "the disk is full", str(self.path))
            os.fsync(self._handle)
        except OSError as error:
            os.ftruncate(self._handle, self._size)
            raise OSError(
                error.errno,
                f"{error.strerror or error}; the episodes before are kept, the same command goes on from "
                "there",
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


def _lock(handle: int, path: Path) -> None:
    """Take the file for this process.

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
