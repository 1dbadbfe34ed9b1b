"""`lidarium examples copy`: copy programs, configurations and notebooks to a folder, to change them."""

import difflib
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from lidarium.scripts.commands.examples import examples
from lidarium.scripts.common import Answer, Command

DEFAULT_FOLDER = Path("examples")


@dataclass(frozen=True, kw_only=True)
class _ExamplesCopy(Command):
    """Copy examples to --out, examples by default. Files that were changed there stay as they are."""

    names: Annotated[Positional[tuple[str, ...]], arg(metavar="NAME...")] = ()
    """which, as `lidarium examples` lists them; all by default"""


def execute(command: _ExamplesCopy) -> Answer:
    """Copy the chosen examples, unless another file of that name is there."""
    from lidarium.mapping.files.output import check_writable, write_whole

    known, folder = examples(), command.out or DEFAULT_FOLDER
    for name in command.names:
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1)
            guess = f", did you mean {near[0]}?" if near else ""
            raise ValueError(f"there is no example {name!r}{guess}; lidarium examples lists them")
    contents = {name: known[name].read_bytes() for name in command.names or known}
    changed = [name for name, content in contents.items() if _differs(folder / name, content)]
    if changed:
        raise FileExistsError(
            f"{folder / changed[0]} is there and differs from the example; move it, or want another --out"
        )
    check_writable(folder)
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in contents.items():
        write_whole(folder / name, content)
    files = [str(folder / name) for name in contents]
    return Answer({"files": files}, f"copied to {folder}: {', '.join(contents)}")


def _differs(path: Path, content: bytes) -> bool:
    return path.exists() and path.read_bytes() != content
