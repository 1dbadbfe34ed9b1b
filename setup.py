"""Say what pyproject cannot: the root folders lie below the package's name.

An editable install gets links, ``src/lidarium/envs`` to ``envs`` for instance. The package is then a plain
folder below ``src``: editors, type checkers and import tools find every module without a configuration of
their own.
"""

import os
import sys
from pathlib import Path

from setuptools import find_packages, setup

FOLDERS = ("envs", "agents", "mapping", "evaluation", "training", "benchmarks", "scripts")
EXAMPLES = ("how_to/trainers", "tutorials", "notebooks")
"""Folders of the documentation whose programs, configurations and notebooks wheels have below ``lidarium/examples``."""

COMMAND = "lidarium_command"
ROOT = Path(__file__).resolve().parent


def link_folders() -> None:
    """Link every root folder below ``src/lidarium``.

    Junctions on Windows, relative links elsewhere.
    """
    for folder in FOLDERS:
        link = ROOT / "src" / "lidarium" / folder
        if os.path.lexists(link):
            continue
        if sys.platform == "win32":
            import _winapi

            _winapi.CreateJunction(str(ROOT / folder), str(link))
        else:
            link.symlink_to(Path("..", "..", folder), target_is_directory=True)


if "editable_wheel" in sys.argv:
    link_folders()
    setup(package_dir={"": "src"}, packages=find_packages("src"), py_modules=[COMMAND])
else:
    patterns = [pattern for folder in FOLDERS for pattern in (folder, f"{folder}.*")]
    examples = {f"lidarium.examples.{folder.replace('/', '.')}": f"docs/{folder}" for folder in EXAMPLES}
    setup(
        package_dir={"": "src", **{f"lidarium.{folder}": folder for folder in FOLDERS}, **examples},
        packages=["lidarium", *(f"lidarium.{package}" for package in find_packages(".", include=patterns)), *examples],
        py_modules=[COMMAND],
    )
