"""Prints the notes of a release from CHANGELOG.md: `python scripts/dev/release_notes.py 0.3.0`."""

import re
import sys
from pathlib import Path

CHANGELOG = Path(__file__).parents[2] / "CHANGELOG.md"


def notes(version: str, text: str) -> str:
    """Return the section of a version.

    Raises
    ------
    ValueError
        If there is none.
    """
    found = re.search(rf"^## \[{re.escape(version)}\][^\n]*\n(.*?)(?=^## \[|\Z)", text, re.MULTILINE | re.DOTALL)
    if found is None:
        known = ", ".join(re.findall(r"^## \[([^\]]+)\]", text, re.MULTILINE))
        raise ValueError(f"CHANGELOG.md has no release {version}; it has {known}")
    return found[1].strip() + "\n"


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    try:
        sys.stdout.write(notes(sys.argv[1], CHANGELOG.read_text(encoding="utf-8")))
    except ValueError as error:
        sys.exit(str(error))
