"""`lidarium examples`: list the programs, configurations and notebooks that come with lidarium."""

from dataclasses import dataclass
from pathlib import Path

import lidarium
from lidarium.scripts.common import Answer, Command, table

KINDS = {"how_to/trainers": "*.py", "tutorials": "*.toml", "notebooks": "*.ipynb"}
"""Folders of examples below the documentation, and which of their files are examples."""


@dataclass(frozen=True, kw_only=True)
class _Examples(Command):
    """List the programs of trainers, configurations and notebooks; `lidarium examples copy` copies them."""


def examples() -> dict[str, Path]:
    """Return the files of the examples by name: of a checkout, or those that a wheel has brought."""
    package = Path(lidarium.__file__).resolve().parent
    folders = (package / "examples", package.parents[1] / "docs")
    files = [path for base in folders for folder, pattern in KINDS.items() for path in (base / folder).glob(pattern)]
    if not files:
        raise ValueError(f"this installation has no examples; they belong to {folders[0]}: install lidarium again")
    return {path.name: path for path in sorted(files) if path.name != "__init__.py"}


def summary(path: Path) -> str:
    """Return what an example is about: its first words."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".py":
        return text.lstrip('"').partition("\n")[0].rstrip('".')
    if path.suffix == ".toml":
        return text.lstrip("# ").partition("\n")[0].partition(":")[0]
    return f"notebook: {text.partition('# ')[2].partition(chr(92))[0]}"


def execute(command: _Examples) -> Answer:
    """List the examples."""
    found = {name: summary(path) for name, path in examples().items()}
    return Answer({"examples": found}, table(list(found.items())))
