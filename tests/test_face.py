"""The face of the package: what `import lidarium` offers, and that documents use nothing else."""

import ast
import doctest
import importlib
import inspect
import re
from pathlib import Path

import pytest

import lidarium
from lidarium.registry import REGISTRIES

ROOT = Path(__file__).resolve().parents[1]
NAMES = [name for name in lidarium.__all__ if not name.startswith("__")]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")), *sorted((ROOT / "docs").rglob("*.py"))]


def imported(source):
    """Modules of the package that a program imports from."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "lidarium":
            yield node.module
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name.split(".")[0] == "lidarium")


@pytest.mark.parametrize("name", NAMES)
def test_a_name_is_found_and_documented(name):
    found = getattr(lidarium, name)
    assert inspect.getdoc(found), name
    assert name in dir(lidarium)


def test_the_face_is_small_and_sorted():
    assert 40 <= len(NAMES) <= 64
    assert sorted(NAMES) == NAMES


def test_other_names_are_none():
    with pytest.raises(AttributeError, match="module 'lidarium' has no attribute 'paralel_env'"):
        _ = lidarium.paralel_env


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_documents_import_from_the_face_alone(path):
    text = path.read_text(encoding="utf-8")
    blocks = [text] if path.suffix == ".py" else re.findall(r"^```python\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    assert {module for block in blocks for module in imported(block)} <= {"lidarium"}


def test_the_api_page_documents_every_name():
    page = (ROOT / "docs" / "reference" / "api.md").read_text(encoding="utf-8")
    named = set(re.findall(r"auto(?:function|class):: lidarium\.(\w+)$", page, re.MULTILINE))
    assert named == set(NAMES)


@pytest.fixture
def clean_registries():
    """Take away what an example registers."""
    before = {kind: set(lidarium.registry(kind)) for kind in REGISTRIES}
    yield
    for kind, names in before.items():
        for name in set(lidarium.registry(kind)) - names:
            lidarium.registry(kind).unregister(name)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.usefixtures("clean_registries")
def test_examples_in_docstrings_run(name):
    found = getattr(lidarium, name)
    tests = doctest.DocTestFinder(recurse=False).find(found, name, globs={"lidarium": lidarium})
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    assert all(runner.run(test).failed == 0 for test in tests)


def test_types_know_the_same_names():
    """What type checkers see is what is imported when it is used."""
    tree = ast.parse((ROOT / "src" / "lidarium" / "__init__.py").read_text(encoding="utf-8"))
    seen = {
        alias.asname or alias.name: getattr(importlib.import_module(node.module), alias.name)
        for statement in tree.body
        if isinstance(statement, ast.If | ast.ImportFrom)
        for node in ast.walk(statement)
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("lidarium.")
        for alias in node.names
    }
    assert set(seen) == set(NAMES)
    assert all(getattr(lidarium, name) is thing for name, thing in seen.items())
