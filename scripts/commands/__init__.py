"""Commands of ``lidarium``, one per file.

A file has the options of its command, and ``execute``, which takes them. The name of a command is that of its
file, and its summary the file's first line. A module is imported when its command is used.
"""

import re
from collections.abc import Callable
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, TypeVar

from lidarium.registry import Registry
from lidarium.scripts.common import Answer

Execute = TypeVar("Execute", bound=Callable[[Any], Answer])

COMMANDS: Registry[Callable[[Any], Answer]] = Registry("command")
"""Functions of commands by name; each takes its options, a dataclass that extends ``Command``."""

GROUP = "lidarium.commands"
"""Group of the entry points by which installed packages add commands."""


def command(name: str, summary: str) -> Callable[[Execute], Execute]:
    """Register a function as a command of ``lidarium``.

    Its one parameter is annotated with the command's options, a dataclass that extends ``Command``. It
    returns an ``Answer``. A package adds commands as entry points of the group ``lidarium.commands``, a
    module in the current folder by ``lidarium --import MODULE NAME``.

    Parameters
    ----------
    name : str
        Name that users type; no other command has it.
    summary : str
        One line for ``lidarium --help``.

    Raises
    ------
    ValueError
        If the name is taken.

    Examples
    --------
    >>> import lidarium
    >>> @lidarium.command("double", "print twice the seed")
    ... def double(options: lidarium.Command) -> lidarium.Answer:
    ...     return lidarium.Answer({"double": 2 * options.seed}, f"{2 * options.seed}")
    """

    def register(execute: Execute) -> Execute:
        COMMANDS.register(name, execute, summary)
        return execute

    return register


def find_installed() -> None:
    """Register the commands of installed packages, those with a name that is taken left out."""
    for entry in entry_points(group=GROUP):
        if entry.name not in COMMANDS:
            package = entry.dist.name if entry.dist is not None else entry.value
            COMMANDS.register(entry.name, entry.value, f"added by {package}")


def _register_built_in() -> None:
    for path in sorted(Path(__file__).parent.glob("*.py")):
        if path.stem != "__init__":
            with path.open(encoding="utf-8") as file:
                summary = re.sub(r'^"""`lidarium [\w -]+`: |\.?(""")?$', "", file.readline().strip())
            item = f"{__name__}.{path.stem}:execute"
            COMMANDS.register(path.stem.replace("_", "-"), item, summary)


_register_built_in()
