"""The finished parts of a study in one file: others go on from there, or make its page again."""

import io
import json
import tempfile
import zipfile
from collections.abc import Mapping
from pathlib import Path, PurePosixPath

from lidarium.evaluation.suites.episodes_file import KEY
from lidarium.mapping.files.guarded_reading import GuardedArchive, read_bytes, reading
from lidarium.mapping.files.output import write_whole

SUFFIXES = (".jsonl", ".json", ".csv", ".safetensors")
"""Kinds of files that are kept."""

_LEFT_OUT = {"records", "checkpoints", "tensorboard"}
"""Folders that finished parts do not need."""


def unpack_parts(path: Path, folder: Path) -> None:
    """Begin a folder with the files of an archive, if there is one.

    A folder with files stays as it is; it has to have all parts of the archive.
    """
    if not path.exists():
        return
    if folder.exists() and any(folder.iterdir()):
        _check_held(path, folder, _kept(folder))
        return
    files = _files_of(path)
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder.parent, prefix=f".{folder.name}.") as temporary:
        unpacked = Path(temporary, folder.name)
        for name, content in files.items():
            (unpacked / name).parent.mkdir(parents=True, exist_ok=True)
            (unpacked / name).write_bytes(content)
        unpacked.replace(folder)


def pack_parts(folder: Path, path: Path) -> None:
    """Write the finished parts of a folder into an archive; the same parts give the same file.

    An archive with parts that the folder lacks is not replaced.
    """
    kept = _kept(folder)
    if path.exists():
        _check_held(path, folder, kept)
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w") as archive:
        for name, content in kept.items():
            archive.writestr(zipfile.ZipInfo(name), content, zipfile.ZIP_DEFLATED, 9)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, made.getvalue())


def _kept(folder: Path) -> dict[str, bytes]:
    """Return the files of a folder that archives keep, by their names within it."""
    return {
        file.relative_to(folder).as_posix(): file.read_bytes()
        for file in sorted(folder.rglob("*"))
        if file.suffix in SUFFIXES
        and not file.name.startswith(".")
        and _LEFT_OUT.isdisjoint(file.relative_to(folder).parts)
    }


def _check_held(path: Path, folder: Path, kept: Mapping[str, bytes]) -> None:
    """Check that a folder has all parts of an archive."""
    for name, content in _files_of(path).items():
        lost = [name] if name not in kept else sorted(_keys(name, content) - _keys(name, kept[name]))
        if lost:
            raise ValueError(
                f"{path} has {lost[0]!r}, which {folder} lacks; choose another file with --parts, or a new folder "
                "with --runs, which begins with the parts of the file"
            )


def _files_of(path: Path) -> dict[str, bytes]:
    content = read_bytes(path)
    with reading(path, "an archive of finished parts", "want one that lidarium reproduce --parts wrote"):
        archive = GuardedArchive(content)
        for name in archive.names:
            inner = PurePosixPath(name)
            if inner.is_absolute() or ".." in inner.parts or "\\" in name or inner.suffix not in SUFFIXES:
                raise ValueError(f"it holds {name!r}")
        return {name: archive.read(name) for name in archive.names}


def _keys(name: str, content: bytes) -> set[str]:
    """Return the keys of the whole lines of a file; a last line without an end was cut off. Other files have none."""
    whole = content[: content.rfind(b"\n") + 1] if name.endswith(".jsonl") else b""
    return {json.loads(line)[KEY] for line in whole.splitlines()}
