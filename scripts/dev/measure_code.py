"""Measure the sources: sizes of modules, functions, parameters, lines, tests at mirrored paths.

Usage: python scripts/dev/measure_code.py [folder of a checkout]
"""

import ast
import sys
from pathlib import Path

LAYERS = ("envs", "agents", "mapping", "evaluation", "training", "scripts")
SKIPS = "fmt: " + "skip"
LONG_FILE, LONG_FUNCTION, MANY_PARAMETERS, LONG_LINE = 300, 60, 8, 110


def functions(tree: ast.AST) -> list[ast.FunctionDef]:
    """Return all functions of a module."""
    return [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]


def length(function: ast.FunctionDef) -> int:
    """Return the lines of a function without its docstring."""
    first = function.body[0]
    assert function.end_lineno is not None
    assert first.end_lineno is not None
    documentation = first.end_lineno - first.lineno + 1 if ast.get_docstring(function) else 0
    return function.end_lineno - function.lineno + 1 - documentation


def parameters(function: ast.FunctionDef) -> int:
    """Return the number of parameters of a function, without ``self``."""
    given = function.args.posonlyargs + function.args.args + function.args.kwonlyargs
    return sum(each.arg not in ("self", "cls") for each in given)


def measure(root: Path) -> dict[str, str]:
    """Return the figures of a checkout by name."""
    sources = {path: path.read_text() for layer in LAYERS for path in sorted((root / layer).rglob("*.py"))}
    found = [each for text in sources.values() for each in functions(ast.parse(text))]
    lengths, counts = [length(each) for each in found], [parameters(each) for each in found]
    modules = [path for path in sources if path.name != "__init__.py"]
    tests = root / "tests"
    mirrored = {path: tests / path.parent.relative_to(root) / f"test_{path.name}" for path in modules}
    tested = [path for path, test in mirrored.items() if test.exists()]
    lines = [
        line
        for folder in (*LAYERS, "benchmarks", "src", "tests")
        for path in (root / folder).rglob("*.py")
        if not any(parent.is_symlink() for parent in path.parents)
        for line in path.read_text().splitlines()
    ]
    return {
        "files above 300 lines": str(sum(text.count("\n") > LONG_FILE for text in sources.values())),
        "longest function [lines]": str(max(lengths)),
        "functions above 60 lines": str(sum(each > LONG_FUNCTION for each in lengths)),
        "most parameters": str(max(counts)),
        "functions above 8 parameters": str(sum(each > MANY_PARAMETERS for each in counts)),
        "lines beyond 110 columns": str(sum(len(line) > LONG_LINE for line in lines)),
        "calls that skip formatting": str(sum(SKIPS in line for line in lines)),
        "modules with a test at the mirrored path": f"{len(tested)} of {len(modules)}",
    }


if __name__ == "__main__":
    checkout = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).resolve().parents[2]
    for what, figure in measure(checkout).items():
        print(f"| {what} | {figure} |")
