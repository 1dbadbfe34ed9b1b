"""Prints the lowest versions of the dependencies in pyproject.toml as constraints for pip."""

import re
import sys
import tomllib
from collections.abc import Sequence
from pathlib import Path

PYPROJECT = Path(__file__).resolve().parents[2] / "pyproject.toml"


def lowest(dependencies: Sequence[str]) -> list[str]:
    """Return each dependency at the lowest version that it allows.

    Raises
    ------
    ValueError
        If a dependency has no lowest version.
    """
    found = []
    for each in dependencies:
        match = re.match(r"([\w.-]+)(?:\[[\w,-]+\])?>=([\w.]+)", each)
        if match is None:
            raise ValueError(f"dependency {each!r} has no lowest version; want NAME>=VERSION")
        found.append(f"{match[1]}=={match[2]}")
    return found


if __name__ == "__main__":
    project = tomllib.loads(PYPROJECT.read_text(encoding="utf-8"))["project"]
    sys.stdout.write("".join(f"{line}\n" for line in lowest(project["dependencies"])))
