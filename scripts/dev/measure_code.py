"""Measure the sources: sizes, public names, modules with one importer, words of documents, and the way of a step.

Usage: python scripts/dev/measure_code.py [folder of a checkout]
"""

import ast
import os
import subprocess
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

PRODUCT = ("envs", "agents", "mapping", "evaluation", "training", "scripts", "src")
Row = tuple[str, str]


def sources(root: Path, *folders: str) -> dict[str, str]:
    """Return the Python files of a checkout that git follows, by path."""
    listed = subprocess.run(
        ["git", "-C", str(root), "ls-files", *folders], capture_output=True, text=True, check=True
    ).stdout.split()
    return {name: (root / name).read_text() for name in listed if name.endswith(".py")}


def public_names(text: str) -> list[str]:
    """Return the functions and classes of a module that have no leading underscore."""
    defined = (node for node in ast.parse(text).body if isinstance(node, (ast.FunctionDef, ast.ClassDef)))
    return [node.name for node in defined if not node.name.startswith("_")]


def imported(text: str) -> Iterator[tuple[str, str]]:
    """Yield module and name of what a module imports from lidarium."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("lidarium."):
            for name in node.names:
                yield (node.module or "").removeprefix("lidarium."), name.name


def sole_importers(files: dict[str, str]) -> dict[str, str]:
    """Return the modules that exactly one other imports, each with that one."""
    modules = {
        name.removesuffix(".py").removeprefix("src/lidarium/").replace("/", "."): text
        for name, text in files.items()
        if not name.endswith("__init__.py")
    }
    importers: dict[str, set[str]] = defaultdict(set)
    for importer, text in modules.items():
        for module, name in imported(text):
            for target in {module, f"{module}.{name}"} & (modules.keys() - {importer}):
                importers[target].add(importer)
    return {target: next(iter(them)) for target, them in sorted(importers.items()) if len(them) == 1}


def words(root: Path, are_results: bool) -> int:
    """Return the number of words in README and docs, either those of results or all others."""
    pages = [root / "README.md", *(root / "docs").rglob("*.md")]
    return sum(len(page.read_text().split()) for page in pages if ("results" in page.parts) == are_results)


def sizes(root: Path) -> list[Row]:
    """Return the sizes of a checkout."""
    product, others = sources(root, *PRODUCT), sources(root, "benchmarks", "tests")
    lines = {name: text.count("\n") for name, text in (product | others).items()}
    public = [name for text in product.values() for name in public_names(text)]
    used = {name for text in (product | sources(root, "benchmarks")).values() for _, name in imported(text)}

    def total(folder: str) -> str:
        return f"{sum(count for name, count in lines.items() if name.startswith(folder)):,}"

    return [
        ("product: files, lines", f"{len(product)}, {sum(lines[name] for name in product):,}"),
        ("longest file of the product [lines]", f"{max(lines[name] for name in product)}"),
        ("benchmarks; tests, lines", f"{total('benchmarks')}; {total('tests')}"),
        ("public names; of these imported by another module", f"{len(public):,}; {sum(n in used for n in public):,}"),
        ("modules with one importer", f"{len(sole_importers(product))}"),
        ("words in README and docs; in results pages", f"{words(root, False):,}; {words(root, True):,}"),
    ]


def way(root: Path, call: Callable[[], object]) -> str:
    """Return the number of files that Python passes in a call, and how often it changes the file."""
    folder, seen = str(root.resolve()) + os.sep, []

    def note(frame: object, event: str, _: object) -> None:
        name = os.path.realpath(frame.f_code.co_filename) if event == "call" else ""  # type: ignore[attr-defined]
        if name.startswith(folder) and "site-packages" not in name:
            seen.append(name)

    sys.setprofile(note)
    try:
        call()
    finally:
        sys.setprofile(None)
    return f"{len(set(seen))}, {sum(a != b for a, b in pairwise(seen))}"


def ways(root: Path) -> list[Row]:
    """Return the ways of steps and of a reset through the files of the installed checkout."""
    import numpy as np

    import lidarium

    team, rows = lidarium.parallel_env("apartment", robots=3), lidarium.vector_env(4, "apartment", robots=2)
    team.reset(seed=0)
    rows.reset(seed=0)
    still = {agent: np.zeros(2, np.float32) for agent in team.agents}
    zeros = np.zeros(rows.action_space.shape or (), np.float32)
    team.step(still)
    rows.step(zeros)
    return [
        ("`parallel_env.step`: files, changes of file", way(root, lambda: team.step(still))),
        ("`vector_env.step`: files, changes of file", way(root, lambda: rows.step(zeros))),
        ("`vector_env.reset`: files, changes of file", way(root, lambda: rows.reset(seed=1))),
    ]


if __name__ == "__main__":
    checkout = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).resolve().parents[2]
    for what, figure in sizes(checkout) + ways(checkout):
        print(f"| {what} | {figure} |")
