"""The folder of a training: what it was asked for, and the versions that made it."""

import json
import platform
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import lidarium
from lidarium.mapping.files.guarded_reading import read_text, reading
from lidarium.mapping.files.named_files import hash_of, named_files
from lidarium.mapping.files.output import clear_unfinished, write_json
from lidarium.mapping.geometry.bounds import shown
from lidarium.training.loggers import flattened

MOST_BYTES = 1 << 20
"""Files of what a training was asked for are no larger."""


def begin_folder(path: Path, settings: Mapping[str, Any], floors: Mapping[str, str] | None = None) -> None:
    """Check that the folder of a file is that of a training with these settings, or new; then write them.

    Files that the settings name count by their content, ``floors`` in files by these hashes.
    """
    asked, folder = asked_for(settings), path.parent
    inputs = {name: hash_of(files) for name, value in settings.items() if (files := named_files(value))}
    if inputs := {**inputs, **(floors or {})}:
        asked["inputs"] = inputs
    if not path.exists():
        clear_unfinished(folder, ".json")
        if folder.exists() and any(folder.iterdir()):
            raise ValueError(f"{folder} has files, and no training has written them; choose another folder")
        write_json(path, asked)
        return
    with reading(path, "what a training was asked for", "put a copy back, or choose another folder"):
        kept = flattened(dict(json.loads(read_text(path, MOST_BYTES))))
    asked = flattened(asked)
    for name in sorted({*kept, *asked}):
        before, now = kept.get(name, "nothing"), asked.get(name, "nothing")
        if before != now:
            raise ValueError(
                f"{folder} holds a training with {name} = {shown(before)}, this one has {shown(now)}; choose "
                "another folder"
            )


def asked_for(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return the settings of a training as JSON has them, with the version of lidarium."""
    content: dict[str, Any] = json.loads(json.dumps(settings))
    return {"version": lidarium.__version__, **content}


def versions(libraries: Sequence[str]) -> dict[str, str]:
    """Return the versions of lidarium, Python and some packages, for a card."""
    own = {"lidarium": lidarium.__version__, "python": platform.python_version()}
    return own | {name: version(name) for name in libraries}
